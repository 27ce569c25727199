"""Live tracks under attack: an update is refused in one line or finite, and the track is found
again.
"""

import copy
import functools

import numpy as np
import pytest
from hostile_input import VALUES, accepted, counts
from online_episodes import COMMON

from baselines import (
    BeamDecider,
    CusumDecider,
    MSPRTDecider,
    OnlineTracker,
    SPRTDecider,
    ThresholdDecider,
)
from hybrid_env import QuickestOptions, WorldOptions
from hybrid_env.sensors import Fused

DISTURBED, STEADY = 40, 50
# Once without an estimate after a new start, or never found again.
FOUND = 263, 515, 3146
DECIDERS = {
    "threshold": lambda options: ThresholdDecider(0.6),
    "cusum": lambda options: CusumDecider(3.0),
    "beam": lambda options: BeamDecider(options, branches=5),
    "msprt": lambda options: MSPRTDecider(0.02),
    "ate": lambda options: SPRTDecider(0.05),
}
KINDS = ["errors", "place", "jump", "zero", "missing", "gap", "value", "sensor", "copy", "time"]


def sensor_value(generator):
    """Return what a caller may take for the measurement of sensors, with any values."""
    anything = [*VALUES, np.nan, -1.0, 0.0, 1e30, (1.0, 2.0), (1.0, 0.0, 1.0), (1.0, 2.0, 1.0)]
    one, two, three = (anything[k] for k in generator.integers(len(anything), size=3))
    return (
        {0: one}
        if generator.random() < 0.3
        else Fused((one, 1.0) if generator.random() < 0.5 else two, two, three)
    )


@functools.cache
def tracker_of(decider, world):
    options = (WorldOptions if decider in ("msprt", "ate") else QuickestOptions)(**COMMON[world])
    tracker = OnlineTracker(options, DECIDERS[decider](options))
    # Compiles, which takes longer than an update may.
    for k in range(20):
        tracker.update((k * options.speed * options.tau, 0.0))
    return tracker


def attack_live(seed):
    """Follow an object through errors of every kind and 50 good ticks."""
    generator = np.random.default_rng(seed)
    tracker = tracker_of(generator.choice(list(DECIDERS)), generator.choice(list(COMMON)))
    options, announced = tracker.options, tracker.world.announced
    deviation, tau, radii = np.sqrt(max(options.variances)), options.tau, options.radii
    tracker.begin()
    position = generator.normal(0.0, 1e3 * deviation, 2)
    heading = generator.uniform(-np.pi, np.pi)
    turn = 0.0
    left = 0
    kind = ""
    clock = 1e6 * generator.random()
    by_time = generator.random() < 0.5
    measured = False
    for k in range(DISTURBED + STEADY):
        if k == DISTURBED or (k < DISTURBED and generator.random() < 0.03):
            side = generator.choice([0.0, 1.0, -1.0]) if k < DISTURBED else 0.0
            turn = side * options.speed * tau / generator.choice(radii) if k < DISTURBED else 0.0
            if announced:
                tracker.switch()
        heading += turn
        position += options.speed * tau * np.array([np.cos(heading), np.sin(heading)])
        clock += tau
        if k == DISTURBED:
            kind = ""
        elif k < DISTURBED and left == 0:
            kind = generator.choice(KINDS) if k and generator.random() < 0.1 else ""
            left = generator.integers(1, 11)
            size = deviation * 10.0 ** generator.uniform(0.0, 9.0)
            place = generator.normal(0.0, size, 2)
            position += place * (kind == "jump")
        left = max(left - 1, 0)
        point = position + np.sqrt(options.variances) * generator.normal(size=2)
        if kind == "errors":
            point = point + generator.normal(0.0, size, 2)
        elif kind in ("place", "zero"):
            point = place * (kind == "place")
        given = tuple(point.tolist())
        time = clock if by_time else None
        if kind == "missing":
            given = None
        elif kind == "gap":
            continue
        elif kind == "value":
            near = generator.random() < 0.5
            given = (
                tuple(10.0 ** generator.uniform(-300, 31, 2))
                if near
                else VALUES[generator.integers(len(VALUES))]
            )
        elif kind == "sensor":
            given = sensor_value(generator)
        elif kind == "copy":
            accepted(functools.partial(copy.copy(tracker).update, (1e3, -1e3), time))
        elif kind == "time":
            time = generator.choice(
                [clock - 3.0 * tau, clock + 0.4 * tau, clock * 1e9, np.nan, np.inf]
            )
        found = accepted(functools.partial(tracker.update, given, time))
        if found is None:
            assert kind in ("value", "sensor", "time"), (seed, k, kind)
            continue
        measured |= given is not None
        assert np.isfinite(found.estimate).all() or not measured, (seed, k, kind)
        assert abs(found.probabilities.sum() - 1.0) < 1e-6, (seed, k, kind)
        assert (found.covariance.diagonal() >= 0.0).all(), (seed, k, kind)
    # A wrong declaration may lead such a track astray, without any error.
    if announced:
        return
    assert found.agrees, seed
    error = np.hypot(*(found.estimate[::2] - position)) / deviation
    assert error < 5.0, (seed, error)


@pytest.mark.parametrize("cases", counts(100, 10_000))
def test_a_live_track_is_found_again(cases):
    for seed in (*FOUND, *range(cases)):
        attack_live(seed)
