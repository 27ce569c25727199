"""Radars: conversion and fusion; the consistency of filters: `test_consistency`."""

import math

import numpy as np

from hybrid_env import Radar, Sensor
from hybrid_env.core.polar import position_noise, to_position
from hybrid_env.sensors import fuse


def test_the_covariance_is_that_of_the_true_position_given_the_measurement():
    generator = np.random.default_rng(0)
    distance = 100.0
    of_range = 3.0
    of_bearing = 0.3
    x, y, *noise = to_position(distance, 0.6, 0.8, of_range, of_bearing)
    bearing = math.atan2(0.8, 0.6) + of_bearing * generator.normal(size=10**6)
    length = distance + of_range * generator.normal(size=10**6)
    converted = np.array([length * np.cos(bearing), length * np.sin(bearing)])

    np.testing.assert_allclose(converted.mean(1), [x, y], atol=0.15)
    np.testing.assert_allclose(np.cov(converted)[np.triu_indices(2)], noise, rtol=0.01)
    np.testing.assert_allclose(position_noise(x, y, of_range, of_bearing), noise, rtol=1e-12)


def test_measurements_of_a_tick_are_fused_by_their_information():
    radar = Radar(
        range_deviation=2.0, bearing_deviation=0.02, rate_deviation=0.5, position=(10.0, -5.0)
    )
    sensors = [Sensor(variance=3.0), radar]
    values = {0: (60.0, 30.0), 1: (61.0, 0.7, -3.0)}
    fused = fuse(sensors, values)
    parts = [sensors[k].located(np.array(measured)) for k, measured in values.items()]
    weights = [np.linalg.inv(np.array([[xx, xy], [xy, yy]])) for *_, xx, xy, yy in parts]
    covariance = np.linalg.inv(sum(weights))
    mean = covariance @ sum(w @ part[:2] for w, part in zip(weights, parts, strict=True))

    np.testing.assert_allclose(fused.position, mean)
    np.testing.assert_allclose(fused.covariance, covariance[np.triu_indices(2)])
    assert fused.rates == (-3.0,)
    assert math.isnan(fuse(sensors, {0: (60.0, 30.0)}).rates[0])
