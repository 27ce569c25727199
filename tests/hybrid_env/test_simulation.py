import numpy as np
import pytest

from hybrid_env import ArgumentError, simulate
from hybrid_env.modes import Accelerate, LinearMode, Stop, Straight


def test_modes_of_the_user_move_as_their_formulas_say():
    drift = LinearMode(np.eye(4), [0.1, 0.0, 0.0, 0.0], name="drift")
    run = simulate(
        "50 straight, 30 stop, 20 accelerate 1, 10 drift",
        2,
        modes=(Straight(), Stop(), Accelerate(1.0), drift),
        process_variance=0.0,
    )
    x, vx, y, vy = run.truth[1, [49, 79, 99, 109]].T

    # 50 ticks of 0.1 s at 2 m/s, a stop, 2 s with 1 m/s^2, and 10 ticks of 0.1 m.
    assert y == pytest.approx([10.0, 10.0, 16.0, 16.0])
    assert vy == pytest.approx([2.0, 2.0, 4.0, 4.0])
    assert x == pytest.approx([0.0, 0.0, 0.0, 1.0])
    assert vx == pytest.approx(np.zeros(4))
    assert run.modes.tolist() == [0, 1, 2, 3]


def test_turns_follow_their_scheme():
    start = (0.0, 1.2, 0.0, 0.9)
    run = simulate("S50 L100r5 R100r5", start=start, process_variance=0.0)
    x, vx, y, vy = run.truth[0, [49, 149, 249]].T

    assert (x[0], y[0]) == pytest.approx((6.0, 4.5))
    # 10 s at 1.5 m/s are 3 rad of a circle of 5 m.
    heading = np.arctan2(0.9, 1.2) + np.array([0.0, 3.0, 0.0])
    np.testing.assert_allclose(vx + 1j * vy, 1.5 * np.exp(1j * heading))


def test_the_same_modes_by_name_or_by_radius_give_the_same_runs():
    told = simulate("S50 R50r5", 3, seed=1)
    named = simulate("50 straight, 50 right 5", 3, seed=1, modes="straight, left 5, right 5")

    np.testing.assert_array_equal(named.truth, told.truth)
    np.testing.assert_array_equal(named.measurements, told.measurements)
    assert named.modes.tolist() == told.modes.tolist() == [0, 2]
    assert named.signed_radii.tolist() == [0.0, -5.0]


def test_a_scheme_of_other_modes_is_refused():
    with pytest.raises(ArgumentError, match="stop"):
        simulate("50 straight, 30 accelerate 1", modes="straight, stop")
