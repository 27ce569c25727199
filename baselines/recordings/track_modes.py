"""The modes of a recording: their names, and the same in other units."""

from collections.abc import Sequence

import numpy as np

from hybrid_env.modes import (
    Accelerate,
    LinearMode,
    Mode,
    Stop,
    Stopping,
    Straight,
    Turn,
    radii_of_modes,
)


def in_units(mode: Mode, length: float, velocity: float, tau: float, speed: float) -> Mode:
    """Return a mode of ticks of length tau for positions times `length` and velocities times
    `velocity`.

    A stop forgets the velocity, which that of an environment keeps: an object of a recording may
    leave in any direction, which a filter with the velocity of before follows late. The deviation
    of each velocity is the usual speed. While the object stands, its position may drift by 3 % of a
    usual step in a tick.
    """
    rate = velocity / length
    if isinstance(mode, Straight):
        return mode
    if mode.signed_radius:
        return Turn(length * mode.signed_radius)
    if mode.starting_acceleration:
        return Accelerate(velocity * rate * mode.starting_acceleration)
    if isinstance(mode, Stopping):
        return Stopping(mode.time / rate)
    F, B, Q = mode.matrices(tau)
    if isinstance(mode, Stop):
        F = np.diag([1.0, 0.0] * 2)
        Q = np.diag([0.03 * tau * speed, speed] * 2) ** 2
    units = np.tile([length, velocity, velocity * rate][: len(F) // 2], 2)
    noise = None if Q is None else Q * np.outer(units, units)
    return LinearMode(F * np.divide.outer(units, units), B * units, noise, mode.name)


def letter(mode: Mode) -> str:
    """Return S, L or R, or the label of a mode of another kind."""
    return mode.label[0] if mode.signed_radius else mode.label


def names_of_modes(modes: Sequence[Mode]) -> list[str]:
    """Return the names of modes: S, L and R, with the radius if there are several, or of modes of
    other kinds that of `Mode.name`.
    """
    several = len(radii_of_modes(modes)) > 1
    return [
        letter(mode) + (f" {abs(mode.signed_radius):.4g}" if several and mode.signed_radius else "")
        for mode in modes
    ]
