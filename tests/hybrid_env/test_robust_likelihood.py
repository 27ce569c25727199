"""The robust likelihood equals filters in matrix form, and makes an outlier harmless."""

import math

import numpy as np
import pytest
from matrix_filters import LiteralImm, MatrixKalmanFilter, turn_matrix
from scipy import stats

from hybrid_env import (
    ArgumentError,
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackVectorEnv,
    WorldOptions,
)
from hybrid_env.core.banks.kalman import student_log_likelihood, student_weight
from hybrid_env.live import OnlineWorld

FREEDOM, TAU, Q, R = 4.0, 0.1, 0.001, 0.1
H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])


def test_the_log_likelihood_is_that_of_the_bivariate_student_t_distribution():
    generator = np.random.default_rng(1)
    for _ in range(50):
        variances, z = generator.uniform(0.1, 9.0, 2), generator.normal(0, 5, 2)
        freedom = generator.uniform(1.0, 30.0)
        white = z / np.sqrt(variances)
        found = student_log_likelihood(*white, np.log(variances).mean(), freedom)
        expected = stats.multivariate_t(shape=np.diag(variances), df=freedom).logpdf(z)
        assert found == pytest.approx(expected, abs=1e-12)
        weight = (freedom + 2) / (freedom + white @ white)
        assert student_weight(*white, freedom) == pytest.approx(min(weight, 1.0))


class RobustMatrixFilter(MatrixKalmanFilter):
    """Kalman filter whose corrections are weighted, with the log-likelihood of Student's t."""

    def step(self, z):
        """One tick; a measurement None only predicts."""
        if z is None:
            super().step(z)
            return
        predicted, before = self.Phi @ self.x + self.B, self.log_likelihood
        super().step(z)
        distance = self.innovation @ np.linalg.solve(self.Sigma, self.innovation)
        weight = min((FREEDOM + 2) / (FREEDOM + distance), 1.0)
        self.x = predicted + weight * (self.x - predicted)
        density = stats.multivariate_t(shape=self.Sigma, df=FREEDOM)
        self.log_likelihood = before + density.logpdf(self.innovation)


@pytest.mark.parametrize(
    "options", [{}, {"missed": 0.3}, {"noise": "levy 1.2", "measurement_variance": (0.05, 0.2)}]
)
@pytest.mark.parametrize("follow", ["declared", "bank"])
def test_the_published_bank_equals_weighted_matrix_filters(options, follow):
    env = HybridTrackEnv(
        scheme="L40r5 S9", likelihood=f"student_t {FREEDOM}", follow=follow, reset_covariance=True, **options
    )
    _, info = env.reset(seed=2)
    noise = np.diag(np.broadcast_to(env.options.variances, 2))
    filters = [RobustMatrixFilter(info["anchor"], np.eye(4), m, 5.0, TAU, Q, noise) for m in "SLR"]
    for k in range(40):
        z = info["measurement"]
        for one in filters:
            one.step(None if np.isnan(z[0]) else z)
        found = env.world.bank.hypotheses[0]
        for h, one in enumerate(filters):
            np.testing.assert_allclose([found[h][n][0] for n in ("x", "vx", "y", "vy")], one.x, atol=1e-9)
        np.testing.assert_allclose(info["log_likelihood"], [one.log_likelihood for one in filters], atol=1e-9)
        if k < 39:
            *_, info = env.step(0)
    # the declared filter follows the object as before
    anchor = env.step(2)[4]["anchor"] if follow == "declared" else None
    if anchor is not None:
        np.testing.assert_allclose(anchor, filters[1].x, atol=1e-9)


def test_a_declared_filter_follows_with_weights_to_the_end_of_its_segment():
    options = {"scheme": "L40r5 S9", "likelihood": f"student_t {FREEDOM}", "noise": "outliers 0.2"}
    waits, declares = (HybridTrackEnv(**options) for _ in range(2))
    waits.reset(seed=2)
    declares.reset(seed=2)
    for _ in range(39):
        waits.step(0)
    anchors = [waits.step(2)[4]["anchor"], declares.step(2)[4]["anchor"]]
    np.testing.assert_allclose(anchors[0], anchors[1], atol=1e-12)


class RobustImm(LiteralImm):
    """IMM whose filters weight their corrections, with the likelihood of Student's t."""

    def correct(self, prior, x, P, z):
        Sigma = H @ P @ H.T + self.R
        innovation, K = z - H @ x, P @ H.T @ np.linalg.inv(Sigma)
        weight = min((FREEDOM + 2) / (FREEDOM + innovation @ np.linalg.solve(Sigma, innovation)), 1.0)
        density = stats.multivariate_t(shape=Sigma, df=FREEDOM).logpdf(innovation)
        return x + weight * K @ innovation, P - K @ H @ P, prior * math.exp(density)

    def step(self, z):
        """One tick."""
        prior = self.transition.T @ self.probability
        weights = self.transition * self.probability[:, None] / prior
        states, covariances, probability = [], [], []
        for j, curvature in enumerate(self.curvatures):
            mean = sum(w * x for w, x in zip(weights[:, j], self.states, strict=True))
            spread = sum(
                w * (P + np.outer(x - mean, x - mean))
                for w, x, P in zip(weights[:, j], self.states, self.covariances, strict=True)
            )
            F = turn_matrix(mean, curvature, self.tau)
            corrected = self.correct(prior[j], F @ mean, F @ spread @ F.T + self.GQG, z)
            for values, value in zip((states, covariances, probability), corrected, strict=True):
                values.append(value)
        self.states, self.covariances = states, covariances
        self.probability = np.array(probability) / sum(probability)
        self.estimate = sum(p * x for p, x in zip(self.probability, self.states, strict=True))


def test_the_imm_bank_equals_weighted_matrix_filters():
    env = HybridTrackQuickestEnv(
        start="random", heading=0.3, initial_error=0, likelihood=f"student_t {FREEDOM}", noise="levy 1.5 1 44"
    )
    _, info = env.reset(seed=5)
    start = [0.0, 2.0 * math.cos(0.3), 0.0, 2.0 * math.sin(0.3)]
    matrix = env.options.transition_matrix
    literal = RobustImm(start, np.zeros((4, 4)), [0.0, 0.2, -0.2], matrix, TAU, Q, [R, R])
    for _ in range(60):
        literal.step(info["measurement"])
        np.testing.assert_allclose(info["estimate"], literal.estimate, atol=1e-8)
        np.testing.assert_allclose(np.exp(info["log_probability"]), literal.probability, atol=1e-8)
        *_, info = env.step(0)


def test_an_outlier_moves_the_robust_estimate_less():
    errors = []
    for likelihood in ("gaussian", "student_t 4"):
        env = HybridTrackVectorEnv(2000, scheme="S40", noise="levy 1.5 1 44", likelihood=likelihood)
        env.reset(seed=1)
        for _ in range(39):
            info = env.step(np.zeros(2000, np.int64))[4]
        errors.append(np.median(((info["estimate"] - info["truth"])[:, [0, 2]] ** 2).sum(1)))
    assert errors[1] < 0.85 * errors[0]


def test_the_same_measurements_give_the_same_rows_on_a_live_sensor():
    options = {"scheme": "L40r5", "likelihood": "student_t 4", "noise": "levy 1.5", "missed": 0.2}
    env = HybridTrackEnv(**options)
    row, info = env.reset(seed=3)
    online = OnlineWorld(WorldOptions(**options))
    P = np.diag(np.array([0.03, 0.02] * 2))
    online.begin_track(info["anchor"], P, 0)
    online.begin_segment(40)
    for _ in range(40):
        if np.isnan(info["measurement"][0]):
            online.skip()
        else:
            online.measure(*info["measurement"])
        np.testing.assert_array_equal(online.take_rows()[0], row)
        row, *_, info = env.step(0)
        if info["tick"] == 1:
            break


@pytest.mark.parametrize("value", ["levy 1.5", "outliers 0.1", "student", 4, None, "student_t 0"])
def test_other_likelihoods_are_refused(value):
    with pytest.raises(ArgumentError, match=r"^likelihood"):
        WorldOptions(likelihood=value)
    with pytest.raises(ArgumentError, match=r"^likelihood.*anchor_aware"):
        WorldOptions(likelihood="student_t 4", bank="anchor_aware")
