"""Options of the same world in other units."""

from dataclasses import replace

import numpy as np

from hybrid_env.modes import Climb, Turn


def scaled(mode, length, time):
    """Return straight motion, a turn of a radius or a climb in other units."""
    if isinstance(mode, Climb):
        return Climb(mode.rate * length / time, scaled(mode.planar, length, time))
    return Turn(length * mode.radius) if isinstance(mode, Turn) else mode


def in_other_units(options, length, time):
    """Return options with lengths and times in other units, of which one has so many new ones."""
    error, velocity_variance = options.initial_error
    modes = options.all_modes if options.climbs else ()
    return replace(
        options,
        modes=tuple(scaled(mode, length, time) for mode in modes) or options.modes,
        climb_variance=options.climb_variance * (length / time) ** 2,
        height_variance=options.height_variance * length**2,
        radii=tuple(length * radius for radius in options.radii),
        speed=options.speed * length / time,
        tau=options.tau * time,
        process_variance=options.process_variance * (length / time) ** 2,
        measurement_variance=tuple(np.multiply(options.variances, length**2).tolist() * 2)[:2],
        initial_error=(error, velocity_variance * (length / time) ** 2),
    )
