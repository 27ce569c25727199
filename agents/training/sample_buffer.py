"""A buffer of the last samples, for training on random ones."""

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from hybrid_env.checks import check_integer


class SampleBuffer:
    """Ring buffer of samples.

    Args:
        size: number of samples that are kept.
        width: numbers of a sample.

    Attributes:
        rows: (size, width) float32.
        count: number of samples added so far.
    """

    def __init__(self, size: int, width: int):
        self.rows = np.zeros((size, width), np.float32)
        self.count = 0

    def add(self, samples: NDArray[np.floating]) -> None:
        """Add samples (n, width) in place of the oldest ones."""
        samples = samples[-len(self.rows) :]
        self.rows[(self.count + np.arange(len(samples))) % len(self.rows)] = samples
        self.count += len(samples)

    def draw(self, generator: Generator, size: int) -> NDArray[np.float32]:
        """Return random samples (size, width), with replacement."""
        filled = min(self.count, len(self.rows))
        return self.rows[generator.integers(filled, size=size)]

    def restore_count(self, count: object) -> None:
        """Set the number of samples added so far."""
        self.count = check_integer("count", count, minimum=0)
