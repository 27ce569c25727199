"""Speed and radius of a tracked recording."""

import numpy as np
from recorded_tracks import OBJECTS

from agents import track_recording

CAR = OBJECTS["car"]


def test_a_recording_has_the_radius_of_the_object_and_not_that_of_the_hypothesis():
    run = CAR.simulate(1, 5, "SLS", (40, 50, 40))
    tracked = track_recording(
        CAR.times(130),
        run.measurements[0],
        radii=[212.0],
        measurement_variance=CAR.measurement_variance,
        process_variance=CAR.process_variance,
    )
    table = tracked.row_table()
    at = 80
    speed = np.hypot(*run.truth[0, at, 1::2])
    assert table["mode"][at] == "L"
    assert table["radius"][at] == 212.0
    assert abs(table["speed"][at] - speed) < 4 * table["speed_deviation"][at]
    error = table["radius_estimate"][at] - CAR.radius
    assert abs(error) < 4 * table["radius_deviation"][at] < 40
    assert table["radius_estimate"][-1] == np.inf
