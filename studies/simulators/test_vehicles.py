"""What moves turns as it is commanded, and as deciders are told."""

import numpy as np
import pytest

from studies.simulators.cars import TURNING
from studies.simulators.vehicles import CONTROL
from studies.simulators.worlds import VEHICLES


def turn_rates(path):
    """Return speeds (n,) [m/s] and turn rates [rad/s], positive in turns of the mode."""
    east, north = path.states.T[1::2]
    rates = np.gradient(np.unwrap(np.arctan2(north, east)), CONTROL)
    return np.hypot(east, north), rates * np.array([1.0, 1.0, -1.0])[path.modes]


# The aircraft has to roll.
@pytest.mark.parametrize(("kind", "seconds"), [("fighter", 12.0), ("narrow-body", 0.4)])
def test_aircraft_turn_as_commanded(kind, seconds):
    craft = VEHICLES[kind]
    pytest.importorskip(craft.simulator.lower())
    path = craft.travel(3, 300.0)
    speeds, rates = turn_rates(path)
    settled = np.full(len(rates), True)
    for switch in (0, *np.flatnonzero(np.diff(path.modes))):
        settled[max(switch - 2, 0) : switch + round(seconds / CONTROL)] = False
    turned = np.abs(rates * craft.lasting[0] - (path.modes != 0))[settled]

    assert turned.max() < 0.5
    assert turned[path.modes[settled] == 0].max() < 0.1
    assert np.abs(speeds / craft.speed - 1.0).max() < 0.2


def test_a_net_has_the_speed_the_radius_and_the_durations_that_deciders_are_told():
    pytest.importorskip("sumo")
    net = VEHICLES["ring roads"]
    paths = net.paths(0, 300.0)
    speeds, rates = np.concatenate([turn_rates(path) for path in paths], axis=1)
    turning = np.concatenate([path.modes > 0 for path in paths]) & (rates > TURNING)
    lengths = [np.diff(np.flatnonzero(np.diff(path.modes))) for path in paths]

    assert np.median(speeds) == pytest.approx(net.speed, rel=0.15)
    assert np.median(speeds[turning] / rates[turning]) == pytest.approx(net.radius, rel=0.3)
    lasting = CONTROL * np.concatenate(lengths).mean()
    assert lasting == pytest.approx(sum(net.lasting), rel=0.2)


@pytest.mark.parametrize("kind", ["airliner", "narrow-body", "grid"])
def test_paths_are_those_of_their_seeds_whatever_moved_before(kind, capfd):
    vehicle = VEHICLES[kind]
    pytest.importorskip(vehicle.simulator.lower())
    first, again, other = (vehicle.paths(block, 20.0)[0].states for block in (1, 1, 0))

    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(vehicle.travel(vehicle.block_size, 20.0).states, first)
    assert capfd.readouterr() == ("", "")
