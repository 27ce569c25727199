"""The g-h filter and the adaptive filters."""

import numpy as np
from filterpy.gh import GHFilter as PeerGH

from baselines.estimation.gain_filters import AdaptiveFilter, CorrectedAdaptiveFilter, GHFilter
from baselines.estimation.run_filter import run_filter


def test_g_h_equals_filterpy_on_100_random_problems():
    rng = np.random.default_rng(0)
    for _ in range(100):
        g = rng.uniform(0.05, 1.0)
        h = rng.uniform(0.0, 0.5)
        axes = int(rng.integers(1, 4))
        start = rng.normal(size=(2, axes))
        measurements = rng.normal(0.0, 9.0, (15, 1, axes))
        times = np.cumsum(rng.uniform(0.1, 3.0, 15))
        peers = [PeerGH(x, dx, 1.0, g, h) for x, dx in start.T]
        gh = GHFilter(axes, g, h)
        gh.begin_from(start.T.reshape(1, -1))
        for dt, measured in zip(np.diff(times, prepend=0.0), measurements, strict=True):
            gh.predict(dt)
            gh.update(measured)
            for peer, z in zip(peers, measured[0], strict=True):
                peer.dt = dt
                peer.update(z)
            expected = [(peer.x, peer.dx) for peer in peers]
            np.testing.assert_allclose(
                gh.state[0].reshape(axes, 2),
                expected,
                rtol=1e-9,
                atol=1e-9,
            )


def test_g_h_starts_with_two_points_and_anew_after_a_gap():
    measurements = np.array([np.nan, 2.0, np.nan, 8.0, 11.0, np.nan, 50.0, 54.0, 54.5])[:, None]
    times = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 9.0, 9.0]
    states = run_filter(GHFilter(1, 0.5, 0.25, longest_gap=3.5), measurements, times).states

    assert np.isnan(states[0]).all()
    np.testing.assert_allclose(states[1], [2.0, 0.0])
    # Two points, two seconds apart.
    np.testing.assert_allclose(states[3], [8.0, 3.0])
    np.testing.assert_allclose(states[4], [11.0, 3.0])
    np.testing.assert_allclose(states[5], [14.0, 3.0])
    # A gap of 4 s.
    np.testing.assert_allclose(states[6], [50.0, 0.0])
    np.testing.assert_allclose(states[7], [54.0, 4.0])
    # A second sensor at the same time.
    np.testing.assert_allclose(states[8], [54.25, 4.0])


def test_units_change_nothing_but_the_units():
    rng = np.random.default_rng(2)
    measurements = rng.normal(0.0, 30.0, (60, 4, 2))
    times = np.arange(60.0)
    length = 1000.0
    time = 60.0
    pairs = [
        (GHFilter(2, 0.5, 0.2, 4.0), GHFilter(2, 0.5, 0.2, 4.0 * time)),
        (AdaptiveFilter(2, 1.0), AdaptiveFilter(2, time)),
        (CorrectedAdaptiveFilter(2, 1.0), CorrectedAdaptiveFilter(2, time)),
    ]
    for one, other in pairs:
        first = run_filter(one, measurements, times).states
        second = run_filter(other, length * measurements, time * times).states
        np.testing.assert_allclose(
            second,
            first * np.tile([length, length / time], 2),
            rtol=1e-6,
            atol=1e-6,
        )
