"""Reference filters for the tests, in matrix form as in the papers, and whether a filter is
consistent.
"""

import math

import numpy as np
from scipy import stats

# Degrees of freedom of the robust likelihood in the tests.
FREEDOM = 4.0


def correct(x, P, z, R, rates=(), freedom=0, stands=False):
    """Correct a filter by a position, if there is one, and then by velocities, given as (velocity,
    None, deviation), and range rates of radars, (range rate, place of the radar, deviation), or
    ranges and bearings with their name at the end, linearised at the state. The likelihood of the
    position is normal, or Student's t with degrees of freedom. Of an object that stands velocities
    and range rates are expected to be 0. Return state, covariance and log-likelihood.
    """
    likelihood = 0.0
    if z is not None:
        H = np.zeros((2, len(x)))
        H[0, 0] = H[1, 2] = 1.0
        x, P, likelihood = correct_by(x, P, z - H @ x, H, R, freedom)
    for rate, place, deviation, *kind in rates:
        added = 0.0
        if kind:
            H = jacobian(lambda state, seen=(place, kind[0], x): polar(state, *seen), x)[None]
            error = rate - polar(x, place, kind[0], x)
            error -= 2 * np.pi * np.round(error / (2 * np.pi)) * (kind[0] == "bearing")
        elif stands:
            likelihood += stats.norm.logpdf(rate, scale=deviation).sum()
            continue
        elif place is None:
            H = np.eye(len(x))[[1, 3]]
            error = rate - H @ x
        else:
            H = jacobian(lambda state, place=place: range_rate(state, place), x)[None]
            error = rate - range_rate(x, place)
            along, across = (x[[0, 2]] - place) / np.hypot(*(x[[0, 2]] - place))
            angle = np.array([-across, along]) @ P[:3:2, :3:2] @ [-across, along]
            angle /= np.sum((x[[0, 2]] - place) ** 2)
            # Of second order in the direction to the object.
            added = 0.5 * angle**2 * np.sum(x[[1, 3]] ** 2) + angle * (P[1, 1] + P[3, 3])
        spread = (deviation**2 + added) * np.eye(len(H))
        x, P, more = correct_by(x, P, np.atleast_1d(error), H, spread)
        likelihood += more
    return x, P, likelihood


def correct_by(x, P, error, H, R, freedom=0):
    """Correct a filter by an error (m,) of what is measured with covariance R, (m, m), and depends
    on the state by H, (m, n). Return state, covariance and log-likelihood.
    """
    Sigma = H @ P @ H.T + R
    squared = error @ np.linalg.solve(Sigma, error)
    weight = 1.0
    likelihood = -0.5 * (squared + math.log(np.linalg.det(2 * math.pi * Sigma)))
    if freedom:
        weight = min((freedom + 2) / (freedom + squared), 1.0)
        likelihood = stats.multivariate_t(shape=Sigma, df=freedom).logpdf(error)
    K = P @ H.T @ np.linalg.inv(Sigma)
    return x + weight * K @ error, P - K @ H @ P, likelihood


def polar(state, place, kind, now):
    """Return the range or the bearing of a state; `now` is a state nearby."""
    away = state[[0, 2]] - place
    if kind == "range":
        return np.sqrt(away @ away)
    # Complex steps have no arc tangent of two numbers.
    along = (now[[0, 2]] - place) / np.hypot(*(now[[0, 2]] - place))
    turned = (along[0] * away[1] - along[1] * away[0]) / (along @ away)
    return np.arctan2(along[1], along[0]) + np.arctan(turned)


def range_rate(state, place):
    """Return the range rate of a state."""
    away = state[[0, 2]] - place
    return away @ state[[1, 3]] / np.sqrt(away @ away)


class MatrixFilter:
    """A filter with the state x and its covariance P, whose subclass has `predicted`."""

    # Velocities, and range rates of radars in the next tick, see `correct`.
    rates = ()
    freedom = 0
    log_likelihood = 0.0
    stands = False

    def step(self, z):
        """One tick; a measurement None only predicts."""
        self.x, self.P = self.predicted()
        R = np.diag(self.R) if np.ndim(self.R) == 1 else self.R
        self.Sigma = self.P[:3:2, :3:2] + R
        self.innovation = np.full(2, np.nan) if z is None else z - self.x[[0, 2]]
        if z is not None:
            self.distance = self.innovation @ np.linalg.solve(self.Sigma, self.innovation)
        if z is not None or self.rates:
            heavy = self.freedom, self.stands
            self.x, self.P, more = correct(self.x, self.P, z, R, self.rates, *heavy)
            self.log_likelihood += more


class MatrixKalmanFilter(MatrixFilter):
    """Kalman filter with four states. Golubkov 2018, eq. (1) and (2), with Sigma = H P H' + R."""

    def __init__(self, state, P, signed_radius, tau, Q, R, freedom=0):
        xs, vx, ys, vy = state
        self.freedom = freedom
        self.x, self.P, self.R = np.array(state), P.copy(), R
        if signed_radius == 0.0:
            block = np.array([[1.0, tau], [0.0, 1.0]])
            centre = np.zeros(4)
        else:
            w = math.hypot(vx, vy) / signed_radius
            c = math.cos(w * tau)
            s = math.sin(w * tau)
            block = np.array([[c, s / w], [-w * s, c]])
            centre = np.array([xs - vy / w, 0.0, ys + vx / w, 0.0])
        self.Phi = np.kron(np.eye(2), block)
        self.B = centre - self.Phi @ centre
        self.GQG = np.diag([0.0, Q, 0.0, Q])

    def predicted(self):
        """Return state and covariance one tick later."""
        return self.Phi @ self.x + self.B, self.Phi @ self.P @ self.Phi.T + self.GQG


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
    return np.array([function(state + 1j * h * axis).imag / h for axis in np.eye(len(state))]).T


class MatrixExtendedKalmanFilter(MatrixFilter):
    """Extended Kalman filter with seven states. Jacobians are computed by complex steps."""

    def __init__(self, anchor, P, signed_radius, tau, Q, R, freedom=0, drift=0):
        self.tau, self.R, self.freedom = tau, R, freedom
        self.Q = np.diag([0, Q, 0, Q, 0, 0, 0])
        # A drift moves x and the x of the centre by the same way, and likewise y.
        for moved in ([1, 0, 0, 0, 1, 0, 0], [0, 0, 1, 0, 0, 1, 0]):
            self.Q = self.Q + drift * np.outer(moved, moved)
        if signed_radius == 0.0:
            self.x = np.array([*anchor, 0.0, 0.0, 0.0])
            J = np.eye(7)[:, :4]
        else:
            self.x = turn_state(anchor, signed_radius)
            J = jacobian(lambda state: turn_state(state, signed_radius), np.array(anchor))
        self.P = J @ P @ J.T

    @property
    def s(self):
        """The state."""
        return self.x

    def predicted(self):
        """Return state and covariance one tick later."""
        F = jacobian(lambda state: move(state, self.tau), self.x)
        # The turn rate of the straight line is exactly zero.
        if self.x[6] == 0.0:
            F[:4, 6] = 0.0
        return move(self.x, self.tau), F @ self.P @ F.T + self.Q


class LiteralImm:
    """IMM as in Blom & Bar-Shalom 1988: mixing, filtering, probabilities, output, with
    probabilities.
    """

    # See `MatrixFilter`.
    rates = ()

    def __init__(self, estimate, P, curvatures, transition, tau, Q, R, freedom=0, drift=0):
        self.freedom = freedom
        self.curvatures, self.transition, self.tau = curvatures, transition, tau
        self.GQG, self.R = np.diag([drift, Q, drift, Q]), np.diag(R)
        self.states = [np.array(estimate) for _ in curvatures]
        self.covariances = [np.array(P) for _ in curvatures]
        self.probability = np.full(len(curvatures), 1.0 / len(curvatures))

    def mixed(self, j, weights):
        """Return state and covariance in which filter j begins a tick."""
        return self.merged(weights)

    def predicted(self, j, x, P):
        """Return the prediction of filter j."""
        F = turn_matrix(x, self.curvatures[j], self.tau)
        return F @ x, F @ P @ F.T + self.GQG

    def stands(self, j):
        """Whether the object stands in mode j."""
        return False

    def merged(self, weights):
        """Return mean and covariance of the mixture of the filters."""
        mean = sum(w * x for w, x in zip(weights, self.states, strict=True))
        spread = sum(
            w * (P + np.outer(x - mean, x - mean))
            for w, x, P in zip(weights, self.states, self.covariances, strict=True)
        )
        return mean, spread

    def step(self, z):
        """One tick; a measurement None only predicts."""
        prior = self.transition.T @ self.probability
        weights = self.transition * self.probability[:, None] / prior
        mixed = [self.mixed(j, column) for j, column in enumerate(weights.T)]
        self.log_likelihood = np.zeros(len(prior))
        for j, begun in enumerate(mixed):
            x, P = self.predicted(j, *begun)
            if z is not None or self.rates:
                heavy = self.freedom, self.stands(j)
                x, P, likelihood = correct(x, P, z, self.R, self.rates, *heavy)
                self.log_likelihood[j] = likelihood
            self.states[j], self.covariances[j] = x, P
        self.probability = prior * np.exp(self.log_likelihood - self.log_likelihood.max())
        self.probability /= self.probability.sum()
        self.estimate, self.covariance = self.merged(self.probability)


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
    return matrix


def step_filters(filters, env, i, measurement):
    """Advance the filters of track i; a measurement of NaN only predicts."""
    noise, rates = (env.world.field(name)[i] for name in ("noise", "rates"))
    variance = np.sqrt(np.broadcast_to(env.options.variances, 2))
    missing = np.isnan(measurement).any()
    measured = []
    for sensor in env.options.sensors:
        seen, rates = rates[: sensor.rates], rates[sensor.rates :]
        if sensor.rates == 2:
            measured.append((seen, None, math.sqrt(sensor.velocity_variance)))
        elif sensor.rates == 1 and sensor.places:
            measured.append((seen[0], sensor.position, sensor.rate_deviation))
        elif sensor.rates == 1:
            kind = "bearing" if sensor.range_deviation is None else "range"
            deviation = sensor.range_deviation or sensor.bearing_deviation
            measured.append((seen[0], sensor.position, deviation, kind))
    for kalman in filters:
        ratio = np.eye(2) if missing else noise[[[0, 1], [1, 2]]]
        kalman.R = ratio * np.outer(variance, variance)
        kalman.rates = [each for each in measured if not np.isnan(each[0]).any()]
        kalman.step(None if missing else measurement)


BANK = {
    "log_likelihood": lambda kalman: kalman.log_likelihood,
    # Zero without a measurement, where the mask says so.
    "innovations": lambda kalman: np.nan_to_num(kalman.innovation),
    "innovation_covariances": lambda kalman: kalman.Sigma,
    "estimates": lambda kalman: kalman.x[:4],
    "covariances": lambda kalman: kalman.P[:4, :4],
}
"""What the info of an environment says of a filter of its bank."""


def bank_values(filters):
    """Yield names of the info, with the values of filters, a list for each track."""
    for name, value in BANK.items():
        yield name, np.array([[value(kalman) for kalman in of_track] for of_track in filters])


def normalized_squares(errors, covariances):
    """Squares (n,) of errors (n, k), each normalized by its covariance, (n, k, k)."""
    return (errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(1)


FIVE_SIGMA = stats.norm.sf(5.0)


def inside(total, degrees):
    """Return True if a chi-square variable is inside its two-sided bounds of 5 sigma."""
    return FIVE_SIGMA < stats.chi2.cdf(total, degrees) < 1 - FIVE_SIGMA
