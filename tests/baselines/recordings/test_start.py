"""The covariance of the start from the first measurements."""

import numpy as np

from baselines.recordings.start import line_estimate, unit_noise
from hybrid_env import QuickestOptions, simulate

SIZE = 2000


def test_the_covariance_is_that_of_the_errors_on_straight_tracks():
    # A radius so large that the part of the turns is negligible.
    options = QuickestOptions(
        radii=(1e6,), process_variance=0.3, measurement_variance=(0.02, 0.5), tau=0.4
    )
    ticks = np.array([3, 4, 8, 9])
    run = simulate(
        "S7",
        SIZE,
        start=(0.0, 3.0, 0.0, -1.0),
        tau=options.tau,
        process_variance=options.process_variance,
        measurement_variance=options.measurement_variance,
    )
    points, truth = run.measurements[:, ticks - 3], run.truth[:, -1]
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
