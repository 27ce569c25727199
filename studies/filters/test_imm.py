"""The IMM filter against filterpy."""

import numpy as np
from filterpy.kalman import IMMEstimator
from filterpy.kalman import KalmanFilter as PeerKalman
from kinematic_worlds import matrices, positions_of, random_covariance

from studies.filters.imm import IMMFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel


def test_imm_equals_filterpy_on_20_random_problems():
    rng = np.random.default_rng(0)
    for _ in range(20):
        dt = rng.uniform(0.2, 2.0)
        count = int(rng.integers(2, 4))
        axes = int(rng.integers(1, 3))
        models = [MotionModel("CV", axes, rng.uniform(0.01, 5.0)) for _ in range(count)]
        noise = random_covariance(rng, axes)
        start = random_covariance(rng, 2 * axes)
        imm = IMMFilter(
            [KalmanFilter(model, noise) for model in models], rng.uniform(1.0, 20.0, count)
        )
        mean = rng.normal(size=2 * axes)
        measurements = rng.normal(0.0, 3.0, (5, axes))
        peers = []
        for model in models:
            peer = PeerKalman(2 * axes, axes)
            peer.x, peer.P, peer.R, peer.H = mean.copy(), start.copy(), noise, positions_of(model)
            peer.F, peer.Q = matrices(model, dt)
            peers.append(peer)
        imm.begin_from(mean[None], start)
        peer = IMMEstimator(peers, imm.probabilities[0], imm.transition(dt))
        for measured in measurements:
            imm.predict(dt)
            imm.update(measured[None])
            peer.predict()
            peer.update(measured)
            for estimated, expected in (
                (imm.probabilities, peer.mu),
                (imm.state, peer.x),
                (imm.covariance, peer.P),
            ):
                np.testing.assert_allclose(estimated[0], expected, rtol=1e-9, atol=1e-9)
