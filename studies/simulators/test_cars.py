"""Cars of SUMO have the speed, radius and durations that deciders are told."""

import numpy as np
import pytest

from studies.simulators import cars
from studies.simulators.cars import CARS, TOGETHER
from studies.simulators.paths import CONTROL

pytest.importorskip("sumo")
DURATION = 300.0


@pytest.fixture(scope="module", params=CARS)
def driven(request):
    net = CARS[request.param]
    return net, [net.travel(seed, DURATION) for seed in range(TOGETHER)]


def test_a_net_has_the_speed_the_radius_and_the_durations_that_deciders_are_told(driven):
    net, paths = driven
    speeds = [np.median(np.hypot(path.states[:, 1], path.states[:, 3])) for path in paths]

    assert np.median(speeds) == pytest.approx(net.speed, rel=0.15)
    radii = []
    lengths = []
    for points, path in zip(
        cars._drive(net, 0, round(DURATION / CONTROL)),
        paths,
        strict=True,
    ):
        rate = np.abs(np.gradient(np.unwrap(np.radians(points[:, 2])), CONTROL))
        turning = (path.modes > 0) & (rate > cars.TURNING)
        radii.append(
            (np.hypot(path.states[:, 1], path.states[:, 3]) / np.maximum(rate, cars.TURNING))[
                turning
            ]
        )
        lengths.append(CONTROL * np.diff(np.flatnonzero(np.diff(path.modes))))
    assert np.median(np.concatenate(radii)) == pytest.approx(net.radius, rel=0.3)
    assert np.concatenate(lengths).mean() == pytest.approx(sum(net.lasting), rel=0.2)


def test_cars_are_those_of_their_seeds():
    net = CARS["grid"]
    first = [path.states for path in cars._drive_together.__wrapped__(net, 1, 20.0)]
    again = [path.states for path in cars._drive_together.__wrapped__(net, 1, 20.0)]

    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first[0], net.travel(0, 20.0).states)
    np.testing.assert_array_equal(
        first[3],
        net.travel(TOGETHER + 3, 20.0).states,
    )
