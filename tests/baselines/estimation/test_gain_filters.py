"""The g-h filter and the adaptive filters."""

import numpy as np
from filterpy.gh import GHFilter as PeerGH

from baselines.estimation.gain_filters import GHFilter
from baselines.estimation.run_filter import run_filter


def test_g_h_equals_filterpy_on_20_random_problems():
    rng = np.random.default_rng(0)
    for _ in range(20):
        g = rng.uniform(0.05, 1.0)
        h = rng.uniform(0.0, 0.5)
        axes = int(rng.integers(1, 4))
        start = rng.normal(size=(2, axes))
        measurements = rng.normal(0.0, 9.0, (15, 1, axes))
        times = np.cumsum(rng.uniform(0.1, 3.0, 15))
        peers = [PeerGH(x, dx, 1.0, g, h) for x, dx in start.T]
        gh = GHFilter(axes, g, h)
        gh.begin_from(start.T.reshape(1, -1))
        for dt, measured in zip(
            np.diff(times, prepend=0.0),
            measurements,
            strict=True,
        ):
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
    states = run_filter(
        GHFilter(1, 0.5, 0.25, longest_gap=3.5),
        measurements,
        times,
    ).states

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
