"""Speed and radius of turns whose radius is not known."""

from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from kinematic_worlds import draw, mean_bounds
from recorded_tracks import OBJECTS
from scipy.linalg import expm

from baselines.estimation.turn_tracks import TurnTracks
from baselines.estimation.turns import TurnFilter, begin_turn, turn_matrix, turned_estimate
from hybrid_env import WorldOptions

QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])
STATE = np.array([3.0, -1.0, 2.0, 0.4, 1.8, 0.5, 0.35])


def exact_matrix(rate, seconds):
    """The solution of p' = v, v' = rate J u, u' = rate J v."""
    generator = np.zeros((6, 6))
    generator[:2, 2:4] = np.eye(2)
    generator[2:4, 4:] = generator[4:, 2:4] = rate * QUARTER
    return expm(generator * seconds)


def turned_states(states, seconds):
    """States (n, 7) after a time."""
    moved = [turn_matrix(state[6], seconds) @ state[:6] for state in states]
    return np.column_stack([moved, states[:, 6]])


def random_covariance(deviations):
    root = np.diag(deviations) @ np.random.default_rng(2).normal(size=(7, 7))
    return root @ root.T / 7


@pytest.mark.parametrize("rate", [0.0, 1e-9, 1e-5, -0.3, 0.7, 5.0])
def test_the_motion_solves_its_differential_equation(rate):
    np.testing.assert_allclose(turn_matrix(rate, 1.5), exact_matrix(rate, 1.5), atol=1e-12)


def test_a_known_turn_rate_gives_the_kalman_filter():
    rng = np.random.default_rng(3)
    mine = TurnFilter(0.1, 0.01)
    covariance = random_covariance(np.full(7, 0.5))
    covariance[6] = covariance[:, 6] = 0.0
    mine.begin(0, STATE, covariance)
    theirs = KalmanFilter(6, 2)
    theirs.x, theirs.P = STATE[:6].copy(), covariance[:6, :6].copy()
    theirs.F, theirs.H = exact_matrix(STATE[6], 0.1), np.eye(2, 6)
    theirs.Q = np.diag([0, 0, 0.01, 0.01, 0, 0])
    theirs.R = np.array([[0.2, 0.05], [0.05, 0.1]])
    for k in range(30):
        point = None if k in (4, 5) else STATE[:2] + rng.normal(size=2)
        mine.step((np.nan, np.nan) if point is None else point, (0.2, 0.05, 0.1))
        theirs.predict()
        theirs.update(point)
        np.testing.assert_allclose(mine.states[0, :6], theirs.x, rtol=1e-9)
        np.testing.assert_allclose(mine.covariances[0, :6, :6], theirs.P, rtol=1e-7, atol=1e-12)


def test_the_predicted_moments_are_those_of_moved_states():
    covariance = random_covariance([0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.15])
    samples = 40_000
    moved = turned_states(draw(np.random.default_rng(4), STATE, covariance, samples), 2.0)
    mean, predicted = turned_estimate(STATE, covariance, 2.0)

    deviations = np.sqrt(np.diag(predicted))
    assert (np.abs(moved.mean(0) - mean) < 5 * deviations / np.sqrt(samples)).all()
    products = np.outer(deviations, deviations)
    spread = np.sqrt((products**2 + predicted**2) / samples)
    # The quadrature of a turn that is known to a third of a radian is right to two hundredths.
    assert (np.abs(np.cov(moved.T) - predicted) < 5 * spread + 0.02 * products).all()
    first_order = turned_states(STATE[None], 2.0)[0]
    assert (np.abs(moved.mean(0) - first_order) > 6 * deviations / np.sqrt(samples)).any()


def normalised_errors(name, ratio, spread, tracks=400, ticks=60, seed=6):
    """Errors of speed and radius over their deviations, and the relative deviation of the radius,
    (ticks, 3, tracks), of tracks whose true radius is `ratio` times the one that is assumed.
    """
    world = OBJECTS[name]
    R = world.measurement_variance
    rng = np.random.default_rng(seed)
    run = world.simulate(tracks, seed, "S" + "L", (20, ticks))
    covariance = np.diag([R, R / (10 * world.tau) ** 2] * 2)
    begins = run.truth[:, 19] + draw(rng, 0.0, covariance, tracks)
    filters = TurnFilter(world.tau, world.process_variance, tracks)
    assumed = 1 / (world.radius / ratio)
    for k, begin in enumerate(begins):
        filters.begin(k, *begin_turn(begin, covariance, assumed, spread * assumed))
    rates = np.hypot(*run.truth[:, 19, 1::2].T) / world.radius
    rows = []
    for k in range(20, 20 + ticks):
        filters.step(run.measurements[:, k], (R, 0.0, R))
        speed, speed_deviation, radius, radius_deviation = filters.turns.T
        truth = np.hypot(*run.truth[:, k, 1::2].T)
        errors = (speed - truth) / speed_deviation, (radius - truth / rates) / radius_deviation
        rows.append([*errors, radius_deviation / radius])
    return np.array(rows)


@pytest.mark.parametrize(
    ("name", "ratio"), [("car", 0.7), ("car", 1.0), *((name, 1.4) for name in OBJECTS)]
)
def test_errors_have_the_stated_deviations_once_the_radius_is_known_to_a_tenth(name, ratio):
    speed, radius, relative = np.moveaxis(normalised_errors(name, ratio, 0.5), 1, 0)
    low, high = mean_bounds(1.0, 2.0, speed.shape[1])
    known = np.flatnonzero(np.median(relative, axis=1) < 0.1)
    assert known.size
    for tick in known:
        assert np.mean(speed[tick] ** 2) < high
        assert np.mean(radius[tick] ** 2) < high
    # In the first ticks the deviations may be larger than the errors.
    for tick in known[known >= 8]:
        assert low < np.mean(speed[tick] ** 2)
        assert low < np.mean(radius[tick] ** 2)


def test_after_decisions_a_radius_other_than_that_of_the_bank_is_found():
    """Three segments, with right decisions after ten ticks."""
    world = OBJECTS["car"]
    run = replace(world, radius=250.0).simulate(1, 0, "SLS", (40, 40, 40))
    track = TurnTracks(world.options(WorldOptions, bank="anchor_aware"))
    track.begin(np.array(world.start), np.diag([4.0, 0.1, 4.0, 0.1]))
    turns = []
    for tick, point in enumerate(run.measurements[0]):
        if tick % 40 == 0:
            track.begin_segment(40)
        track.measure(point)
        if tick % 40 == 9:
            assert np.isnan(track.turn()[2:]).all()
            track.decide(1 + (tick // 40 == 1))
        if tick % 40 == 39:
            turns.append(track.turn())
    assert [turn.radius for turn in turns[::2]] == [np.inf, np.inf]
    assert np.isnan([turn.radius_deviation for turn in turns[::2]]).all()
    assert turns[1].radius == pytest.approx(250, rel=0.1)
    assert turns[1].radius_deviation < 5
