"""The start from the first measurements: its covariance, and the tracks that begin with it."""

import numpy as np
import pytest
from online_episodes import COMMON

from baselines import OnlineTracker, ThresholdDecider
from baselines.rules.start import line_estimate, unit_noise
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions

SIZE = 2000


def straight_measurements(options, ticks, generator):
    """Return noisy measurements (SIZE, m, 2) of straight tracks and the states (SIZE, 4) at the
    last one.
    """
    steps = ticks[-1] - ticks[0] + 1
    velocity = np.tile([3.0, -1.0], (SIZE, 1))
    position = np.zeros((SIZE, 2))
    points = []
    for k in range(steps):
        if k:
            position = position + options.tau * velocity
            velocity = velocity + np.sqrt(options.process_variance) * generator.normal(
                size=(SIZE, 2)
            )
        points.append(position + np.sqrt(options.variances) * generator.normal(size=(SIZE, 2)))
    truth = np.stack(
        [position[:, 0], velocity[:, 0], position[:, 1], velocity[:, 1]],
        axis=1,
    )
    return np.stack(points, axis=1)[:, ticks - ticks[0]], truth


@pytest.mark.parametrize(
    "ticks",
    [[1, 2], [1, 2, 3], [3, 4, 8, 9], list(range(1, 11))],
    ids=str,
)
def test_the_covariance_is_that_of_the_errors_on_straight_tracks(ticks):
    # A radius so large that the part of the turns is negligible.
    options = QuickestOptions(
        radii=(1e6,),
        process_variance=0.3,
        measurement_variance=(0.02, 0.5),
        tau=0.4,
    )
    ticks = np.array(ticks)
    points, truth = straight_measurements(
        options,
        ticks,
        np.random.default_rng(len(ticks)),
    )
    noises = np.tile(unit_noise(options), (len(ticks), 1))
    estimates = [
        line_estimate(
            ticks,
            drawn,
            noises,
            options,
        )
        for drawn in points
    ]
    errors = np.array([estimate for estimate, _ in estimates]) - truth
    covariance = estimates[0][1]
    # The quadratic form of normal errors with 4 components has mean 4 and variance 8.
    quadratic = np.einsum(
        "ni,ij,nj->n",
        errors,
        np.linalg.inv(covariance),
        errors,
    )

    assert abs(quadratic.mean() - 4.0) < 4.0 * np.sqrt(8.0 / SIZE)
    # The elements of the sample covariance deviate by sqrt((1 + r^2) / n) of the standard
    # deviations.
    deviations = np.sqrt(covariance.diagonal())
    sample = errors.T @ errors / SIZE
    bound = 5.0 * np.sqrt(2.0 / SIZE)
    assert (np.abs(sample - covariance) < bound * np.outer(deviations, deviations)).all()


def test_a_single_measurement_tells_nothing_about_the_velocity():
    tracker = OnlineTracker(QuickestOptions(measurement_variance=(0.1, 0.4)), ThresholdDecider())
    nothing = tracker.update(None)

    assert np.isnan(nothing.estimate).all()
    now = tracker.update((3.0, -2.0))
    np.testing.assert_array_equal(now.estimate, [3.0, 0.0, -2.0, 0.0])
    np.testing.assert_array_equal(
        now.covariance.diagonal(),
        [0.1, np.inf, 0.4, np.inf],
    )
    assert (now.mode, now.decided) == (0, False)
    np.testing.assert_allclose(now.probabilities, 1 / 3)
    now = tracker.update(None)
    assert not np.isnan(now.covariance).any()


@pytest.mark.parametrize("name", ["R 0.1", "car", "ship", "aircraft"])
def test_a_track_soon_is_as_good_as_one_that_begins_with_the_estimate_of_the_environment(name):
    # The statements of both agree at nine of ten ticks after a while, in 12 episodes.
    options = QuickestOptions(start="random", ticks=120, **COMMON[name])
    agree = []
    for seed in range(12):
        env = HybridTrackQuickestVectorEnv(
            1,
            tick_info=True,
            **vars(options),
        )
        rows, info = env.reset(seed=seed)
        tracker = OnlineTracker(options, ThresholdDecider())
        decider = ThresholdDecider()
        for k in range(options.ticks):
            now = tracker.update(tuple(info["measurement"][0].tolist()))
            actions, _ = decider.predict(rows)
            if k >= 60:
                agree.append(now.mode == actions[0])
            rows, *_, info = env.step(actions)

    assert np.mean(agree) > 0.9
