"""Robust filters equal extended Kalman filters in matrix form that take the same measurements as
outliers.
"""

import copy

import numpy as np
from matrix_filters import MatrixExtendedKalmanFilter
from scipy.special import log_softmax, logsumexp

from baselines.rules.component_filters import ASSUMED_LAWS, ComponentFilters, speeds, stated_anchors
from baselines.rules.measurements import in_rows
from hybrid_env import HybridTrackVectorEnv, Layout

TRACKS, TICKS = 9, 30
SPOILED = {4: (6.0, -3.0), 5: (-40.0, 9.0), 20: (0.0, 14.0)}
"""Tick and displacement of the outliers, in standard deviations of a measurement."""


def recorded(**options):
    """Return world and rows (TICKS, TRACKS, width), with outliers in every second track."""
    env = HybridTrackVectorEnv(TRACKS, radii=(3.0, 8.0), scheme="random 1x50-60", **options)
    rows = [env.reset(seed=3)[0].copy()]
    while len(rows) < TICKS:
        rows.append(env.step(np.zeros(TRACKS, np.int64))[0].copy())
    layout = Layout(env.options.hypotheses)
    for tick, shift in SPOILED.items():
        names = "displacement_along", "displacement_across"
        for name, deviations in zip(names, shift, strict=True):
            rows[tick][::2, layout.slices[name]] += deviations * layout.scales[name]
    return env.options, rows


def reference(world, speed, covariance, measurements, R, law):
    """Return the log-likelihoods (TICKS, M) of one track in the heading frame, and how many
    measurements were outliers.
    """
    R, outlier_R = (np.multiply(factor, R) for factor in (law.variance, law.outlier_variance))
    model = world.tau, world.process_variance, R
    filters = [
        MatrixExtendedKalmanFilter((0.0, speed, 0.0, 0.0), covariance, radius, *model)
        for radius in (0.0, *world.radii, *(-radius for radius in world.radii))
    ]
    log_likelihoods = []
    outliers = 0
    for z in measurements:
        tried = copy.deepcopy(filters)
        for kalman in tried:
            kalman.step(None if np.isnan(z[0]) else z)
        squares = [k.innovation @ np.linalg.solve(k.Sigma, k.innovation) for k in tried]
        outlier = not np.isnan(z[0]) and min(squares) >= law.distance
        if outlier:
            outliers += 1
            for kalman in filters:
                kalman.R = outlier_R
                kalman.step(z)
                kalman.R = R
        else:
            filters = tried
        penalty = outliers * law.log_outlier_odds
        log_likelihoods.append([kalman.log_likelihood + penalty for kalman in filters])
    return np.array(log_likelihoods), outliers


def test_robust_filters_equal_matrix_filters():
    x, y = 0.02, 0.4
    world, rows = recorded(measurement_variance=(x, y), missed=0.3)
    filters = ComponentFilters("anchor_aware", 1, TRACKS, world, robust=True)
    anchors = stated_anchors(world, rows[0])
    ours = []
    none = np.zeros(TRACKS, np.bool_)
    for tick, row in enumerate(rows):
        filters.advance(row, np.full(TRACKS, tick == 0), anchors, none)
        ours.append(filters.log_likelihood[0].copy())
    # The next segment.
    filters.advance(rows[0], ~none, anchors, none)
    axes = [(x, y), (y, x), ((x + y) / 2, (x + y) / 2)]
    measurements = np.array([in_rows(world, row) for row in rows])
    begun = speeds(world, rows[0])
    total = 0
    for track in range(4):
        of_track = world, begun[track], anchors.covariance[track, 0], measurements[:, track]
        by_law = []
        for law in ASSUMED_LAWS:
            each, outliers = zip(*(reference(*of_track, R, law) for R in axes), strict=True)
            by_law.append(law.log_prior + logsumexp(each, axis=0) - np.log(len(axes)))
            total += min(outliers)
        expected = logsumexp(by_law, axis=0)
        laws = log_softmax(logsumexp([values[-1] for values in by_law], axis=-1))
        np.testing.assert_allclose(filters.log_laws[:, track], laws, rtol=2e-3, atol=2e-3)
        mine = np.array(ours)[:, track]
        np.testing.assert_allclose(
            mine - mine[:, :1], expected - expected[:, :1], rtol=2e-3, atol=2e-3
        )

    assert total > 0
