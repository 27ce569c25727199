"""Bezier paths, flights of the point mass, and flights of the quadrotor in PyBullet."""

import sys

import numpy as np
import pytest
from scipy.interpolate import BPoly

from baselines.papers.novospaskyi import flights as model
from baselines.papers.novospaskyi import quadrotor
from baselines.papers.novospaskyi.flights import (
    SHORTEST,
    SPACE,
    SPACING,
    Route,
    bezier,
    flight_route,
    fly_point_masses,
    point_mass_flights,
    random_route,
)
from hybrid_env.checks import ArgumentError


@pytest.fixture(scope="module")
def flights():
    return point_mass_flights(12, 0, 16)


def hairpin():
    """A path that turns back within a few metres at full speed."""
    out = np.array([[100.0 * k, 0.0, 200.0] for k in range(6)])
    back = np.array([[500.0 - 100.0 * k, 5.0 + 300.0 * k, 200.0] for k in range(1, 3)])
    return Route(out[:4], np.concatenate([out, back]))


def test_a_curve_is_the_polynomial_in_bernstein_form():
    control_points = np.random.default_rng(0).uniform(0.0, 100.0, (5, 3))
    at = np.linspace(0.0, 1.0, 11)
    expected = BPoly(control_points[:, None, :], [0.0, 1.0])(at)
    np.testing.assert_allclose(bezier(control_points, at), expected, atol=1e-10)


def test_waypoints_are_evenly_spaced_on_a_long_curve_in_the_air_space():
    path = random_route(np.random.default_rng(1))
    low, high = np.array(SPACE).T
    assert (path.waypoints >= low).all()
    assert (path.waypoints <= high).all()
    steps = np.linalg.norm(np.diff(path.waypoints, axis=0), axis=1)
    # chords of equal arcs, a little shorter where the curve bends
    assert steps.max() < 1.1 * SPACING
    assert steps.sum() > 0.95 * SHORTEST
    np.testing.assert_array_equal(path.waypoints[0], path.control_points[0])
    np.testing.assert_allclose(path.waypoints[-1], path.control_points[-1], atol=1e-9)


def test_flights_have_the_speed_of_the_thesis_and_respect_the_limits(flights):
    speeds = [np.linalg.norm(flight.velocities, axis=1).mean() for flight in flights]
    assert np.mean(speeds) == pytest.approx(50.0, abs=1.0)
    for flight in flights:
        change = np.diff(flight.velocities, axis=0) / model.RECORD_STEP
        thrust = change + np.array([0.0, 0.0, model.GRAVITY]) - model.drag(flight.velocities[:-1])
        assert np.linalg.norm(thrust, axis=1).max() < 1.01 * model.LARGEST_FORCE
        assert flight.positions[:, 2].min() > 0.0


def test_positions_and_velocities_of_a_flight_fit_together(flights):
    flight = flights[0]
    middle = (flight.velocities[1:] + flight.velocities[:-1]) / 2.0
    steps = np.diff(flight.positions, axis=0) / model.RECORD_STEP
    np.testing.assert_allclose(steps, middle, atol=0.05)  # drag within a step
    positions, velocities = flight.states_at(flight.times[3:5])
    np.testing.assert_allclose(positions, flight.positions[3:5])
    np.testing.assert_allclose(velocities, flight.velocities[3:5])


def test_flights_do_not_depend_on_how_many_are_flown_at_once(flights):
    again = point_mass_flights(3, 0, 2)
    for one, other in zip(flights, again, strict=False):
        np.testing.assert_array_equal(one.positions, other.positions)


def test_a_path_that_cannot_be_flown_is_discarded():
    straight = Route(np.zeros((4, 3)), np.array([[100.0 * k, 0.0, 200.0] for k in range(6)]))
    flown = fly_point_masses([straight, hairpin()])
    assert flown[0] is not None
    assert flown[1] is None


def test_physics_without_pybullet_is_one_line_that_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(ArgumentError, match=r"hybrid-track\[physics\]") as caught:
        quadrotor.fly_quadrotor(flight_route(0, 0))
    assert "\n" not in str(caught.value)


def test_a_quadrotor_hovers_and_turns_as_the_equations_of_a_rigid_body_say():
    pytest.importorskip("pybullet")
    body = quadrotor.Quadrotor(quadrotor.Engine(), np.array([0.0, 0.0, 100.0]), np.zeros(3))
    for _ in range(quadrotor.RATE):
        body.step()
    np.testing.assert_allclose(body.position, [0.0, 0.0, 100.0], atol=1e-3)
    # more force on the side of positive y: angular acceleration = torque / moment of inertia
    body.forces = body.forces + 0.01 * np.sign(quadrotor.ROTORS[:, 1])
    torque = (quadrotor.ROTORS[:, 1] * body.forces).sum()
    for _ in range(12):
        body.step()
    expected = torque / quadrotor.INERTIA[0] * 12 / quadrotor.RATE
    np.testing.assert_allclose(body.rates, [expected, 0.0, 0.0], atol=0.02 * expected)
    # the rotors on one diagonal turn one way, and those on the other one the other way
    body.forces = body.forces + 0.1 * quadrotor.SPIN
    before = body.rates[2]
    body.step()
    expected = 4 * 0.1 * quadrotor.TORQUE_SHARE / quadrotor.INERTIA[2] / quadrotor.RATE
    assert body.rates[2] - before == pytest.approx(expected, rel=0.05)


def test_the_attitude_controller_turns_a_tilted_quadrotor_upright():
    pytest.importorskip("pybullet")
    body = quadrotor.Quadrotor(quadrotor.Engine(), np.array([0.0, 0.0, 100.0]), np.array([30.0, 20.0, 0.0]))
    assert body.rotation[2, 2] < 0.99  # leans against the drag
    up = np.array([0.0, 0.0, model.GRAVITY])
    desired = quadrotor.desired_attitude(up)
    for _ in range(quadrotor.RATE):
        body.forces = quadrotor.rotor_commands(body.rotation, body.rates, desired, up)
        body.step()
    np.testing.assert_allclose(body.rotation, np.eye(3), atol=1e-3)


def test_quadrotor_and_point_mass_fly_alike_and_flights_are_stored(tmp_path, monkeypatch):
    pytest.importorskip("pybullet")
    attempt = 2
    flight = quadrotor.stored_flight(tmp_path, 0, attempt)
    assert flight is not None
    (mass,) = fly_point_masses([flight_route(0, attempt)])
    assert mass is not None
    shortest = min(len(flight.positions), len(mass.positions))
    apart = np.linalg.norm(flight.positions[:shortest] - mass.positions[:shortest], axis=1)
    assert apart.max() < 30.0  # half a second of flight: both pass the same waypoints at nearly the same time
    (file,) = tmp_path.iterdir()
    written = file.stat().st_mtime_ns
    again = quadrotor.stored_flight(tmp_path, 0, attempt)
    np.testing.assert_array_equal(again.positions, flight.positions)
    assert file.stat().st_mtime_ns == written
    flown = []
    monkeypatch.setattr(quadrotor, "fly_quadrotor", lambda path: flown.append(path))  # and fails
    file.rename(tmp_path / f"quadrotor-1-{attempt}.npz")  # a file of another path
    assert quadrotor.stored_flight(tmp_path, 1, attempt) is None
    assert quadrotor.stored_flight(tmp_path, 1, attempt) is None
    assert len(flown) == 1  # also a failure is stored
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:200])
    assert quadrotor.stored_flight(tmp_path, 1, attempt) is None
    assert len(flown) == 2


def test_a_quadrotor_that_misses_its_waypoints_has_no_flight():
    pytest.importorskip("pybullet")
    assert quadrotor.fly_quadrotor(hairpin()) is None
