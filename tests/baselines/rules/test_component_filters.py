"""Robust filters equal extended Kalman filters in matrix form that take the same measurements as
outliers.
"""

import copy

import numpy as np
import pytest
from matrix_filters import MatrixExtendedKalmanFilter
from scipy.special import log_softmax, logsumexp

from baselines.rules.component_filters import LAWS, ComponentFilters, anchor_rows, stated_covariance
from baselines.rules.measurements import observe_sensed, split_sensed
from hybrid_env import ArgumentError, HybridTrackVectorEnv, Layout, Radar, Sensor

TRACKS, TICKS = 9, 30
SPOILED = {
    4: (6.0, -3.0),
    5: (-40.0, 9.0),
    20: (0.0, 14.0),
}
"""Tick and displacement of the outliers, in standard deviations of a measurement."""


def recorded(options):
    """Return world, layout and rows (TICKS, TRACKS, width), with outliers in every second track."""
    env = HybridTrackVectorEnv(
        TRACKS,
        radii=(3.0, 8.0),
        scheme="random 1x50-60",
        **options,
    )
    rows = [env.reset(seed=3)[0].copy()]
    while len(rows) < TICKS:
        rows.append(env.step(np.zeros(TRACKS, np.int64))[0].copy())
    layout = Layout(env.options.hypotheses)
    for tick, shift in SPOILED.items():
        for name, deviations in zip(
            ("displacement_along", "displacement_across"),
            shift,
            strict=True,
        ):
            rows[tick][::2, layout.slices[name]] += deviations * layout.scales[name]
    return env.options, layout, rows


def reference(world, layout, rows, R, robust, law):
    """Return the log-likelihoods (TICKS, M) of one track, and how many measurements were
    outliers.
    """
    R, outlier_R = (np.multiply(factor, R) for factor in (law.variance, law.outlier_variance))
    covariance = stated_covariance(layout, rows[0][None])[0]
    anchor = (0.0, float(layout.read(rows[0][None], "speed")[0]), 0.0, 0.0)
    signed = [0.0, *world.radii, *(-radius for radius in world.radii)]
    filters = [
        MatrixExtendedKalmanFilter(
            anchor,
            covariance,
            radius,
            world.tau,
            world.process_variance,
            R,
        )
        for radius in signed
    ]
    log_likelihoods = []
    outliers = 0
    penalty = 0.0
    deviation = np.exp(0.5 * layout.read(rows[0][None], "log_noise")[0])
    for row in rows:
        names = "displacement_along", "displacement_across"
        z = deviation * np.array([float(layout.read(row[None], name)[0]) for name in names])
        innovations = [layout.read(row, f"innovation_{axis}") for axis in ("along", "across")]
        # The tick has no measurement.
        if not np.any(innovations):
            for kalman in filters:
                kalman.step(None)
            log_likelihoods.append([kalman.log_likelihood + penalty for kalman in filters])
            continue
        tried = copy.deepcopy(filters)
        distances = []
        for kalman in tried:
            kalman.step(z)
            distances.append(kalman.distance)
        if robust and min(distances) >= law.distance:
            outliers, penalty = outliers + 1, penalty + law.log_outlier_odds
            for kalman in filters:
                kalman.R = outlier_R
                kalman.step(z)
                kalman.R = R
        else:
            filters = tried
        log_likelihoods.append([kalman.log_likelihood + penalty for kalman in filters])
    return np.array(log_likelihoods), outliers


@pytest.mark.parametrize(
    ("variance", "robust", "missed"),
    [(0.1, False, 0.3), (0.1, True, 0.0), ((0.02, 0.4), True, 0.3)],
)
def test_filters_equal_matrix_filters(variance, robust, missed):
    world, layout, rows = recorded({"measurement_variance": variance, "missed": missed})
    filters = ComponentFilters("anchor_aware", 1, TRACKS, world, robust)
    anchors = anchor_rows(
        layout,
        rows[0],
        0.0,
        stated_covariance(layout, rows[0]),
    )[None]
    log_likelihoods = []
    none = np.zeros(TRACKS, np.bool_)
    alone = np.zeros((TRACKS, 1))
    for tick, row in enumerate(rows):
        filters.advance(
            row,
            np.full(TRACKS, tick == 0),
            anchors,
            alone,
            none,
        )
        log_likelihoods.append(filters.log_likelihood[0].copy())
    # The next segment.
    filters.advance(rows[0], ~none, anchors, alone, none)
    x, y = np.broadcast_to(variance, 2)
    axes = [(np.sqrt(x * y),) * 2]
    if robust and x != y:
        axes = [
            (x, y),
            (y, x),
            ((x + y) / 2, (x + y) / 2),
        ]
    total = 0
    for track in range(4):
        of_track = [row[track] for row in rows]
        by_law = []
        counts = []
        for law in LAWS if robust else LAWS[:1]:
            each = [
                reference(
                    world,
                    layout,
                    of_track,
                    R,
                    robust,
                    law,
                )
                for R in axes
            ]
            by_law.append(
                law.log_prior
                + logsumexp([values for values, _ in each], axis=0)
                - np.log(len(axes))
            )
            counts += [count for _, count in each]
        expected = logsumexp(by_law, axis=0)
        laws = logsumexp([values[-1] for values in by_law], axis=-1)
        np.testing.assert_allclose(
            filters.log_laws[:, track],
            log_softmax(laws),
            rtol=2e-3,
            atol=2e-3,
        )
        mine = np.array(log_likelihoods)[:, track]
        np.testing.assert_allclose(
            mine - mine[:, :1],
            expected - expected[:, :1],
            rtol=2e-3,
            atol=2e-3,
            err_msg=str(track),
        )
        total += min(counts)

    assert (total > 0) == robust


SENSORS = (
    Radar(
        range_deviation=0.2,
        bearing_deviation=0.02,
        rate_deviation=0.2,
        position=(30.0, 5.0),
    ),
    Sensor(variance=0.3, period=3),
)


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_with_sensors_the_filters_equal_the_bank(bank):
    env = HybridTrackVectorEnv(
        TRACKS,
        radii=(3.0, 8.0),
        scheme="random 1x50-60",
        sensors=SENSORS,
        bank=bank,
        missed=0.2,
        reset_covariance=False,
    )
    env.reset(seed=3)
    filters = ComponentFilters(bank, 1, TRACKS, env.options)
    layout, none, alone = env.world.layout, np.zeros(TRACKS, np.bool_), np.zeros((TRACKS, 1))
    for tick in range(TICKS):
        rows, sensed = split_sensed(layout, observe_sensed(env.world))
        anchors = anchor_rows(
            layout,
            rows,
            0.0,
            stated_covariance(layout, rows),
        )[None]
        filters.advance(
            rows,
            np.full(TRACKS, tick == 0),
            anchors,
            alone,
            none,
            sensed,
        )
        expected = env.world.hypothesis_values()
        log_likelihood = filters.log_likelihood[0]
        np.testing.assert_allclose(
            log_likelihood - log_likelihood[:, :1],
            expected - expected[:, :1],
            rtol=2e-3,
            atol=2e-3,
        )
        of_environment = np.stack(
            [layout.read(rows, f"innovation_{axis}") for axis in ("along", "across")],
            axis=-1,
        )
        np.testing.assert_allclose(
            filters.innovations[0, ..., :2],
            of_environment,
            rtol=2e-3,
            atol=2e-3,
        )
        env.step(np.zeros(TRACKS, np.int64))
    with pytest.raises(ArgumentError, match="with sensors"):
        filters.advance(rows, none, anchors, alone, none)
