"""A reference filter of standing and accelerating modes with an exact acceleration, in matrices."""

import numpy as np
from matrix_filters import MatrixFilter

from hybrid_env.modes import Stop


class MatrixLinearFilter(MatrixFilter):
    """Kalman filter of [x, vx, y, vy, ax, ay]."""

    def __init__(self, state, P, mode, tau, Q, R):
        self.R = R
        # Along the heading.
        ratio = mode.starting_acceleration / np.hypot(state[1], state[3])
        self.x = np.array([*state, ratio * state[1], ratio * state[3]])
        self.P = np.zeros((6, 6))
        self.P[:4, :4] = P
        self.F = np.eye(6)
        if not isinstance(mode, Stop):
            self.F[[0, 2, 1, 3], [1, 3, 4, 5]] = tau
            self.F[[0, 2], [4, 5]] = tau * tau / 2
        self.Q = np.diag([0, Q, 0, Q, 0, 0])

    def predicted(self):
        """Return state and covariance one tick later."""
        return self.F @ self.x, self.F @ self.P @ self.F.T + self.Q
