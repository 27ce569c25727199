"""Kalman filters of kinematic models against filterpy, and what must not matter."""

import numpy as np
from filterpy.kalman import KalmanFilter as PeerKalman
from filterpy.kalman import rts_smoother
from kinematic_worlds import matrices, positions_of, random_covariance

from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter
from studies.filters.smoother import smooth


def random_problem(rng):
    """A model, R, a start, times and measurements with gaps, of any size and scale."""
    scale = 10.0 ** rng.uniform(-3, 3)
    kind = "continuous" if rng.random() < 0.5 else "discrete"
    name = str(rng.choice(["CV", "CA", "CJ"]))
    axes = int(rng.integers(1, 4))
    model = MotionModel(name, axes, scale**2 * rng.uniform(0.0, 3.0, axes), kind)
    noise = random_covariance(rng, axes, scale**2)
    start = random_covariance(rng, model.size, scale**2)
    times = np.cumsum(rng.uniform(0.05, 2.0, 12))
    measurements = scale * rng.normal(0.0, 3.0, (12, axes))
    measurements[rng.random(12) < 0.2] = np.nan
    return model, noise, scale * rng.normal(size=model.size), start, times, measurements


def peer_filter(model, noise, state, start, times, measurements):
    """Means, covariances, transitions and Q of filterpy."""
    peer = PeerKalman(model.size, model.axes)
    peer.x, peer.P, peer.R, peer.H = state[:, None].copy(), start.copy(), noise, positions_of(model)
    results = []
    last = 0.0
    for time, measured in zip(times, measurements, strict=True):
        peer.F, peer.Q = matrices(model, time - last)
        peer.predict()
        if not np.isnan(measured).any():
            peer.update(measured[:, None])
        results.append((peer.x[:, 0].copy(), peer.P.copy(), peer.F, peer.Q))
        last = time
    return [np.array(part) for part in zip(*results, strict=True)]


def test_filter_and_smoother_equal_filterpy_on_20_random_problems():
    rng = np.random.default_rng(0)
    for _ in range(20):
        model, noise, state, start, times, measurements = random_problem(rng)
        means, covariances, transitions, noises = peer_filter(
            model, noise, state, start, times, measurements
        )
        kalman = KalmanFilter(model, noise)
        kalman.begin_from(state[None], start)
        filtered = run_filter(kalman, measurements[:, None], times, begun=0.0)
        smoothed = smooth(model, filtered, times)
        # Filterpy takes for tick k the matrices from k to k + 1.
        later = [[*part[1:], part[-1]] for part in (transitions, noises)]
        expected, spreads, _, _ = rts_smoother(means[..., None], covariances, *later)
        for ours, peer in (
            (filtered.states, means),
            (filtered.covariances, covariances),
            (smoothed.states, expected[..., 0]),
            (smoothed.covariances, spreads),
        ):
            np.testing.assert_allclose(ours[:, 0], peer, rtol=0.0, atol=1e-9 * np.abs(peer).max())


def test_a_batch_equals_single_tracks():
    rng = np.random.default_rng(3)
    kalman = KalmanFilter(MotionModel("CA", 3, 0.3), 4.0, start_deviations=(10.0, 2.0))
    measurements = rng.normal(0.0, 10.0, (15, 2, 3))
    measurements[rng.random((15, 2)) < 0.3] = np.nan
    times = np.cumsum(rng.uniform(0.1, 2.0, (15, 2)), axis=0)
    batch = run_filter(kalman, measurements, times)
    for track in range(2):
        alone = run_filter(kalman, measurements[:, [track]], times[:, [track]])
        for name in ("states", "covariances"):
            expected = getattr(batch, name)[:, [track]]
            np.testing.assert_allclose(getattr(alone, name), expected, rtol=1e-12)


def test_a_track_begins_with_its_first_measurement():
    model = MotionModel("CV", 2, 1.0)
    kalman = KalmanFilter(model, (4.0, 9.0), start_deviations=(30.0,))
    measurements = np.array([[[np.nan, 1.0]], [[3.0, 5.0]]])
    filtered = run_filter(kalman, measurements, [0.0, 1.0])

    assert np.isnan(filtered.states[0]).all()
    np.testing.assert_array_equal(filtered.states[1, 0], [3.0, 0.0, 5.0, 0.0])
    np.testing.assert_allclose(filtered.covariances[1, 0], np.diag([4.0, 900.0, 9.0, 900.0]))
