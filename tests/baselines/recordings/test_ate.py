"""ATE on recordings agrees with ATE in the environment and with an independent implementation."""

import functools

import numpy as np
import pytest

from baselines import SPRTDecider, track_ate
from baselines.rules import rollout
from hybrid_env import HybridTrackVectorEnv
from hybrid_env.core.memory import TRACE_COLUMNS

evaluate = functools.partial(rollout.evaluate, env_id="hybrid_env:HybridTrackPublished-v0")

MEASURED = [TRACE_COLUMNS.index("measured_x"), TRACE_COLUMNS.index("measured_y")]
ESTIMATED = [TRACE_COLUMNS.index("estimate_x"), TRACE_COLUMNS.index("estimate_y")]
TRUE = [TRACE_COLUMNS.index("x"), TRACE_COLUMNS.index("y")]


def record_episodes(tracks: int, alpha: float = 1e-3, **options):
    """Run one episode per track with the decider. Returns first anchors, traces and decisions."""
    env = HybridTrackVectorEnv(
        tracks,
        tick_info=True,
        trace_rows=201,
        **options,
    )
    decider = SPRTDecider(alpha)
    observation, info = env.reset(seed=77)
    starts = info["anchor"].copy()
    traces = [[env.world.read_trace(i)] for i in range(tracks)]
    decisions = [[] for _ in range(tracks)]
    state = None
    running = np.ones(tracks, bool)
    while running.any():
        actions, state = decider.predict(observation, state)
        observation, _, terminated, _, info = env.step(actions)
        for i in np.flatnonzero(running):
            traces[i].append(env.world.read_trace(i))
            if info.get("_ticks", running & False)[i]:
                keys = (
                    "decided_mode",
                    "ticks",
                    "forced",
                    "decided_length",
                    "decided_squared_error",
                )
                decisions[i].append([info[key][i] for key in keys])
        running &= ~terminated
    return starts, [np.concatenate(rows) for rows in traces], [np.array(rows) for rows in decisions]


BANK = {"radii": tuple(range(1, 11))}


@pytest.mark.parametrize(
    ("count", "alpha", "options"),
    [
        (20, 1e-3, {}),
        (12, 1e-3, {"radii": (2.0, 4.0, 8.0)}),
        (12, 1e-3, {"measurement_variance": (0.1, 0.4)}),
        # Ratios far outside the clipping range of the observation.
        (12, 1e-10, BANK),
        (12, 1e-3, BANK | {"measurement_variance": 0.01}),
        (12, 0.1, {"radii": (1.0, 5.0, 25.0), "measurement_variance": 0.001}),
    ],
)
def test_ate_on_recordings_makes_the_same_decisions_as_the_decider_in_the_environment(
    count,
    alpha,
    options,
):
    starts, traces, decisions = record_episodes(count, alpha, **options)
    for start, trace, made in zip(starts, traces, decisions, strict=True):
        tracks = track_ate(
            trace[:, MEASURED],
            made[:, 3].astype(int),
            start,
            undecided="likeliest",
            alpha=alpha,
            **({"measurement_variance": 0.1} | options),
        )
        np.testing.assert_array_equal(tracks.decided, made[:, 0])
        np.testing.assert_array_equal(tracks.ticks, made[:, 1])
        np.testing.assert_array_equal(tracks.undecided, made[:, 2])
        np.testing.assert_allclose(
            tracks.estimates[:, [0, 2]],
            trace[:, ESTIMATED],
            atol=1e-9,
        )


@pytest.mark.parametrize("recalculation", [False, True])
@pytest.mark.parametrize("refine_radius", [False, True])
def test_recalculated_and_refined_estimates_are_those_of_the_environment(
    recalculation,
    refine_radius,
):
    changes = {
        "recalculation": recalculation,
        "refine_radius": refine_radius,
        "undecided": "keep",
    }
    refined = 0
    for start, trace, made in zip(
        *record_episodes(
            50,
            1e-3,
            **BANK,
            **changes,
        ),
        strict=True,
    ):
        lengths = made[:, 3].astype(int)
        tracks = track_ate(
            trace[:, MEASURED],
            lengths,
            start,
            **BANK,
            **changes | {"recalculation": "rewind" if recalculation else "none"},
        )
        np.testing.assert_array_equal(tracks.ticks, made[:, 1])
        squares = ((tracks.estimates[:, [0, 2]] - trace[:, TRUE]) ** 2).sum(1)
        first = np.cumsum(lengths) - lengths
        np.testing.assert_allclose(
            np.add.reduceat(squares, first),
            made[:, 4],
            rtol=1e-9,
        )
        refined += (tracks.decided != made[:, 0]).sum()
        # The type is the declared one.
        np.testing.assert_array_equal(
            (tracks.decided + 9) // 10,
            (made[:, 0] + 9) // 10,
        )

    assert (refined > 50) == refine_radius


@pytest.mark.parametrize(
    ("alpha", "accuracy", "ticks"),
    [(0.1, 0.846, 20.4), (0.01, 0.935, 24.5), (0.001, 0.958, 26.9), (1e-6, 0.986, 31.5)],
)
def test_ate_has_the_accuracy_and_decision_time_of_an_independent_implementation(
    alpha,
    accuracy,
    ticks,
):
    # 9,000 segments: standard errors of at most .004 and .1 tick; tolerances .012 and .6.
    decisions = evaluate(SPRTDecider(alpha), episodes=1500, seed=123)
    assert decisions.correct.mean() == pytest.approx(accuracy, abs=0.012)
    assert decisions.ticks.mean() == pytest.approx(ticks, abs=0.6)


def test_a_batch_of_runs_equals_separate_runs():
    _, traces, _ = record_episodes(3, scheme="S40 L60r5 R50r5")
    batch = np.stack([trace[:, MEASURED] for trace in traces])
    together = track_ate(batch, [40, 60, 50])
    for i, measurements in enumerate(batch):
        alone = track_ate(measurements, [40, 60, 50])
        np.testing.assert_array_equal(together.estimates[i], alone.estimates)
        np.testing.assert_array_equal(together.modes[i], alone.modes)
