"""Reference filters for the tests, in matrix form as in the papers, and whether a filter is
consistent.
"""

import math

import numpy as np
from scipy import stats

# Degrees of freedom of the robust likelihood in the tests.
FREEDOM = 4.0


def correct(x, P, z, model, stands=False):
    """Correct a filter by a position, if there is one, and then by what else is measured.

    The likelihood of the position is normal, or Student's t with degrees of freedom.

    Args:
        x: state.
        P: covariance.
        z: measured coordinates, or None.
        model: with their places `seen` in the state, their covariance `R`, the degrees of
            `freedom`, and `rates`: velocities, given as (velocity, None, deviation), range rates of
            radars, (range rate, place of the radar, deviation), or ranges and bearings with their
            name at the end, linearised at the state.
        stands: whether the object stands, so that velocities and range rates are expected to be 0.

    Returns:
        state, covariance and log-likelihood.
    """
    likelihood = 0.0
    if z is not None:
        H = np.eye(len(x))[list(model.seen)]
        x, P, likelihood = correct_by(x, P, z - H @ x, H, model.R, model.freedom)
    for rate, place, deviation, *kind in model.rates:
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
    """A filter with the state x, which begins with [x, vx, y, vy], and its covariance P.

    A subclass has `linearised`, which returns the state one tick later, and F and Q.
    """

    # See `correct`.
    seen = (0, 2)
    rates = ()
    freedom = 0
    stands = False
    log_likelihood = 0.0

    def step(self, z):
        """One tick; a measurement None only predicts."""
        self.x, F, Q = self.linearised()
        self.P = F @ self.P @ F.T + Q
        self.R = np.diag(self.R) if np.ndim(self.R) == 1 else self.R
        H = np.eye(len(self.x))[list(self.seen)]
        self.Sigma = H @ self.P @ H.T + self.R
        self.innovation = np.full(len(H), np.nan) if z is None else z - H @ self.x
        self.x, self.P, more = correct(self.x, self.P, z, self, self.stands)
        self.log_likelihood += more


class LinearFilter(MatrixFilter):
    """A Kalman filter of x' = F x + B + w."""

    def __init__(self, x, P, F, B, Q, R=None, freedom=0):
        self.x, self.P, self.F, self.B, self.Q = map(np.array, (x, P, F, B, Q))
        self.R, self.freedom = R, freedom

    def linearised(self):
        """See `MatrixFilter`."""
        return self.F @ self.x + self.B, self.F, self.Q


class MatrixKalmanFilter(LinearFilter):
    """Kalman filter with four states. Golubkov 2018, eq. (1) and (2), with Sigma = H P H' + R."""

    def __init__(self, state, P, signed_radius, tau, Q, R, freedom=0):
        xs, vx, ys, vy = state
        if signed_radius == 0.0:
            block = np.array([[1.0, tau], [0.0, 1.0]])
            centre = np.zeros(4)
        else:
            w = math.hypot(vx, vy) / signed_radius
            c = math.cos(w * tau)
            s = math.sin(w * tau)
            block = np.array([[c, s / w], [-w * s, c]])
            centre = np.array([xs - vy / w, 0.0, ys + vx / w, 0.0])
        Phi = np.kron(np.eye(2), block)
        noise = np.diag([0.0, Q, 0.0, Q])
        super().__init__(state, P, Phi, centre - Phi @ centre, noise, R, freedom)


def move(state, tau):
    """Move [x, vx, y, vy, centre_x, centre_y, turn_rate] by one tick. Golubkov 2018, eq. (1), no
    noise.
    """
    x, vx, y, vy, cx, cy, w = state
    c = np.cos(w * tau)
    s = np.sin(w * tau)
    ratio = tau * np.sinc(w * tau / np.pi)
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
    w = np.sqrt(vx * vx + vy * vy) / signed_radius
    return np.array([*anchor, x - vy / w, y + vx / w, w])


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
        self.x, self.slopes = np.array([*anchor, 0.0, 0.0, 0.0]), np.eye(7)[:, :4]
        if signed_radius != 0.0:
            self.x = turn_state(anchor, signed_radius)
            self.slopes = jacobian(lambda state: turn_state(state, signed_radius), np.array(anchor))
        self.P = self.slopes @ P @ self.slopes.T

    def linearised(self):
        """See `MatrixFilter`."""
        F = jacobian(lambda state: move(state, self.tau), self.x)
        # The turn rate of the straight line is exactly zero.
        if self.x[6] == 0.0:
            F[:4, 6] = 0.0
        return move(self.x, self.tau), F, self.Q


def merged(weights, parts):
    """Return mean and covariance of a mixture of (state, covariance)."""
    states, spreads = map(np.array, zip(*parts, strict=True))
    mean = weights @ states
    apart = states - mean
    return mean, np.einsum("k,kij->ij", weights, spreads + apart[:, :, None] * apart[:, None])


class LiteralImm:
    """IMM as in Blom & Bar-Shalom 1988: mixing, filtering, probabilities, output.

    A subclass has `predicted`, the state and covariance of filter j one tick later.
    """

    # See `correct`.
    seen = (0, 2)
    rates = ()
    freedom = 0

    def __init__(self, parts, transition, R):
        self.parts, self.transition, self.R = parts, transition, R
        self.probability = np.full(len(parts), 1.0 / len(parts))

    def mixed(self, j, weights):
        """Return state and covariance in which filter j begins a tick."""
        return merged(weights, self.parts)

    def stands(self, j):
        """Whether the object stands in mode j."""
        return False

    def step(self, z):
        """One tick; a measurement None only predicts."""
        prior = self.transition.T @ self.probability
        weights = self.transition * self.probability[:, None] / prior
        begun = [self.mixed(j, column) for j, column in enumerate(weights.T)]
        corrected = [
            correct(*self.predicted(j, *start), z, self, self.stands(j))
            for j, start in enumerate(begun)
        ]
        self.parts = [(x, P) for x, P, _ in corrected]
        self.log_likelihood = np.array([likelihood for *_, likelihood in corrected])
        self.probability = prior * np.exp(self.log_likelihood - self.log_likelihood.max())
        self.probability /= self.probability.sum()
        self.estimate, self.covariance = merged(self.probability, self.parts)


def turn_matrix(state, curvature, tau):
    """Return the transition matrix of [x, vx, y, vy] in a coordinated turn."""
    a = curvature * math.hypot(state[1], state[3]) * tau
    C = math.cos(a)
    S = math.sin(a)
    along, across = tau * S / a, tau * (1 - C) / a
    return np.array([[1, along, 0, -across], [0, C, 0, -S], [0, across, 1, along], [0, S, 0, C]])


def normalized_squares(errors, covariances):
    """Squares (n,) of errors (n, k), each normalized by its covariance, (n, k, k)."""
    return (errors * np.linalg.solve(covariances, errors[..., None])[..., 0]).sum(1)


FIVE_SIGMA = stats.norm.sf(5.0)


def inside(total, degrees):
    """Return True if a chi-square variable is inside its two-sided bounds of 5 sigma."""
    return FIVE_SIGMA < stats.chi2.cdf(total, degrees) < 1 - FIVE_SIGMA
