"""The IMM filter against filterpy, its limits, and in a world that switches between CV and CA."""

import numpy as np
from filterpy.kalman import IMMEstimator
from filterpy.kalman import KalmanFilter as PeerKalman
from kinematic_worlds import (
    draw,
    matrices,
    mean_bounds,
    positions_of,
    random_covariance,
    squared_errors,
)

from studies.filters.imm import IMMFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter


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


def test_probabilities_follow_the_chain_without_measurements():
    imm = IMMFilter(
        [
            KalmanFilter(MotionModel("CV", 1, 1.0), 1.0, (1.0,)),
            KalmanFilter(MotionModel("CA", 1, 1.0), 1.0, (1.0, 1.0)),
        ],
        (30.0, 10.0),
    )
    np.testing.assert_allclose(imm.transition(2.0).sum(-1), 1.0)
    np.testing.assert_allclose(imm.transition(1e6), [[0.75, 0.25]] * 2, rtol=1e-9)
    imm.begin_from(np.zeros((2, 3)), np.eye(3))
    imm.predict(np.array([0.5, 3.0]))
    imm.update(np.full((2, 1), np.nan))
    np.testing.assert_allclose(imm.probabilities, [[0.75, 0.25]] * 2)


def switching_world(rng, imm, times, tracks, deviation):
    """States (T, B, 2, 3) of [x, v, a] on two axes; an acceleration begins at N(0, deviation^2)."""
    models = [kalman.model for kalman in imm.filters]
    mode = (rng.random(tracks) < imm._stationary[1]).astype(int)
    state = rng.normal(size=(tracks, 2, 3)) * (2.0, 5.0, deviation)
    state[mode == 0, :, 2] = 0.0
    states = []
    last = 0.0
    for time in times:
        new = (rng.random(tracks) > imm.transition(time - last)[mode, 0]).astype(int)
        enters = (new == 1) & (mode == 0)
        state[enters, :, 2] = deviation * rng.normal(size=(enters.sum(), 2))
        state[new == 0, :, 2] = 0.0
        mode = new
        for index, model in enumerate(models):
            transition, noise = matrices(MotionModel(model.name, 1, model.noise[:1]), time - last)
            size = model.order
            chosen = mode == index
            moved = state[chosen, :, :size] @ transition.T
            state[chosen, :, :size] = moved + draw(rng, 0.0, noise, 2 * chosen.sum()).reshape(
                moved.shape
            )
        states.append(state.copy())
        last = time
    return np.array(states)


def test_imm_of_cv_and_ca_is_consistent_in_its_world():
    rng = np.random.default_rng(2)
    tracks = 1500
    times = np.cumsum(np.random.default_rng(3).uniform(0.5, 1.5, 30))
    deviation = 3.0
    cv = KalmanFilter(MotionModel("CV", 2, 0.2), 4.0, (5.0,))
    ca = KalmanFilter(MotionModel("CA", 2, 0.5), 4.0, (5.0, deviation))
    imm = IMMFilter([cv, ca], (12.0, 6.0))
    states = switching_world(rng, imm, times, tracks, deviation)
    measurements = states[..., 0] + rng.normal(0.0, 2.0, states.shape[:3])
    imm.begin_from(np.zeros((tracks, 6)), np.kron(np.eye(2), np.diag([4.0, 25.0, deviation**2])))
    filtered = run_filter(imm, measurements, times, begun=0.0)
    low, high = mean_bounds(2.0, filtered.nis.var(), filtered.nis.size)
    assert low < filtered.nis.mean() < high
    error = np.stack(
        [filtered.positions - states[..., 0], filtered.velocities - states[..., 1]], axis=-1
    )
    spread = filtered.covariances[-1][:, [0, 1, 3, 4]][:, :, [0, 1, 3, 4]]
    nees = squared_errors(error[-1].reshape(tracks, 4), spread)
    low, high = mean_bounds(4.0, nees.var(), tracks)
    assert low < nees.mean() < high
