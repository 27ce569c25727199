import itertools

import numpy as np
import pytest
from scipy.linalg import expm

from studies.flights.flight import TIERS, stack_flights
from studies.flights.simulated import simulate_flights
from studies.flights.turn_beam import TurnHistories, run_turn_beam
from studies.flights.turns import START_SPEED, Batch, TurnModel


def one_piece(positions, times, across, timing=0.0):
    return Batch(
        ((0, 0, len(times)),),
        times[:, None],
        positions[:, None],
        np.array([across]),
        np.array([timing]),
    )


def literal_step(state, covariance, omega, density, dt, z, noise, freedom):
    """Return a coordinated turn [x, y, vx, vy] after dt and a measurement with a Student t
    distribution.
    """
    rates = np.zeros((4, 4))
    rates[0, 2] = rates[1, 3] = 1.0
    rates[2, 3], rates[3, 2] = -omega, omega
    matrix = expm(rates * dt)
    one_axis = density * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
    state = matrix @ state
    covariance = matrix @ covariance @ matrix.T + np.kron(one_axis, np.eye(2))
    innovation = z - state[:2]
    spread = covariance[:2, :2] + noise
    nis = innovation @ np.linalg.inv(spread) @ innovation
    log_likelihood = -0.5 * np.log(np.linalg.det(spread)) - 0.5 * (freedom + 2.0) * np.log1p(
        nis / freedom
    )
    weight = min((freedom + 2.0) / (freedom + nis), 1.0)
    gain = covariance[:, :2] @ np.linalg.inv(covariance[:2, :2] + noise / weight)
    return state + gain @ innovation, covariance - gain @ covariance[:2], log_likelihood


def test_all_histories_of_a_few_positions():
    # Every sequence of modes has a filter of its own; merging histories is the only difference.
    generator = np.random.default_rng(3)
    times = np.array([0.0, 1.0, 2.1, 3.0, 4.2])
    positions = np.column_stack([80.0 * times, 0.5 * times**2]) + generator.normal(0.0, 2.0, (5, 2))
    batch = one_piece(positions, times, 2.0)
    model = TurnModel(
        rates=(0.0, 2.0, -2.0),
        straight=10.0,
        turn=6.0,
    )
    found = run_turn_beam(
        batch,
        model,
        TurnHistories(shortest=(0.0, 1e-9), branches=60),
    )[-1, 0]
    omega = np.radians(model.rates)
    leave = 1.0 / np.array([10.0, 6.0, 6.0])
    share = np.array([[0.0, 0.5, 0.5], [0.9, 0.0, 0.1], [0.9, 0.1, 0.0]])
    weights = np.zeros(3)
    for sequence in itertools.product(range(3), repeat=5):
        state = np.concatenate([positions[0], (positions[1] - positions[0]) / times[1]])
        covariance = np.diag([4.0, 4.0, START_SPEED**2, START_SPEED**2])
        log_weight = np.log([0.9, 0.05, 0.05][sequence[0]])
        for row, (last, mode) in enumerate(itertools.pairwise(sequence), 1):
            step = times[row] - times[row - 1]
            ends = -np.expm1(-leave[last] * step)
            log_weight += np.log(1.0 - ends if mode == last else ends * share[last, mode])
            state, covariance, likelihood = literal_step(
                state,
                covariance,
                omega[mode],
                model.acceleration,
                step,
                positions[row],
                4.0 * np.eye(2),
                5.0,
            )
            log_weight += likelihood
        weights[sequence[-1]] += np.exp(log_weight)

    np.testing.assert_allclose(
        found,
        weights / weights.sum(),
        atol=0.01,
    )


@pytest.fixture(scope="module")
def batch():
    return stack_flights(simulate_flights(TIERS["B"], 2, 500.0, np.random.default_rng(5))[0])


def test_turned_flights_have_the_same_posterior(batch):
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    turned = batch._replace(positions=batch.positions @ turn.T)

    np.testing.assert_allclose(
        run_turn_beam(turned),
        run_turn_beam(batch),
        atol=1e-6,
    )
