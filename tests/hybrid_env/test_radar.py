"""Radars: conversion, consistency of the filters, fusion, and a radar that sees nothing."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_env import (
    ArgumentError,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    Radar,
    Sensor,
)
from hybrid_env.core.polar import position_noise, to_position
from hybrid_env.live import SQUARE
from hybrid_env.sensors import fuse

# Elements of the first four states in the triangle of seven.
OF_SEVEN = [0, 1, 2, 3, 7, 8, 9, 13, 14, 18]
# Speed, turn radius, distance, deviations of range, bearing and range rate, tick.
OBJECTS = {
    "walker": (1.4, 10.0, 30.0, 0.2, 0.01, 0.1, 1.0),
    "car": (20.0, 200.0, 300.0, 1.0, 0.01, 0.3, 1.0),
    "ship": (8.0, 500.0, 9260.0, 30.0, math.radians(1.0), 0.3, 10.0),
    "aircraft": (250.0, 5000.0, 50e3, 50.0, math.radians(0.2), 1.0, 1.0),
}


def world(name, doppler):
    """Return options of an object that a radar follows, and its radius."""
    speed, radius, distance, of_range, of_bearing, of_rate, tau = OBJECTS[name]
    radar = Radar(
        range_deviation=of_range,
        bearing_deviation=of_bearing,
        rate_deviation=of_rate if doppler else None,
        position=(distance, 0.3 * distance),
    )
    return radius, {
        "speed": speed,
        "tau": tau,
        "process_variance": (0.005 * speed) ** 2,
        "sensors": [radar],
        "measurement_variance": of_range**2,
        "initial_error": (1.0, (0.05 * speed) ** 2),
        "radii": (radius,),
    }


def inside(values, freedom, tracks):
    """Check that the mean of chi-square numbers of `tracks` independent tracks is inside its
    bounds.
    """
    low, high = stats.chi2.interval(0.9999, tracks * freedom) / np.array(tracks)
    assert low < values < high, (low, values, high)


@pytest.mark.parametrize(
    "doppler",
    [False, True],
    ids=["range and bearing", "range rate"],
)
@pytest.mark.parametrize("name", OBJECTS)
def test_the_filters_are_consistent_where_the_model_is_exact(name, doppler):
    radius, options = world(name, doppler)
    tracks = 500
    for bank, mode, kind in (
        ("published", "S40", 0),
        ("anchor_aware", f"L40r{radius:g}", 1),
    ):
        env = HybridTrackVectorEnv(
            tracks,
            tick_info=True,
            scheme=mode,
            bank=bank,
            reset_covariance=False,
            **options,
        )
        rows, info = env.reset(seed=4)
        for tick in range(40):
            filters = env.world.bank.hypotheses[:, kind]
            white = np.array(
                [env.world.layout.read(rows, f"innovation_{axis}") for axis in ("along", "across")]
            )
            if tick % 13 == 12:
                states = np.stack(
                    [filters[field] for field in ("x", "vx", "y", "vy")],
                    -1,
                ).reshape(
                    -1,
                    4,
                )
                P = (
                    filters["covariance"][:, OF_SEVEN]
                    .swapaxes(1, 2)
                    .reshape(-1, 10)[:tracks, SQUARE]
                )
                error = states[:tracks] - info["truth"]
                inside(
                    (error * np.linalg.solve(P, error[..., None])[..., 0]).sum(1).mean(),
                    4,
                    tracks,
                )
                inside((white[:, :, kind] ** 2).sum(0).mean(), 2, tracks)
            rows, *_, info = env.step(np.zeros(tracks, np.int64))


@pytest.mark.parametrize("make", [HybridTrackVectorEnv, HybridTrackQuickestVectorEnv])
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_a_radar_that_measures_nothing_changes_nothing(make, bank):
    # All ticks go the way of measurements of any covariance, and give the filters of position
    # sensors.
    options = {} if make is HybridTrackQuickestVectorEnv else {"bank": bank, "scheme": "L40r5 S40"}
    seeing = Sensor(variance=0.2)
    blind = Radar(range_deviation=1.0, bearing_deviation=0.1, range=1e-9)
    plain = make(
        9,
        sensors=[seeing, Sensor(variance=1.0, range=1e-9)],
        missed=0.3,
        **options,
    )
    polar = make(9, sensors=[seeing, blind], missed=0.3, **options)
    rows = plain.reset(seed=2)[0]
    others = polar.reset(seed=2)[0]
    for _ in range(60):
        np.testing.assert_allclose(rows, others, rtol=1e-4, atol=2e-4)
        actions = np.zeros(9, np.int64)
        rows = plain.step(actions)[0]
        others = polar.step(actions)[0]


def test_the_covariance_is_that_of_the_true_position_given_the_measurement():
    generator = np.random.default_rng(0)
    distance = 100.0
    of_range = 3.0
    of_bearing = 0.3
    x, y, *noise = to_position(distance, 0.6, 0.8, of_range, of_bearing)
    bearing = math.atan2(0.8, 0.6) + of_bearing * generator.normal(size=10**6)
    length = distance + of_range * generator.normal(size=10**6)
    converted = np.array([length * np.cos(bearing), length * np.sin(bearing)])

    np.testing.assert_allclose(
        converted.mean(1),
        [x, y],
        atol=0.15,
    )
    np.testing.assert_allclose(
        np.cov(converted)[np.triu_indices(2)],
        noise,
        rtol=0.01,
    )
    np.testing.assert_allclose(
        position_noise(x, y, of_range, of_bearing),
        noise,
        rtol=1e-12,
    )


def test_measurements_of_a_tick_are_fused_by_their_information():
    radar = Radar(
        range_deviation=2.0,
        bearing_deviation=0.02,
        rate_deviation=0.5,
        position=(10.0, -5.0),
    )
    sensors = [Sensor(variance=3.0), radar, Radar(range_deviation=1.0, bearing_deviation=0.1)]
    values = {0: (60.0, 30.0), 1: (61.0, 0.7, -3.0)}
    fused = fuse(sensors, values)
    parts = [sensors[k].located(np.array(measured)) for k, measured in values.items()]
    weights = [np.linalg.inv(np.array([[xx, xy], [xy, yy]])) for *_, xx, xy, yy in parts]
    covariance = np.linalg.inv(sum(weights))
    mean = covariance @ sum(
        w @ part[:2]
        for w, part in zip(
            weights,
            parts,
            strict=True,
        )
    )

    np.testing.assert_allclose(fused.position, mean)
    np.testing.assert_allclose(fused.covariance, covariance[np.triu_indices(2)])
    assert fused.rates == (-3.0,)
    assert math.isnan(fuse(sensors, {0: (60.0, 30.0)}).rates[0])
    for wrong in (
        {},
        {3: (1.0, 2.0)},
        {1: (1.0, 2.0)},
        {0: (np.nan, 1.0)},
        {0: "ab"},
    ):
        with pytest.raises(ArgumentError, match="measurement"):
            fuse(sensors, wrong)
