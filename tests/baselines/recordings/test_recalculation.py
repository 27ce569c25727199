"""Recalculation and refinement of the radius agree with matrix filters."""

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines import track_ate
from hybrid_env.simulation import simulate

START = np.array([0.0, 0.0, 0.0, 2.0])
MODES = [
    ("S", 0.0),
    ("L", 5.0),
    ("R", 5.0),
]


def matrix_filter(start, P, mode, radius, R=0.1, Q=0.001):
    return MatrixKalmanFilter(
        start,
        P,
        mode,
        radius,
        0.1,
        Q,
        R * np.eye(2),
    )


def blocks(P):
    return [(P[k, k], P[k, k + 1], P[k + 1, k + 1]) for k in (0, 2)]


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
            P = np.eye(4)
            first_state = anchor
            if recalculation != "rewind" and not tracks.undecided[run, segment]:
                # The centre of a turn remains its own.
                first_pass = matrix_filter(anchor, P, *MODES[mode])
                for z in recording.measurements[run, first : first + tracks.ticks[run, segment]]:
                    first_pass.step(z)
                # The covariance is not restored.
                P = first_pass.P
                if recalculation == "literal":
                    first_state = first_pass.x
            chosen = matrix_filter(anchor, P, *MODES[mode])
            chosen.x = first_state
            for k in range(first, first + 60):
                chosen.step(recording.measurements[run, k])
                if not tracks.undecided[run, segment]:
                    np.testing.assert_allclose(
                        tracks.estimates[run, k],
                        chosen.x,
                        atol=1e-11,
                    )
                    np.testing.assert_allclose(
                        tracks.covariances[run, k],
                        blocks(chosen.P),
                        atol=1e-12,
                    )
                    assert tracks.modes[run, k] == mode
            anchor = tracks.estimates[run, first + 59]
