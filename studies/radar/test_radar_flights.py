"""Flights of the point mass and of the quadrotor in PyBullet; radars, their noise and merged
measurements.
"""

import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest

from studies.radar import flights as model
from studies.radar import radars
from studies.radar.filters import moving_average
from studies.radar.flights import fly_point_masses
from studies.radar.radars import draw_noise, measure, scan_flight

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def flights():
    return model.point_mass_flights(12, 0)


@pytest.fixture(scope="module")
def scans(flights):
    return [
        scan_flight(flight, np.random.default_rng((3, k))) for k, flight in enumerate(flights[:8])
    ]


def hairpin():
    """A path that turns back within a few metres at full speed."""
    out = np.array([[100.0 * k, 0.0, 200.0] for k in range(6)])
    back = np.array([[500.0 - 100.0 * k, 5.0 + 300.0 * k, 200.0] for k in range(1, 3)])
    return np.concatenate([out, back])


def test_flights_have_the_speed_of_the_thesis_and_respect_the_limits(flights):
    speeds = [np.linalg.norm(flight.velocities, axis=1).mean() for flight in flights]
    assert np.mean(speeds) == pytest.approx(50.0, abs=1.0)
    for flight in flights:
        middle = (flight.velocities[1:] + flight.velocities[:-1]) / 2.0
        steps = np.diff(flight.positions, axis=0) / model.RECORD_STEP
        # Drag within a step.
        np.testing.assert_allclose(steps, middle, atol=0.05)
        change = np.diff(flight.velocities, axis=0) / model.RECORD_STEP
        thrust = change + np.array([0.0, 0.0, model.GRAVITY]) - model.drag(flight.velocities[:-1])
        assert np.linalg.norm(thrust, axis=1).max() < 1.01 * model.LARGEST_FORCE
        assert flight.positions[:, 2].min() > 0.0


def test_flights_do_not_depend_on_how_many_are_flown_at_once(flights, monkeypatch):
    monkeypatch.setattr(model, "BATCH", 2)
    again = model.point_mass_flights(3, 0)
    for first, other in zip(flights, again, strict=False):
        np.testing.assert_array_equal(first.positions, other.positions)


def test_a_path_that_cannot_be_flown_is_discarded():
    straight = np.array([[100.0 * k, 0.0, 200.0] for k in range(6)])
    flown = fly_point_masses([straight, hairpin()])

    assert flown[0] is not None
    assert flown[1] is None


@pytest.fixture(scope="module")
def quadrotor():
    """The example of the gallery, which also flies a route."""
    pytest.importorskip("pybullet")
    matplotlib.use("agg")
    return runpy.run_path(str(ROOT / "docs/examples/example_15_quadrotor.py"))


def test_quadrotor_and_point_mass_fly_alike(quadrotor):
    # It misses its waypoints.
    assert quadrotor["fly_quadrotor"](hairpin()) is None
    # Half a second of flight: both pass the same waypoints in time.
    assert quadrotor["apart"].max() < 30.0


def test_each_radar_measures_once_a_second_whatever_is_in_its_range(flights, scans):
    for flight, scan in zip(flights, scans, strict=False):
        assert (np.diff(scan.times) > 0.0).all()
        for index, radar in enumerate(scan.radars):
            times = scan.times[scan.radar == index]
            seconds = np.diff(times) / radars.PERIOD
            np.testing.assert_allclose(seconds, seconds.round(), atol=1e-9)
            # The same moments by the flight's own record: those in range are measured, no others.
            all_times = np.arange(
                times[0] % radars.PERIOD,
                flight.times[-1],
                radars.PERIOD,
            )
            expected = [
                time
                for time in all_times
                if np.linalg.norm(flight.states_at(np.array([time]))[0][0] - radar) <= radars.RANGE
            ]
            np.testing.assert_allclose(times, expected, atol=1e-9)
        positions, velocities = flight.states_at(scan.times)
        np.testing.assert_allclose(scan.positions, positions)
        np.testing.assert_allclose(scan.velocities, velocities)
    steps = np.concatenate([np.diff(scan.times) for scan in scans])
    # Two radars never measure at once.
    assert steps.min() > 0.49 * radars.PERIOD
    # Half a period, a period, and gaps.
    assert len(np.unique(steps.round(6))) >= 3


def test_gaussian_noise_has_its_deviation_and_levy_noise_its_characteristic_function():
    count = 30_000
    gaussian = draw_noise("gaussian", count, np.random.default_rng(0))
    # 4 standard errors of a deviation, 1 / sqrt(2 n) each.
    assert gaussian.std() == pytest.approx(radars.SIGMA, rel=4.0 / np.sqrt(6 * count))
    levy = draw_noise("levy", count, np.random.default_rng(1))
    assert np.abs(levy).max() == radars.CLIP
    for frequency in (0.02, 0.08):
        expected = np.exp(-((radars.SIGMA * frequency) ** radars.STABILITY))
        # 4 standard errors of a mean of cosines, at most sqrt(1/2) each, and 3e-4 of the draws are
        # clipped.
        bound = 4.0 * np.sqrt(0.5 / (3 * count)) + 2 * 3e-4
        assert np.cos(frequency * levy).mean() == pytest.approx(expected, abs=bound)


def test_noise_of_a_flight_does_not_depend_on_the_other_flights(scans):
    all_tracks = measure(scans, "levy", (0, 1))
    alone = measure(
        scans[:1],
        "levy",
        (0, 1),
    )
    count = len(scans[0].times)

    np.testing.assert_array_equal(
        all_tracks.measurements[0, :count],
        alone.measurements[0],
    )
    assert np.isnan(all_tracks.measurements[0, count:]).all()
    assert (np.diff(all_tracks.times, axis=1) >= 0.0).all()


@pytest.mark.parametrize("window", [1, 2, 7, 100])
def test_moving_average_equals_pandas(window):
    pandas = pytest.importorskip("pandas")
    values = np.random.default_rng(3).normal(size=(40, 3))
    values[[0, 5, 6, 20]] = np.nan
    expected = pandas.DataFrame(values).rolling(window, min_periods=1).mean().to_numpy().copy()
    expected[np.isnan(values)] = np.nan

    np.testing.assert_allclose(
        moving_average(values, window),
        expected,
        rtol=0.0,
        atol=1e-9,
    )
