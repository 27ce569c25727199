"""Airliners of BlueSky turn at the rate of their bank and speed."""

import numpy as np
import pytest

from studies.simulators import airliners
from studies.simulators.aircraft import GRAVITY
from studies.simulators.airliners import AIRLINERS, TOGETHER
from studies.simulators.paths import CONTROL

pytest.importorskip("bluesky")
DURATION = 240.0


@pytest.fixture(scope="module", params=AIRLINERS)
def flown(request):
    craft = AIRLINERS[request.param]
    return craft, [craft.travel(seed, DURATION) for seed in range(TOGETHER)]


def test_airliners_turn_at_the_rate_of_their_bank_and_speed(flown):
    craft, paths = flown
    for path in paths:
        speed = np.hypot(path.states[:, 1], path.states[:, 3])
        rate = np.gradient(
            np.unwrap(np.arctan2(path.states[:, 3], path.states[:, 1])),
            CONTROL,
        )
        steady = np.ones(len(rate), np.bool_)
        for switch in np.flatnonzero(np.diff(path.modes)):
            steady[switch - 2 : switch + 4] = False
        assert np.abs(rate[steady & (path.modes == 0)]).max(initial=0.0) < 1e-3
        turning = steady & (path.modes != 0)
        banks = np.degrees(np.arctan(speed * np.abs(rate) / GRAVITY))[turning] / craft.bank
        assert banks.min(initial=1.0) > 0.84
        assert banks.max(initial=1.0) < 1.16
        assert np.all((rate[turning] > 0.0) == (path.modes[turning] == 1))


def test_airliners_are_those_of_their_seeds_whatever_flew_before(capfd):
    craft = AIRLINERS["narrow-body"]
    first = [path.states for path in airliners._fly_together.__wrapped__(craft, 1, 20.0)]
    airliners._fly_together.__wrapped__(AIRLINERS["wide-body"], 0, 7.0)
    again = [path.states for path in airliners._fly_together.__wrapped__(craft, 1, 20.0)]

    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(
        first[3],
        craft.travel(TOGETHER + 3, 20.0).states,
    )
    assert capfd.readouterr().out == ""
