"""Aircraft of JSBSim turn as commanded, but need time to roll."""

import numpy as np
import pytest

from studies.simulators.aircraft import AIRCRAFT
from studies.simulators.paths import CONTROL


@pytest.mark.parametrize("kind", AIRCRAFT)
def test_aircraft_turn_as_commanded_after_they_have_rolled(kind):
    pytest.importorskip("jsbsim")
    craft = AIRCRAFT[kind]
    path = AIRCRAFT[kind].travel(3, 300.0)
    vx = path.states[:, 1]
    vy = path.states[:, 3]
    rates = np.gradient(np.unwrap(np.arctan2(vy, vx)), CONTROL)
    settled = np.full(len(rates), True)
    for switch in (0, *np.flatnonzero(np.diff(path.modes))):
        settled[switch : switch + 1 + round(12.0 / CONTROL)] = False
        change = rates[switch + round(0.5 / CONTROL)] - rates[switch]
        # It takes seconds to roll.
        assert abs(change) * craft.lasting[0] < 0.7
    signs = np.array([0.0, 1.0, -1.0])[path.modes]
    turning = settled & (path.modes != 0)
    turned = rates[turning] * signs[turning] * craft.lasting[0]

    assert 0.7 < turned.min() < turned.max() < 1.5
    assert np.abs(rates[settled & (path.modes == 0)]).max() * craft.lasting[0] < 0.1
    speeds = np.hypot(vx, vy)
    assert np.abs(speeds / craft.speed - 1.0).max() < 0.05
    # It changes in turns.
    assert np.ptp(speeds) > 0.002 * craft.speed
    moved = np.diff(path.states[:, ::2], axis=0) / CONTROL
    assert np.abs(moved - path.states[1:, 1::2]).max() < 0.02 * craft.speed


def test_flights_are_those_of_their_seeds(capfd):
    pytest.importorskip("jsbsim")
    first, other = (AIRCRAFT["airliner"].travel(seed, 20.0).states for seed in (5, 6))

    np.testing.assert_array_equal(
        AIRCRAFT["airliner"].travel(5, 20.0).states,
        first,
    )
    assert not np.array_equal(first, other)
    assert capfd.readouterr() == ("", "")
