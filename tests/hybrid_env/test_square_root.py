"""The log-likelihoods of the bank where a covariance is nearly singular, against filters in
square-root form, which Golubkov 2018 cites for stable likelihood ratios (reference 12).
"""

import math

import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter, MatrixKalmanFilter

from hybrid_env import KalmanBank, simulate

RADII = (3.0, 5.0)
TAU = 0.1


class SquareRootFilter:
    """A filter that has a factor S of its covariance S S' instead of the covariance, so that no
    covariance loses its positive eigenvalues. Predictions and corrections are QR decompositions,
    and the likelihood follows from their triangles (Park & Kailath 1995; Semoushin & Tsyganova
    2001).
    """

    def __init__(self, kalman, root, Q, R):
        self.kalman, self.S, self.deviation = kalman, root, math.sqrt(R)
        self.G = math.sqrt(Q) * np.eye(len(root))[:, [1, 3]]
        self.H = np.eye(len(root))[[0, 2]]
        self.log_likelihood = 0.0

    def step(self, z):
        x, F, _ = self.kalman.linearised()
        S = np.linalg.qr(np.vstack([(F @ self.S).T, self.G.T]), mode="r").T
        noise = np.hstack([self.deviation * np.eye(2), np.zeros((2, len(x)))])
        after = np.linalg.qr(np.vstack([noise, np.hstack([(self.H @ S).T, S.T])]), mode="r")
        root, gain = after[:2, :2].T, after[:2, 2:].T
        white = np.linalg.solve(root, z - self.H @ x)
        self.log_likelihood -= 0.5 * white @ white + np.log(abs(np.diag(root))).sum()
        self.log_likelihood -= math.log(2 * math.pi)
        self.kalman.x, self.S = x + gain @ white, after[2:, 2:].T


# Variances of position and velocity at the start, of the velocity in a tick, and of a measurement,
# and the tolerances of both banks. The corrected position has at most a hundred-millionth of the
# variance before; the anchor-aware bank loses digits of it in the slopes of its extended Kalman
# filter. In each of 120 ticks it also widens the variances by 1e-14, so that no covariance is
# negative.
SINGULAR = [
    (1.0, 0.001, 0.1, {"published": 1e-12, "anchor_aware": 1e-11}),
    (1e-8, 0.0, 1.0, {"published": 1e-12, "anchor_aware": 1e-11}),
    (1.0, 0.0, 1e-8, {"published": 1e-9, "anchor_aware": 1e-3}),
    (1.0, 1e-12, 1e-8, {"published": 1e-9, "anchor_aware": 1e-3}),
    (1e4, 0.0, 1e-4, {"published": 1e-9}),
]


@pytest.mark.parametrize(
    ("P", "Q", "R", "bank", "tolerance"),
    [(*case, *pair) for *case, banks in SINGULAR for pair in banks.items()],
)
def test_log_likelihoods_equal_those_of_square_root_filters(P, Q, R, bank, tolerance):
    recording = simulate("L120r3", runs=1, seed=2, process_variance=Q, measurement_variance=R)
    anchor = np.array([0.0, 0.0, 0.0, 2.0])
    ours = KalmanBank(RADII, TAU, Q, R, bank)
    ours.anchor(anchor, P * np.eye(4))
    kind = MatrixKalmanFilter if bank == "published" else MatrixExtendedKalmanFilter
    filters = []
    for radius in (0.0, *RADII, *(-radius for radius in RADII)):
        kalman = kind(anchor, P * np.eye(4), radius, TAU, Q, R)
        root = math.sqrt(P) * getattr(kalman, "slopes", np.eye(4))
        filters.append(SquareRootFilter(kalman, root, Q, R))
    for z in recording.measurements[0]:
        ours.step(z)
        for kalman in filters:
            kalman.step(z)
        exact = [kalman.log_likelihood for kalman in filters]
        np.testing.assert_allclose(ours.log_likelihood, exact, rtol=tolerance, atol=tolerance)
    # The turn that was simulated.
    assert np.argmax(exact) == 1
