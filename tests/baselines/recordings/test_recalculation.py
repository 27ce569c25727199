"""Recalculation and refinement of the radius agree with matrix filters."""

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from baselines import track_ate
from hybrid_env.simulation import simulate

START = np.array([0.0, 0.0, 0.0, 2.0])
RADII = [0.0, 5.0, -5.0]


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
                    estimate, covariance = tracks.estimates[run, k], tracks.covariances[run, k]
                    np.testing.assert_allclose(estimate, chosen.x, atol=1e-11)
                    np.testing.assert_allclose(
                        covariance,
                        [chosen.P[[0, 0, 1], [0, 1, 1]], chosen.P[[2, 2, 3], [2, 3, 3]]],
                        atol=1e-12,
                    )
                    assert tracks.modes[run, k] == mode
            anchor = tracks.estimates[run, first + 59]
