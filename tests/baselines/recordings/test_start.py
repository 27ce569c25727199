"""The covariance of the start from the first measurements."""

import numpy as np

from baselines import OnlineTracker, ThresholdDecider
from baselines.recordings.start import line_estimate, unit_noise
from hybrid_env import QuickestOptions

SIZE = 2000


def straight_measurements(options, ticks, generator):
    """Return noisy measurements (SIZE, m, 2) of straight tracks and the states (SIZE, 4) at the
    last one.
    """
    drawn = generator.normal(size=(SIZE, ticks[-1] - ticks[0], 2))
    first = ((0, 0), (1, 0), (0, 0))
    velocity = np.cumsum(np.pad(np.sqrt(options.process_variance) * drawn, first), axis=1)
    velocity += (3.0, -1.0)
    position = options.tau * np.cumsum(np.pad(velocity[:, :-1], first), axis=1)
    points = position + np.sqrt(options.variances) * generator.normal(size=position.shape)
    truth = np.stack([position[:, -1], velocity[:, -1]], axis=-1).reshape(SIZE, 4)
    return points[:, ticks - ticks[0]], truth


def test_the_covariance_is_that_of_the_errors_on_straight_tracks():
    # A radius so large that the part of the turns is negligible.
    options = QuickestOptions(
        radii=(1e6,), process_variance=0.3, measurement_variance=(0.02, 0.5), tau=0.4
    )
    ticks = np.array([3, 4, 8, 9])
    points, truth = straight_measurements(options, ticks, np.random.default_rng(len(ticks)))
    noises = np.tile(unit_noise(options), (len(ticks), 1))
    estimates = [
        line_estimate(np.column_stack([ticks, drawn, noises]), options) for drawn in points
    ]
    errors = np.array([estimate for estimate, _ in estimates]) - truth
    covariance = estimates[0][1]
    # The quadratic form of normal errors with 4 components has mean 4 and variance 8.
    quadratic = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)

    assert abs(quadratic.mean() - 4.0) < 4.0 * np.sqrt(8.0 / SIZE)
    # The elements of the sample covariance deviate by sqrt((1 + r^2) / n) of the standard
    # deviations.
    deviations = np.sqrt(covariance.diagonal())
    sample = errors.T @ errors / SIZE
    bound = 5.0 * np.sqrt(2.0 / SIZE)
    assert (np.abs(sample - covariance) < bound * np.outer(deviations, deviations)).all()


def test_a_single_measurement_tells_nothing_about_the_velocity():
    tracker = OnlineTracker(QuickestOptions(measurement_variance=(0.1, 0.4)), ThresholdDecider())
    now = tracker.update((3.0, -2.0))
    np.testing.assert_array_equal(now.estimate, [3.0, 0.0, -2.0, 0.0])
    np.testing.assert_array_equal(now.covariance.diagonal(), [0.1, np.inf, 0.4, np.inf])
    np.testing.assert_allclose(now.probabilities, 1 / 3)
    now = tracker.update(None)
    assert not np.isnan(now.covariance).any()
