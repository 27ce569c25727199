"""Rules that tell when a glider circles, and on which side: by turn rate, by angle, by filters.

A rule has several numbers, and a grid of settings from which a comparison selects on other flights.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd

from studies.flights.rules import Settings, TurnRule, begun
from studies.flights.turns import (
    LEFT,
    RIGHT,
    STRAIGHT,
    Batch,
    FloatArray,
    IntArray,
    TurnEstimates,
    TurnModel,
)

MODELS = tuple(
    TurnModel(
        # [deg/s]
        rates=(0.0, 10.0, 16.0, 24.0, -10.0, -16.0, -24.0),
        acceleration=acceleration,
        straight=straight,
        turn=turn,
        within=10.0,
    )
    for acceleration, straight, turn in ((3, 60, 45), (2, 60, 45), (3, 200, 45), (6, 200, 100))
)
"""Settings of the filters."""
CLIMBING = tuple(replace(model, climb=0.1, climb_level=0.3) for model in MODELS)
"""The same with the climb rate."""


def by_rate(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State by the rule of the glide computer XCSoar, by its facts: a turn rate that lasts.

    The turn rate of the ground track is limited to 50 deg/s and smoothed by a low-pass filter of
    factor 0.3. When it is at least the rate [deg/s] for longer than the time to enter [s], the
    glider circles; when it is below for longer than the time to leave [s], it does not.
    """
    bound, enter, leave = np.array(settings).T
    fastest = np.radians(50.0)
    stated = begun(batch, settings)
    smooth = np.zeros((stated.shape[1], 1))
    # Time since the rate contradicts the statement, else -1.
    waited = np.full(stated.shape[1:], -1.0)
    for tick, (dt, turned) in enumerate(ground_turns(batch)):
        rate = np.clip(turned / np.where(dt > 0.0, dt, 1.0), -fastest, fastest)
        smooth = np.where(dt > 0.0, smooth + 0.3 * (rate - smooth), smooth)
        turning = np.abs(smooth) >= np.radians(bound)
        circling = stated[tick - 1] != STRAIGHT
        longer = np.where(waited < 0.0, 0.0, waited + dt)
        waited = np.where(turning == circling, -1.0, longer)
        changes = waited > np.where(circling, leave, enter)
        side = np.where(smooth > 0.0, LEFT, RIGHT)
        kept = np.where(changes, STRAIGHT, stated[tick - 1])
        stated[tick] = np.where(turning & (circling | changes), side, kept)
        waited = np.where(changes, -1.0, waited)
    return stated


def by_angle(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State by the angle that the ground track has turned, forgotten in time, with hysteresis.

    A glider circles when the angle with the longer memory [s] reaches a threshold [deg], until that
    with a memory of 8 s falls below another.
    """
    memory, enter, leave = np.array(settings).T
    enter, leave = np.radians([enter, leave])
    stated = begun(batch, settings)
    angle = np.zeros(stated.shape[1:])
    recent = np.zeros((stated.shape[1], 1))
    for tick, (dt, turned) in enumerate(ground_turns(batch)):
        angle = angle * np.exp(-dt / memory) + turned
        recent = recent * np.exp(-dt / 8.0) + turned
        last = stated[tick - 1]
        going = (last != STRAIGHT) & (np.where(last == LEFT, recent, -recent) > leave)
        begins = (np.abs(angle) >= enter) & (np.abs(recent) > leave) & (angle * recent > 0.0)
        side = np.where(angle > 0.0, LEFT, RIGHT)
        stated[tick] = np.where(begins, side, np.where(going, last, STRAIGHT))
    return stated


def ground_turns(batch: Batch) -> FloatArray:
    """Return times since the last position [s], and angles by which the ground track turned at
    each position, anticlockwise [rad], (T, 2, B, 1).
    """
    x, y = np.moveaxis(np.diff(batch.positions, axis=0), -1, 0)
    # The track of an object that rests is the last one.
    angles = np.where(np.hypot(x, y) > 0.0, np.arctan2(y, x), np.nan)
    changes = pd.DataFrame(angles).ffill().diff()[1:].to_numpy()
    turned = np.zeros(batch.times.shape)
    turned[2:] = np.nan_to_num(np.remainder(changes + np.pi, 2.0 * np.pi) - np.pi)
    return np.stack([batch.steps, turned], axis=1)[..., None]


PROBABILITIES = tuple(
    product((0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99), (0.5, 0.7, 0.8, 0.9, 0.95, 0.98))
)
"""To enter a circle, and to leave it."""
RULES = {
    "imm": TurnRule(grid=PROBABILITIES, models=MODELS),
    # Circles drift.
    "imm-wind": TurnRule(
        grid=PROBABILITIES, models=tuple(replace(model, wind=0.01) for model in MODELS)
    ),
    # Gliders circle where the air rises.
    "imm-climb": TurnRule(grid=PROBABILITIES, models=CLIMBING),
    "imm-wind-climb": TurnRule(
        grid=PROBABILITIES, models=tuple(replace(model, wind=0.01) for model in CLIMBING)
    ),
    # The semi-Markov posterior, in which a circle lasts at least 15 s.
    "beam": TurnRule(
        grid=PROBABILITIES,
        models=tuple(
            replace(model, rates=(0.0, 6.0, 12.0, 20.0, -6.0, -12.0, -20.0))
            for model in MODELS[::2]
        ),
        beam={"shortest": (0.0, 15.0), "branches": 30},
    ),
    "xcsoar": TurnRule(
        state=by_rate,
        grid=tuple(
            product(
                (4.0, 5.0, 6.0, 7.0, 8.0, 10.0),
                (4.0, 6.0, 8.0, 10.0, 15.0),
                (0.0, 2.0, 4.0, 6.0, 8.0),
            )
        ),
    ),
    "xcsoar-default": TurnRule(state=by_rate, grid=((4.0, 15.0, 10.0),)),
    "angle": TurnRule(
        state=by_angle,
        grid=tuple(
            product((8.0, 12.0, 16.0), (90.0, 120.0, 150.0, 180.0), (20.0, 30.0, 45.0, 60.0))
        ),
    ),
}
"""Rules by name; the first is the reference."""
