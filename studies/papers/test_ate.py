"""ATE on recordings agrees with ATE in the environment and with matrix filters."""

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines import SPRTDecider
from hybrid_env import HybridTrackVectorEnv, simulate
from hybrid_env.core.memory import TRACE_COLUMNS
from studies.papers.ate import track_ate

MEASURED = [TRACE_COLUMNS.index("measured_x"), TRACE_COLUMNS.index("measured_y")]
TRUE = [TRACE_COLUMNS.index("x"), TRACE_COLUMNS.index("y")]
DECISION = ("decided_mode", "ticks", "forced", "decided_length", "decided_squared_error")
START = np.array([0.0, 0.0, 0.0, 2.0])
RADII = [0.0, 5.0, -5.0]


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


# The ratios of the first are far outside the clipping range of the observation.
@pytest.mark.parametrize(("alpha", "undecided"), [(1e-10, "likeliest"), (1e-3, "keep")])
def test_ate_on_recordings_decides_and_estimates_as_in_the_environment(alpha, undecided):
    options = {"radii": tuple(range(1, 11)), "undecided": undecided}
    for start, trace, made in record_episodes(15, alpha, **options):
        lengths = made[:, 3].astype(int)
        tracks = track_ate(trace[None, :, MEASURED], lengths, start, alpha=alpha, **options)
        np.testing.assert_array_equal(tracks.decided[0], made[:, 0])
        np.testing.assert_array_equal(tracks.ticks[0], made[:, 1])
        np.testing.assert_array_equal(tracks.undecided[0], made[:, 2])
        squares = ((tracks.estimates[0, :, ::2] - trace[:, TRUE]) ** 2).sum(1)
        first = np.cumsum(lengths) - lengths
        np.testing.assert_allclose(np.add.reduceat(squares, first), made[:, 4], rtol=1e-6)


def matrix_filter(start, radius):
    return MatrixKalmanFilter(start, np.eye(4), radius, 0.1, 0.001, 0.1 * np.eye(2))


@pytest.mark.parametrize("recalculation", ["as_published", "rewind", "literal"])
def test_recalculated_estimates_are_those_of_the_chosen_filter_since_the_switch(recalculation):
    recording = simulate("S60 L60r5 R60r5", runs=3, seed=4)
    tracks = track_ate(
        recording.measurements, recording.lengths, START, recalculation=recalculation
    )

    assert not tracks.undecided.all(1).any()
    for run in range(3):
        anchor = START
        for segment in range(3):
            first = 60 * segment
            mode = tracks.decided[run, segment]
            chosen = matrix_filter(anchor, RADII[mode])
            if recalculation != "rewind" and not tracks.undecided[run, segment]:
                # The centre of a turn remains its own.
                first_pass = matrix_filter(anchor, RADII[mode])
                for z in recording.measurements[run, first : first + tracks.ticks[run, segment]]:
                    first_pass.step(z)
                # The covariance is not restored.
                chosen.P = first_pass.P
                if recalculation == "literal":
                    chosen.x = first_pass.x
            for k in range(first, first + 60):
                chosen.step(recording.measurements[run, k])
                if not tracks.undecided[run, segment]:
                    np.testing.assert_allclose(tracks.estimates[run, k], chosen.x, atol=1e-11)
            anchor = tracks.estimates[run, first + 59]
