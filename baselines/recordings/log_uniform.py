"""Random numbers that are uniform in their logarithm."""

from typing import Any

import numpy as np
from numpy.random import Generator


def log_uniform(generator: Generator, low: float, high: float, count: int | None = None) -> Any:
    """Return a number, or (count,) numbers, between two positive bounds."""
    return np.exp(generator.uniform(np.log(low), np.log(high), count))
