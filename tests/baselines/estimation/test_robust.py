"""Robust corrections against direct integration and minimization, and in the worlds that they
assume.
"""

import numpy as np
import pytest
from kinematic_worlds import mean_bounds, random_covariance, simulate, squared_errors
from scipy import integrate, optimize, stats

from baselines.estimation.correction import (
    Correntropy,
    Huber,
    StudentT,
    correct,
    gaussian_factors,
    principal_noise,
)
from baselines.estimation.kalman import KalmanFilter
from baselines.estimation.motion_models import MotionModel
from baselines.estimation.run_filter import run_filter

ALL = [Huber(), StudentT()]


def single(value):
    return np.array([value], np.float64)


@pytest.mark.parametrize("nu", [0.5, 4.0])
def test_student_t_equals_numerical_integration_of_the_posterior(nu):
    rng = np.random.default_rng(0)
    for _ in range(6):
        m, r = 10.0 ** rng.uniform(-2, 2, 2)
        y = np.sqrt(m + r) * rng.normal() * 10.0 ** rng.uniform(-0.5, 0.8)

        def density(u, y=y, m=m, r=r):
            return (
                stats.norm.pdf(u, scale=np.sqrt(m))
                * stats.t.pdf((y - u) / np.sqrt(r), nu)
                / np.sqrt(r)
            )

        # Both peaks are far narrower than the range: nodes of a trapezoid rule around each of them.
        grid = np.arange(-9.0, 9.0, 1e-3)
        wide = np.sqrt(r) * np.sinh(np.arange(-12.0, 12.0, 1e-3))
        nodes = np.unique(np.concatenate([np.sqrt(m) * grid, y + wide]))
        nodes = nodes[np.abs(nodes) < 12.0 * np.sqrt(m)]
        values = density(nodes)
        total = integrate.trapezoid(values, nodes)
        mean = integrate.trapezoid(nodes * values, nodes) / total
        variance = integrate.trapezoid((nodes - mean) ** 2 * values, nodes) / total
        factors = StudentT(nu).factors(single(y), single(m), single(r))
        np.testing.assert_allclose(
            factors.log_likelihood,
            np.log(total),
            atol=1e-5,
        )
        np.testing.assert_allclose(
            m * y * factors.state,
            mean,
            rtol=1e-5,
            atol=1e-5 * np.sqrt(m),
        )
        np.testing.assert_allclose(
            m - m * m * factors.covariance,
            variance,
            rtol=1e-4,
        )


@pytest.mark.parametrize("threshold", [0.3, 3.0])
def test_huber_is_the_maximum_of_its_posterior(threshold):
    rng = np.random.default_rng(1)
    for _ in range(40):
        m, r = 10.0 ** rng.uniform(-2, 2, 2)
        y = np.sqrt(m + r) * rng.normal() * 5.0

        def cost(u, y=y, m=m, r=r):
            size = abs(y - u) / np.sqrt(r)
            loss = 0.5 * size**2 if size <= threshold else threshold * size - 0.5 * threshold**2
            return 0.5 * u * u / m + loss

        best = optimize.minimize_scalar(
            cost,
            bounds=sorted((0.0, y)),
            method="bounded",
            options={"xatol": 1e-12},
        )
        factors = Huber(threshold).factors(single(y), single(m), single(r))
        np.testing.assert_allclose(
            m * y * factors.state,
            best.x,
            rtol=1e-5,
            atol=1e-5 * abs(y),
        )


def test_full_covariances_of_a_measurement_are_turned_to_their_axes():
    rng = np.random.default_rng(4)
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    noise = np.diag([1.0, 9.0])
    spread = random_covariance(rng, 4)
    spread = 0.5 * (spread + spread.T)
    big = np.kron(turn, np.eye(2))
    state = rng.normal(size=(5, 4))
    measured = 10.0 * rng.normal(size=(5, 2))
    for method in (None, *ALL):
        straight = correct(
            state,
            np.broadcast_to(spread, (5, 4, 4)),
            measured,
            principal_noise(noise),
            method,
        )
        turned = correct(
            state @ big.T,
            np.broadcast_to(big @ spread @ big.T, (5, 4, 4)),
            measured @ turn.T,
            principal_noise(turn @ noise @ turn.T),
            method,
        )
        expected = straight[0] @ big.T, big @ straight[1] @ big.T, straight[2]
        for found, peer in zip(turned, expected, strict=False):
            np.testing.assert_allclose(found, peer, rtol=1e-6, atol=1e-8)


def errors_in_world(method, noise_of, seed):
    """NEES of the last tick, (B,), mean NIS, and RMSE of positions of a robust CV filter."""
    rng = np.random.default_rng(seed)
    model = MotionModel("CV", 2, 1.0)
    tracks = 1500
    times = np.arange(1.0, 26.0)
    start = np.kron(np.eye(2), np.diag([4.0, 25.0]))
    states, _ = simulate(rng, model, times, start, np.eye(2), tracks)
    measurements = states[..., ::2] + noise_of(rng, (25, tracks, 2))
    kalman = KalmanFilter(model, 4.0, robust=method)
    filtered = run_filter(
        kalman,
        measurements,
        times,
        start=(np.zeros((tracks, 4)), start, 0.0),
    )
    error = states[-1] - filtered.states[-1]
    nees = squared_errors(error, filtered.covariances[-1])
    rmse = np.sqrt(((filtered.positions - states[..., ::2])[5:] ** 2).mean())
    return nees, filtered.nis.mean(), rmse


@pytest.mark.parametrize("nu", [2.0, 4.0])
def test_student_t_filter_is_consistent_in_student_t_noise(nu):
    nees, _, _ = errors_in_world(
        StudentT(nu),
        lambda rng, shape: 2.0 * rng.standard_t(nu, shape),
        5,
    )
    low, high = mean_bounds(4.0, nees.var(), nees.size)

    assert low < nees.mean() < high


@pytest.mark.parametrize("method", [None, Huber(2.0)])
def test_nis_and_nees_are_chi_square_in_gaussian_noise(method):
    nees, nis, _ = errors_in_world(
        method,
        lambda rng, shape: rng.normal(0.0, 2.0, shape),
        6,
    )
    low, high = mean_bounds(4.0, 8.0, nees.size)

    assert low < nees.mean() < high
    low, high = mean_bounds(2.0, 4.0, 25 * 1500)
    assert low < nis < high


def test_robust_filters_lose_little_in_gaussian_noise_and_win_with_outliers():
    def outliers(rng, shape):
        return rng.normal(
            0.0,
            np.where(rng.random(shape) < 0.1, 40.0, 2.0),
        )

    for method in (Huber(2.0), StudentT(30.0)):
        gaussian = [
            errors_in_world(
                correction,
                lambda rng, shape: rng.normal(0.0, 2.0, shape),
                7,
            )[2]
            for correction in (None, method)
        ]
        heavy = [
            errors_in_world(
                correction,
                outliers,
                8,
            )[2]
            for correction in (None, method)
        ]
        assert gaussian[1] < 1.01 * gaussian[0]
        assert heavy[1] < 0.75 * heavy[0]


def test_a_wide_kernel_gives_the_kalman_filter_and_a_narrow_one_ignores_outliers():
    innovation = np.array([0.5, -3.0, 80.0])
    predicted = np.array([1.0, 4.0, 2.0])
    variance = np.full(3, 2.0)
    wide = Correntropy(1e5).factors(innovation, predicted, variance)
    for mine, other in zip(
        wide,
        gaussian_factors(innovation, predicted, variance),
        strict=True,
    ):
        np.testing.assert_allclose(mine, other, rtol=1e-6)
    narrow = Correntropy(2.0).factors(innovation, predicted, variance)

    assert abs(narrow.state[2] * innovation[2] * predicted[2]) < 1e-3
    assert narrow.covariance[2] < 1e-6
