"""Flights of the point mass and of the quadrotor in PyBullet; radars, their noise and merged measurements."""

import runpy
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from scipy.interpolate import BPoly

from baselines.papers.novospaskyi import flights as model
from baselines.papers.novospaskyi import radars
from baselines.papers.novospaskyi.flights import bezier, flight_route, fly_point_masses
from baselines.papers.novospaskyi.radars import draw_noise, flight_errors, measure, scan_flight
from baselines.papers.reproduction import paired_ratio

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def flights():
    return model.point_mass_flights(12, 0)


@pytest.fixture(scope="module")
def scans(flights):
    return [scan_flight(flight, np.random.default_rng((3, k))) for k, flight in enumerate(flights[:8])]


def hairpin():
    """A path that turns back within a few metres at full speed."""
    out = np.array([[100.0 * k, 0.0, 200.0] for k in range(6)])
    back = np.array([[500.0 - 100.0 * k, 5.0 + 300.0 * k, 200.0] for k in range(1, 3)])
    return np.concatenate([out, back])


def test_a_curve_is_the_polynomial_in_bernstein_form():
    control_points = np.random.default_rng(0).uniform(0.0, 100.0, (5, 3))
    at = np.linspace(0.0, 1.0, 11)
    expected = BPoly(control_points[:, None, :], [0.0, 1.0])(at)
    np.testing.assert_allclose(bezier(control_points, at), expected, atol=1e-10)


def test_waypoints_are_evenly_spaced_on_a_long_curve_in_the_air_space():
    waypoints = flight_route(1, 0)
    low, high = np.array(model.SPACE).T
    assert (waypoints >= low).all()
    assert (waypoints <= high).all()
    steps = np.linalg.norm(np.diff(waypoints, axis=0), axis=1)
    # chords of equal arcs, a little shorter where the curve bends
    assert steps.max() < 1.1 * model.SPACING
    assert steps.sum() > 0.95 * model.SHORTEST


def test_flights_have_the_speed_of_the_thesis_and_respect_the_limits(flights):
    speeds = [np.linalg.norm(flight.velocities, axis=1).mean() for flight in flights]
    assert np.mean(speeds) == pytest.approx(50.0, abs=1.0)
    for flight in flights:
        middle = (flight.velocities[1:] + flight.velocities[:-1]) / 2.0
        steps = np.diff(flight.positions, axis=0) / model.RECORD_STEP
        np.testing.assert_allclose(steps, middle, atol=0.05)  # drag within a step
        change = np.diff(flight.velocities, axis=0) / model.RECORD_STEP
        thrust = change + np.array([0.0, 0.0, model.GRAVITY]) - model.drag(flight.velocities[:-1])
        assert np.linalg.norm(thrust, axis=1).max() < 1.01 * model.LARGEST_FORCE
        assert flight.positions[:, 2].min() > 0.0


def test_flights_do_not_depend_on_how_many_are_flown_at_once(flights, monkeypatch):
    monkeypatch.setattr(model, "BATCH", 2)
    again = model.point_mass_flights(3, 0)
    for one, other in zip(flights, again, strict=False):
        np.testing.assert_array_equal(one.positions, other.positions)


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


def test_a_quadrotor_hovers_and_turns_as_the_equations_of_a_rigid_body_say(quadrotor):
    body = quadrotor["Quadrotor"](np.array([0.0, 0.0, 100.0]), np.zeros(3))
    for _ in range(quadrotor["RATE"]):
        body.step()
    np.testing.assert_allclose(body.position, [0.0, 0.0, 100.0], atol=1e-3)
    # more force on the side of positive y: angular acceleration = torque / moment of inertia
    body.forces = body.forces + 0.01 * np.sign(quadrotor["ROTORS"][:, 1])
    torque = (quadrotor["ROTORS"][:, 1] * body.forces).sum()
    for _ in range(12):
        body.step()
    expected = torque / quadrotor["INERTIA"][0] * 12 / quadrotor["RATE"]
    np.testing.assert_allclose(body.rates, [expected, 0.0, 0.0], atol=0.02 * expected)
    # the rotors on one diagonal turn one way, and those on the other one the other way
    body.forces = body.forces + 0.1 * quadrotor["SPIN"]
    before = body.rates[2]
    body.step()
    expected = 4 * 0.1 * quadrotor["TORQUE_SHARE"] / quadrotor["INERTIA"][2] / quadrotor["RATE"]
    assert body.rates[2] - before == pytest.approx(expected, rel=0.05)


def test_the_attitude_controller_turns_a_tilted_quadrotor_upright(quadrotor):
    body = quadrotor["Quadrotor"](np.array([0.0, 0.0, 100.0]), np.array([30.0, 20.0, 0.0]))
    assert body.rotation[2, 2] < 0.99  # leans against the drag
    up = np.array([0.0, 0.0, model.GRAVITY])
    desired = quadrotor["desired_attitude"](up)
    for _ in range(quadrotor["RATE"]):
        body.forces = quadrotor["rotor_commands"](body.rotation, body.rates, desired, up)
        body.step()
    np.testing.assert_allclose(body.rotation, np.eye(3), atol=1e-3)


def test_quadrotor_and_point_mass_fly_alike(quadrotor):
    assert quadrotor["fly_quadrotor"](hairpin()) is None  # it misses its waypoints
    assert quadrotor["apart"].max() < 30.0  # half a second of flight: both pass the same waypoints in time


def test_radars_stand_near_the_flight_and_apart_from_each_other(flights, scans):
    for flight, scan in zip(flights, scans, strict=False):
        assert scan.radars.shape == (2, 3)
        assert np.linalg.norm(scan.radars[0] - scan.radars[1]) >= radars.SEPARATION
        for radar in scan.radars:
            ways = np.linalg.norm(flight.positions[:, :2] - radar[:2], axis=1)
            assert ways.min() <= radars.OFFSETS[1]
            assert radars.HEIGHTS[0] <= radar[2] <= radars.HEIGHTS[1]


def test_each_radar_measures_once_a_second_whatever_is_in_its_range(flights, scans):
    for flight, scan in zip(flights, scans, strict=False):
        assert (np.diff(scan.times) > 0.0).all()
        for index, radar in enumerate(scan.radars):
            times = scan.times[scan.radar == index]
            seconds = np.diff(times) / radars.PERIOD
            np.testing.assert_allclose(seconds, seconds.round(), atol=1e-9)
            # the same moments by the flight's own record: those in range are measured, no others
            all_times = np.arange(times[0] % radars.PERIOD, flight.times[-1], radars.PERIOD)
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
    assert steps.min() > 0.49 * radars.PERIOD  # two radars never measure at once
    assert len(np.unique(steps.round(6))) >= 3  # half a period, a period, and gaps


def test_gaussian_noise_has_its_deviation_and_levy_noise_its_characteristic_function():
    count = 30_000
    gaussian = draw_noise("gaussian", count, np.random.default_rng(0))
    # 4 standard errors of a deviation, 1 / sqrt(2 n) each
    assert gaussian.std() == pytest.approx(radars.SIGMA, rel=4.0 / np.sqrt(6 * count))
    levy = draw_noise("levy", count, np.random.default_rng(1))
    assert np.abs(levy).max() == radars.CLIP
    for frequency in (0.02, 0.08):
        expected = np.exp(-((radars.SIGMA * frequency) ** radars.STABILITY))
        # 4 standard errors of a mean of cosines, at most sqrt(1/2) each, and 3e-4 of the draws are clipped
        bound = 4.0 * np.sqrt(0.5 / (3 * count)) + 2 * 3e-4
        assert np.cos(frequency * levy).mean() == pytest.approx(expected, abs=bound)


def test_noise_of_a_flight_does_not_depend_on_the_other_flights(scans):
    all_tracks, one = measure(scans, "levy", (0, 1)), measure(scans[:1], "levy", (0, 1))
    count = len(scans[0].times)
    np.testing.assert_array_equal(all_tracks.measurements[0, :count], one.measurements[0])
    assert np.isnan(all_tracks.measurements[0, count:]).all()
    assert (np.diff(all_tracks.times, axis=1) >= 0.0).all()


def test_errors_are_means_over_axes_of_the_errors_of_a_flight(scans):
    tracks = measure(scans, "gaussian", (5,))
    rmse, mae = flight_errors(tracks.measurements, tracks.positions)
    for k, scan in enumerate(scans):
        error = tracks.measurements[k, : len(scan.times)] - scan.positions
        axes = [np.sqrt(np.mean(error[:, axis] ** 2)) for axis in range(3)]
        assert rmse[k] == pytest.approx(np.mean(axes))
        assert mae[k] == pytest.approx(np.abs(error).mean())


def test_a_paired_ratio_has_no_spread_if_one_filter_is_a_multiple_of_the_other():
    errors = np.random.default_rng(0).uniform(5.0, 15.0, (4, 30))
    assert paired_ratio(0.7 * errors, errors, seed=0) == pytest.approx((0.7, 0.7, 0.7))
    ratio, low, high = paired_ratio(np.roll(errors, 1, axis=1), errors, seed=0)
    assert low < ratio < high
