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
TRUE = [TRACE_COLUMNS.index("x"), TRACE_COLUMNS.index("y")]
DECISION = ("decided_mode", "ticks", "forced", "decided_length", "decided_squared_error")


def record_episodes(tracks: int, alpha: float, **options):
    """Run one episode per track with the decider. Returns first anchors, traces and decisions."""
    env = HybridTrackVectorEnv(tracks, tick_info=True, trace_rows=201, **options)
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
                decisions[i].append([info[key][i] for key in DECISION])
        running &= ~terminated
    return zip(starts, map(np.concatenate, traces), map(np.array, decisions), strict=True)


@pytest.mark.parametrize(
    ("alpha", "recalculation", "options"),
    [
        (1e-3, "none", {"measurement_variance": (0.1, 0.4)}),
        # Ratios far outside the clipping range of the observation.
        (1e-10, "none", {}),
        (1e-3, "rewind", {"refine_radius": True, "undecided": "keep"}),
    ],
)
def test_ate_on_recordings_decides_and_estimates_as_in_the_environment(
    alpha, recalculation, options
):
    options = {"radii": tuple(range(1, 11)), "undecided": "likeliest"} | options
    refined = 0
    for start, trace, made in record_episodes(
        15, alpha, recalculation=recalculation == "rewind", **options
    ):
        lengths = made[:, 3].astype(int)
        tracks = track_ate(
            trace[:, MEASURED], lengths, start, alpha=alpha, recalculation=recalculation, **options
        )
        # Refinement changes the radius, not the type.
        np.testing.assert_array_equal((tracks.decided + 9) // 10, (made[:, 0] + 9) // 10)
        np.testing.assert_array_equal(tracks.ticks, made[:, 1])
        np.testing.assert_array_equal(tracks.undecided, made[:, 2])
        squares = ((tracks.estimates[:, ::2] - trace[:, TRUE]) ** 2).sum(1)
        first = np.cumsum(lengths) - lengths
        np.testing.assert_allclose(np.add.reduceat(squares, first), made[:, 4], rtol=1e-9)
        refined += (tracks.decided != made[:, 0]).sum()

    assert refined > 15 if "refine_radius" in options else refined == 0


@pytest.mark.parametrize(("alpha", "accuracy", "ticks"), [(0.1, 0.846, 20.4), (1e-6, 0.986, 31.5)])
def test_ate_has_the_accuracy_and_decision_time_of_an_independent_implementation(
    alpha, accuracy, ticks
):
    # 9,000 segments: standard errors of at most .004 and .1 tick; tolerances .012 and .6.
    decisions = evaluate(SPRTDecider(alpha), episodes=1500, seed=123)
    assert decisions.correct.mean() == pytest.approx(accuracy, abs=0.012)
    assert decisions.ticks.mean() == pytest.approx(ticks, abs=0.6)
