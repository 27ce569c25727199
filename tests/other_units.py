"""Options of the same world in other units."""

from dataclasses import replace

import numpy as np


def in_other_units(options, length, time):
    """Return options with lengths and times in other units, of which one has so many new ones."""
    error, velocity_variance = options.initial_error
    return replace(
        options,
        radii=tuple(length * radius for radius in options.radii),
        speed=options.speed * length / time,
        tau=options.tau * time,
        process_variance=options.process_variance * (length / time) ** 2,
        measurement_variance=tuple(np.multiply(options.variances, length**2).tolist() * 2)[:2],
        initial_error=(error, velocity_variance * (length / time) ** 2),
    )
