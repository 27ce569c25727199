"""Heights of a live sensor: literal filters, a helix, and what a tracker of the plane does too."""

import numpy as np
import pytest
from hostile_input import refused
from matrix_filters import LiteralImm, merged

from baselines import OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions

OPTIONS = {
    "speed": 50.0,
    "tau": 1.0,
    "measurement_variance": 25.0,
    "process_variance": 0.05,
    "climb_variance": 1e-3,
    "height_variance": 9.0,
}
RADII = {"radii": (900.0,)}
RATES = (8.0, 0.0, -6.0)


def helix(rates=RATES, ticks=120, seed=0):
    """Return measured positions (n, 3) of a left turn, in pieces of one climb rate each."""
    generator = np.random.default_rng(seed)
    angles = np.arange(ticks * len(rates)) / 18.0
    heights = 1000.0 + np.cumsum(np.repeat(rates, ticks))
    path = np.stack([900.0 * np.sin(angles), -900.0 * np.cos(angles), heights], axis=1)
    return path + generator.normal(size=path.shape) * (5.0, 5.0, 3.0)


def tracker_of(**changes):
    return OnlineTracker(QuickestOptions(**RADII, **OPTIONS | changes), ThresholdDecider())


class LiteralHeights(LiteralImm):
    """Two Kalman filters of [z, vz], of a level height and of any rate, mixed as in Blom &
    Bar-Shalom 1988.
    """

    seen = (0,)
    F = np.array([[[1.0, 0.0], [0.0, 0.0]], [[1.0, 1.0], [0.0, 1.0]]])
    # Of 1e-3 R, and of a rate of the deviation of a measurement in a tick.
    Q = np.array([np.diag([1e-3 * 9.0, 9.0]), np.diag([0.0, OPTIONS["climb_variance"]])])

    def predicted(self, j, x, P):
        return self.F[j] @ x, self.F[j] @ P @ self.F[j].T + self.Q[j]

    def told(self):
        """Return mean and covariance, where the rate of a level height is 0."""
        (x, P), rising = self.parts
        known = np.diag([1.0, 0.0])
        return merged(self.probability, [(known @ x, known @ P @ known), rising])


def test_heights_are_those_of_literal_filters_also_missing_late_and_far_ones():
    heights = helix()[:, 2]
    heights[[20, 21, 150]] = np.nan
    tracker, literal = tracker_of(), None
    for k, z in enumerate(heights):
        far = k in (60, 200)
        now = tracker.update((50.0 * k, 0.0, -9999.0 if far else z), float(k)).height
        if literal is None:
            assert now.status == "used" if k else "begun"
            if k == 2:
                # The mean duration is 75 ticks.
                stay = np.full((2, 2), 1 / 75) + (1 - 2 / 75) * np.eye(2)
                parts = [(now.estimate, now.covariance)] * 2
                literal = LiteralHeights(parts, stay, np.array([[OPTIONS["height_variance"]]]))
            continue
        literal.step(None if far or np.isnan(z) else np.array([z]))
        mean, covariance = literal.told()
        assert now.status == ("far" if far else "missing" if np.isnan(z) else "used")
        np.testing.assert_allclose(now.estimate, mean, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(now.covariance, covariance, rtol=1e-6, atol=1e-9)
        level = now.probabilities[0], literal.probability[0]
        assert level[0] == pytest.approx(level[1], rel=1e-7, abs=1e-12)
        assert now.probabilities.sum() == pytest.approx(1.0)


def test_a_late_row_gives_the_same_as_in_order():
    points = helix()
    tracker, other = tracker_of(), tracker_of()
    order = [*range(100), *range(101, 110), 100, *range(110, 130)]
    for k in order:
        now = tracker.update(tuple(points[k]), float(k))
        assert (now.status, now.height.status) == (("late",) * 2 if k == 100 else (now.status,) * 2)
    for k in range(130):
        expected = other.update(tuple(points[k]), float(k))
    np.testing.assert_equal(now.height, expected.height)


@pytest.mark.parametrize("metre", [1.0, 1 / 0.3048])
def test_a_helix_is_three_pieces_with_their_climb_rates_beside_the_same_plane(metre):
    points, rates, modes = helix((8.0, -6.0, 4.0)) * metre, [], []
    scales = np.full(4, 1.0 / metre)
    options = QuickestOptions(**RADII, **OPTIONS)
    tracker, plane = (OnlineTracker(options, ThresholdDecider(), scales=scales) for _ in range(2))
    for k, point in enumerate(points):
        now, expected = tracker.update(point, float(k)), plane.update(tuple(point[:2]), float(k))
        np.testing.assert_equal(now._replace(height=None), expected)
        rates.append(now.height.estimate[1] / metre)
        modes.append(now.height.mode)
    for k, rate in enumerate((8.0, -6.0, 4.0)):
        half = slice(120 * k + 60, 120 * k + 120)
        assert np.mean(rates[half]) == pytest.approx(rate, rel=0.05)
        assert np.mean(np.array(modes[half]) == (1 if rate > 0 else 2)) > 0.95


@pytest.mark.parametrize("height", [np.inf, 1e300, "up", None])
def test_what_is_no_height_is_refused_in_one_line(height):
    assert "measurement=" in refused(tracker_of().update, (1.0, 2.0, height))
