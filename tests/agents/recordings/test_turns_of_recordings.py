"""Speed, radius and forecasts of a tracked recording."""

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from recorded_tracks import OBJECTS

from agents import track_recording
from agents.recordings.figure import draw_forecast, draw_recording, forecast_at_end

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
    # Without noise the last positions ahead are on the straight line.
    means, covariances = forecast_at_end(tracked)
    velocity = run.truth[0, -1, 1::2]
    ahead = run.truth[0, -1, ::2] + np.outer([5, 10, 20], velocity)
    for mean, covariance, place in zip(means, covariances, ahead, strict=True):
        error = mean - place
        assert error @ np.linalg.solve(covariance, error) < -2 * np.log(1e-4)


def test_two_measurements_have_no_forecast_that_changes_the_picture():
    tracked = track_recording([0.0, 1.0, 2.0], [[0, 0], [20, 0], [40.0, 1.0]])
    means, covariances = forecast_at_end(tracked)
    assert np.isfinite(means).all()
    assert np.isfinite(covariances).all()
    unknown = replace(tracked, covariances=np.full_like(tracked.covariances, np.inf))
    assert len(forecast_at_end(unknown)[0]) == 0
    ground = draw_recording(unknown).axes[0]
    assert ground.get_xlim() == draw_recording(tracked).axes[0].get_xlim()


def test_an_ellipse_holds_95_percent():
    axes = Figure().subplots()
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    draw_forecast(axes, np.array([[3.0, -2.0]]), covariance[None])
    (patch,) = axes.patches
    edge = patch.get_transform().transform(patch.get_path().vertices)
    places = axes.transData.inverted().transform(edge) - [3.0, -2.0]
    squares = np.einsum("ni,ij,nj->n", places, np.linalg.inv(covariance), places)
    # Control points of the curve are outside of the ellipse.
    on_edge = np.sort(squares)[: len(squares) // 3]
    np.testing.assert_allclose(on_edge, -2 * np.log(0.05), rtol=0.01)
