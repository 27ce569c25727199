"""ATE with filters that start every segment from the covariance of the estimate, P kept, instead of
P := I.

A turn has the centre and the rate that follow from the estimate at the switch. As published, they
are exact; on the anchor-aware bank they belong to the state, with the covariance that follows from
that of the estimate, and an extended Kalman filter corrects them.
"""

import numpy as np

from hybrid_env import Simulation
from studies.papers.ate import run_ate
from studies.papers.published import FloatArray, IntArray
from studies.papers.setting import Setting


class AnchoredFilters:
    """Filters of n runs and M modes with the state [x, vx, y, vy, centre x, centre y, rate].

    Args:
        setting, variance: radii, tau and Q; R [m^2].
        exact: whether centre and rate are exact.
    """

    def __init__(self, setting: Setting, variance: float, exact: bool):
        self.radii = setting.signed_radii
        self.tau = setting.tau
        self.variance = variance
        self.exact = exact
        self.process = np.diag([0.0, setting.process_variance] * 2 + [0.0] * 3)

    def begin(self, anchor: FloatArray, covariance: FloatArray) -> None:
        """Start all filters from estimates (n, 4) with covariances (n, 4, 4)."""
        x, vx, y, vy = anchor.T[..., None]
        speed = np.hypot(vx, vy)
        radii = np.broadcast_to(self.radii, (len(anchor), self.radii.size))
        turns = radii != 0.0
        sizes = np.where(turns, np.abs(radii), 1.0)
        rate = np.where(turns, speed / sizes, 0.0)
        centre = x - radii * vy / speed, y + radii * vx / speed
        self.states = np.stack([*np.broadcast_arrays(x, vx, y, vy, *centre, rate)], axis=-1)
        # Slopes of the state after the anchor.
        slopes = np.zeros((*radii.shape, 7, 4))
        slopes[..., range(4), range(4)] = 1.0
        if not self.exact:
            cube = radii / speed**3
            slopes[..., 4, 0] = slopes[..., 5, 2] = 1.0
            slopes[..., 4, 1], slopes[..., 4, 3] = cube * vx * vy, -cube * vx**2
            slopes[..., 5, 1], slopes[..., 5, 3] = cube * vy**2, -cube * vx * vy
            slopes[..., 6, 1], slopes[..., 6, 3] = vx / (speed * sizes), vy / (speed * sizes)
            slopes[~turns, 4:] = 0.0
        self.covariances = slopes @ covariance[:, None] @ slopes.swapaxes(-1, -2)
        self.log_likelihood = np.zeros(radii.shape)

    def step(self, measured: FloatArray) -> None:
        """Advance by one tick to measurements (n, 2) [m]."""
        states = self.states
        rate = states[..., 6]
        turns = rate != 0.0
        divisor = np.where(turns, rate, 1.0)
        cosine, sine = np.cos(rate * self.tau), np.sin(rate * self.tau)
        ratio = np.where(turns, sine / divisor, self.tau)
        change = np.where(turns, (self.tau * cosine - ratio) / divisor, 0.0)
        slopes = np.zeros((*states.shape, 7))
        slopes[..., range(4, 7), range(4, 7)] = 1.0
        moved = states.copy()
        for axis in (0, 1):
            p, v, c = 2 * axis, 2 * axis + 1, 4 + axis
            off, velocity = states[..., p] - states[..., c], states[..., v]
            moved[..., p] = states[..., c] + cosine * off + ratio * velocity
            moved[..., v] = cosine * velocity - rate * sine * off
            slopes[..., p, p] = slopes[..., v, v] = cosine
            slopes[..., p, v], slopes[..., v, p] = ratio, -rate * sine
            slopes[..., p, c], slopes[..., v, c] = 1.0 - cosine, rate * sine
            slopes[..., p, 6] = change * velocity - self.tau * sine * off
            slopes[..., v, 6] = -self.tau * sine * velocity
            slopes[..., v, 6] -= (sine + rate * self.tau * cosine) * off
        states = moved
        covariances = slopes @ self.covariances @ slopes.swapaxes(-1, -2) + self.process
        for axis in (0, 1):
            column = covariances[..., 2 * axis]
            spread = column[..., 2 * axis] + self.variance
            innovation = measured[:, None, axis] - states[..., 2 * axis]
            gain = column / spread[..., None]
            states = states + gain * innovation[..., None]
            covariances = covariances - gain[..., :, None] * column[..., None, :]
            surprise = innovation**2 / spread + np.log(2.0 * np.pi * spread)
            self.log_likelihood -= 0.5 * surprise
        self.states, self.covariances = states, covariances

    @property
    def estimates(self) -> FloatArray:
        """(n, M, 4) estimates [x, vx, y, vy]."""
        return self.states[..., :4]


def anchored_ate(
    recording: Simulation, setting: Setting, variance: float, exact: bool
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return estimates (n, T, 4), decided modes and decision times (n, K) of ATE, whose test is
    that of Golubkov 2018, algorithm 1.

    In the setting of Tsyganov 2019 the estimates before a decision are those of the decided filter,
    from the switch on.

    Args:
        recording, setting, variance: n runs of T ticks and K segments, and R [m^2].
        exact: see `AnchoredFilters`.
    """
    tracks = run_ate(
        AnchoredFilters(setting, variance, exact),
        recording.measurements,
        recording.lengths,
        np.tile(setting.start, (len(recording.measurements), 1)),
        alpha=setting.alpha,
        recalculation="rewind" if setting.ate else "none",
    )
    return tracks.estimates, tracks.decided, tracks.ticks
