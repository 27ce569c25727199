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
    found = track_ate(recording.measurements, recording.lengths, START, recalculation=recalculation)

    assert not found.undecided.all(1).any()
    for run in range(3):
        anchor = START
        for segment in range(3):
            first = 60 * segment
            mode = found.decided[run, segment]
            P = np.eye(4)
            first_state = anchor
            if recalculation != "rewind" and not found.undecided[run, segment]:
                # The centre of a turn remains its own.
                first_pass = matrix_filter(anchor, P, *MODES[mode])
                for z in recording.measurements[run, first : first + found.ticks[run, segment]]:
                    first_pass.step(z)
                # The covariance is not restored.
                P = first_pass.P
                if recalculation == "literal":
                    first_state = first_pass.x
            one = matrix_filter(anchor, P, *MODES[mode])
            one.x = first_state
            for k in range(first, first + 60):
                one.step(recording.measurements[run, k])
                if not found.undecided[run, segment]:
                    np.testing.assert_allclose(
                        found.estimates[run, k],
                        one.x,
                        atol=1e-11,
                    )
                    np.testing.assert_allclose(
                        found.covariances[run, k],
                        blocks(one.P),
                        atol=1e-12,
                    )
                    assert found.modes[run, k] == mode
            anchor = found.estimates[run, first + 59]


def test_refinement_improves_the_radius_and_keeps_the_decided_side():
    radii = tuple(range(1, 11))
    recording = simulate("L100r4", runs=40, seed=2, measurement_variance=0.01)
    plain = track_ate(recording.measurements, [100], START, radii=radii, measurement_variance=0.01)
    refined = track_ate(
        recording.measurements,
        [100],
        START,
        radii=radii,
        measurement_variance=0.01,
        refine_radius=True,
    )

    np.testing.assert_array_equal(plain.ticks, refined.ticks)
    assert (refined.decided == 4).mean() > (plain.decided == 4).mean()
    # 0 straight, 1 left, 2 right.
    plain_types, refined_types = (
        np.where(
            found.decided == 0,
            0,
            np.where(found.decided <= len(radii), 1, 2),
        )
        for found in (plain, refined)
    )
    np.testing.assert_array_equal(plain_types, refined_types)
