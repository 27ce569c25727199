"""Reference filters for the tests, in matrix form as in the papers."""

import math

import numpy as np
from scipy import stats

from hybrid_env.core.memory import PublishedBank
from hybrid_env.live import SQUARE

# Of the robust likelihood in the tests.
FREEDOM = 4.0


def weigh(innovation, Sigma, freedom):
    """Return weight and log-likelihood of an innovation: normal, or Student's t with degrees of
    freedom.
    """
    squared = innovation @ np.linalg.solve(Sigma, innovation)
    if freedom:
        density = stats.multivariate_t(shape=Sigma, df=freedom)
        return min((freedom + 2) / (freedom + squared), 1.0), density.logpdf(innovation)
    return 1.0, -0.5 * (squared + math.log(np.linalg.det(2 * math.pi * Sigma)))


def correct_by_rate(state, P, rate, place, deviation):
    """Correct a filter by a range rate, linearised at its state; return it with the
    log-likelihood.
    """

    def range_rate(s):
        from_radar = s[[0, 2]] - place
        return from_radar @ s[[1, 3]] / np.sqrt(from_radar @ from_radar)

    H = jacobian(range_rate, state)
    x, y = (state[[0, 2]] - place) / np.hypot(*(state[[0, 2]] - place))
    angle = np.array([-y, x]) @ P[:3:2, :3:2] @ [-y, x] / np.sum((state[[0, 2]] - place) ** 2)
    second_order = 0.5 * angle**2 * np.sum(state[[1, 3]] ** 2) + angle * (P[1, 1] + P[3, 3])
    sigma = H @ P @ H + deviation**2 + second_order
    innovation = rate - range_rate(state)
    K = P @ H / sigma
    likelihood = stats.norm.logpdf(innovation, scale=math.sqrt(sigma))
    return state + K * innovation, P - np.outer(K, H @ P), likelihood


class MatrixKalmanFilter:
    """Kalman filter with four states. Golubkov 2018, eq. (1) and (2), with Sigma = H P H' + R."""

    # (range rate, place of the radar, deviation) of radars in the next tick.
    rates = ()

    def __init__(self, state, P, mode, radius, tau, Q, R, freedom=0):
        xs, vx, ys, vy = state
        self.freedom = freedom
        self.x, self.P, self.R = np.array(state), P.copy(), R
        self.log_likelihood = 0.0
        if mode == "S":
            block = np.array([[1.0, tau], [0.0, 1.0]])
            self.B = np.zeros(4)
        else:
            w = math.hypot(vx, vy) / radius
            c = math.cos(w * tau)
            s = math.sin(w * tau)
            block = np.array([[c, s / w], [-w * s, c]])
            sign = 1.0 if mode == "L" else -1.0
            self.B = np.array(
                [
                    (xs - sign * vy / w) * (1 - c),
                    (w * xs - sign * vy) * s,
                    (ys + sign * vx / w) * (1 - c),
                    (w * ys + sign * vx) * s,
                ]
            )
        self.Phi = np.kron(np.eye(2), block)
        G = np.array([[0, 0], [1, 0], [0, 0], [0, 1.0]])
        self.GQG = G @ (Q * np.eye(2)) @ G.T
        self.H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])

    def step(self, z):
        """One tick; a measurement None only predicts."""
        x = self.Phi @ self.x + self.B
        P = self.Phi @ self.P @ self.Phi.T + self.GQG
        self.Sigma = self.H @ P @ self.H.T + self.R
        if z is None:
            self.x, self.P, self.innovation = x, P, np.full(2, np.nan)
            return
        self.innovation = z - self.H @ x
        K = P @ self.H.T @ np.linalg.inv(self.Sigma)
        weight, log_likelihood = weigh(self.innovation, self.Sigma, self.freedom)
        self.x = x + weight * K @ self.innovation
        self.P = P - K @ self.H @ P
        self.log_likelihood += log_likelihood
        for one in self.rates:
            self.x, self.P, log_likelihood = correct_by_rate(self.x, self.P, *one)
            self.log_likelihood += log_likelihood


def move(state, tau):
    """Move [x, vx, y, vy, centre_x, centre_y, turn_rate] by one tick. Golubkov 2018, eq. (1), no
    noise.
    """
    x, vx, y, vy, cx, cy, w = state
    c = np.cos(w * tau)
    s = np.sin(w * tau)
    ratio = s / w if w else tau
    return np.array(
        [
            cx + c * (x - cx) + ratio * vx,
            c * vx - w * s * (x - cx),
            cy + c * (y - cy) + ratio * vy,
            c * vy - w * s * (y - cy),
            cx,
            cy,
            w,
        ]
    )


def turn_state(anchor, signed_radius):
    """Return [x, vx, y, vy, centre_x, centre_y, turn_rate] of a turn that begins at [x, vx, y,
    vy].
    """
    x, vx, y, vy = anchor
    v = np.sqrt(vx * vx + vy * vy)
    return np.array(
        [
            x,
            vx,
            y,
            vy,
            x - signed_radius * vy / v,
            y + signed_radius * vx / v,
            v / abs(signed_radius),
        ]
    )


def jacobian(function, state):
    """Return the Jacobian by complex steps: f(x + i h) = f(x) + i h f'(x), without a difference
    that loses digits.
    """
    h = 1e-30
    return np.array([function(state + 1j * h * one).imag / h for one in np.eye(len(state))]).T


class MatrixExtendedKalmanFilter:
    """Extended Kalman filter with seven states. Jacobians are computed by complex steps."""

    # See `MatrixKalmanFilter`.
    rates = ()

    def __init__(self, anchor, P, signed_radius, tau, Q, R):
        self.tau, self.R = tau, R
        self.Q = np.diag([0, Q, 0, Q, 0, 0, 0])
        self.log_likelihood = 0.0
        if signed_radius == 0.0:
            self.s = np.array([*anchor, 0.0, 0.0, 0.0])
            J = np.eye(7)[:, :4]
        else:
            self.s = turn_state(anchor, signed_radius)
            J = jacobian(lambda state: turn_state(state, signed_radius), np.array(anchor))
        self.P = J @ P @ J.T

    def step(self, z):
        """One tick; a measurement None only predicts."""
        F = jacobian(lambda state: move(state, self.tau), self.s)
        # The turn rate of the straight line is exactly zero.
        if self.s[6] == 0.0:
            F[:4, 6] = 0.0
        s = move(self.s, self.tau)
        P = F @ self.P @ F.T + self.Q
        H = np.zeros((2, 7))
        H[0, 0] = H[1, 2] = 1.0
        self.Sigma = H @ P @ H.T + (np.diag(self.R) if np.ndim(self.R) == 1 else self.R)
        if z is None:
            self.s, self.P, self.innovation = s, P, np.full(2, np.nan)
            return
        self.innovation = z - H @ s
        K = P @ H.T @ np.linalg.inv(self.Sigma)
        self.s, self.P = s + K @ self.innovation, P - K @ H @ P
        quadratic = self.innovation @ np.linalg.solve(self.Sigma, self.innovation)
        self.distance = quadratic
        self.log_likelihood -= 0.5 * (quadratic + math.log(np.linalg.det(2 * math.pi * self.Sigma)))
        for one in self.rates:
            self.s, self.P, log_likelihood = correct_by_rate(self.s, self.P, *one)
            self.log_likelihood += log_likelihood


class LiteralImm:
    """IMM as in Blom & Bar-Shalom 1988: mixing, filtering, probabilities, output, with
    probabilities.
    """

    # See `MatrixKalmanFilter`.
    rates = ()

    def __init__(self, estimate, P, curvatures, transition, tau, Q, R, freedom=0):
        self.freedom = freedom
        self.curvatures, self.transition, self.tau = curvatures, transition, tau
        self.GQG, self.R = np.diag([0.0, Q, 0.0, Q]), np.diag(R)
        self.states = [np.array(estimate) for _ in curvatures]
        self.covariances = [np.array(P) for _ in curvatures]
        self.probability = np.full(len(curvatures), 1.0 / len(curvatures))

    def step(self, z):
        """One tick; a measurement None only predicts."""
        prior = self.transition.T @ self.probability
        weights = self.transition * self.probability[:, None] / prior
        mixed = [
            sum(w * x for w, x in zip(weights[:, j], self.states, strict=True))
            for j in range(len(prior))
        ]
        spread = [
            sum(
                w * (P + np.outer(x - mixed[j], x - mixed[j]))
                for w, x, P in zip(weights[:, j], self.states, self.covariances, strict=True)
            )
            for j in range(len(prior))
        ]
        H = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]])
        self.log_likelihood = np.empty(len(prior))
        for j, curvature in enumerate(self.curvatures):
            F = turn_matrix(mixed[j], curvature, self.tau)
            x = F @ mixed[j]
            P = F @ spread[j] @ F.T + self.GQG
            if z is None:
                self.states[j], self.covariances[j], self.log_likelihood[j] = x, P, 0.0
                continue
            Sigma = H @ P @ H.T + self.R
            innovation = z - H @ x
            K = P @ H.T @ np.linalg.inv(Sigma)
            weight, self.log_likelihood[j] = weigh(innovation, Sigma, self.freedom)
            self.states[j], self.covariances[j] = x + weight * K @ innovation, P - K @ H @ P
            for one in self.rates:
                self.states[j], self.covariances[j], more = correct_by_rate(
                    self.states[j],
                    self.covariances[j],
                    *one,
                )
                self.log_likelihood[j] += more
        self.probability = prior * np.exp(self.log_likelihood)
        self.probability /= self.probability.sum()
        self.estimate = sum(p * x for p, x in zip(self.probability, self.states, strict=True))
        self.covariance = sum(
            p * (P + np.outer(x - self.estimate, x - self.estimate))
            for p, x, P in zip(self.probability, self.states, self.covariances, strict=True)
        )


def turn_matrix(state, curvature, tau):
    """Return the transition matrix of [x, vx, y, vy] in a coordinated turn."""
    a = curvature * math.hypot(state[1], state[3]) * tau
    C = math.cos(a)
    S = math.sin(a)
    along, across = (tau * S / a, tau * (1 - C) / a) if a else (tau, 0.0)
    return np.array([[1, along, 0, -across], [0, C, 0, -S], [0, across, 1, along], [0, S, 0, C]])


def transition_matrix(M, hazard):
    matrix = np.full((M, M), hazard / (M - 1))
    np.fill_diagonal(matrix, 1 - hazard)
    np.testing.assert_allclose(matrix.sum(1), 1)
    return matrix


def step_filters(filters, env, i, measurement):
    """Advance the filters of track i; a measurement of NaN only predicts."""
    noise, rates = (env.world.field(name)[i] for name in ("noise", "rates"))
    variance = np.sqrt(np.broadcast_to(env.options.variances, 2))
    missing = np.isnan(measurement)
    assert missing[0] == missing[1]
    radars = [one for one in env.options.sensors if getattr(one, "rate_deviation", None)]
    for one in filters:
        ratio = np.eye(2) if missing[0] else noise[[[0, 1], [1, 2]]]
        one.R = ratio * np.outer(variance, variance)
        one.rates = [
            (rate, radar.position, radar.rate_deviation)
            for rate, radar in zip(rates, radars, strict=False)
            if not np.isnan(rate)
        ]
        one.step(None if missing[0] else measurement)


def filters_at_switch(env, i):
    """Return the filters of track i, before the first tick of its segment."""
    options, anchor = env.options, env.world.field("anchor")[i]
    P = env.world.field("covariance")[i][SQUARE]
    model = options.tau, options.process_variance, None
    if options.bank == "anchor_aware":
        signed = (0.0, *options.radii, *(-radius for radius in options.radii))
        return [MatrixExtendedKalmanFilter(anchor, P, radius, *model) for radius in signed]
    if options.parameters()["reset_covariance"][0]:
        P = np.eye(4)
    # Which filters each axis by itself.
    if options.bank_class is PublishedBank:
        P = P * np.kron(np.eye(2), np.ones((2, 2)))
    modes = [("S", 0.0), *(("L", r) for r in options.radii), *(("R", r) for r in options.radii)]
    freedom = FREEDOM * (str(options.likelihood) != "gaussian")
    return [MatrixKalmanFilter(anchor, P, mode, radius, *model, freedom) for mode, radius in modes]
