"""The row that a policy reads: its layout by name, and the kernel's writer.

One flat float32 row holds six blocks of M numbers, one per hypothesis, then ten numbers of the track.
`Layout` finds every quantity by name and undoes the scaling.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hybrid_env import bank
from hybrid_env.checks import reject

LOG_FLOOR = -30.0  # log-likelihood ratios and log-probabilities are clipped here
NEGLIGIBLE = -40.0  # exp of less changes no clipped log-probability

# scales that bring the usual values to the order of one
LOG_SCALE = 0.1
TICK_SCALE = 0.01
LENGTH_SCALE = 0.1

HYPOTHESIS_FEATURES = {
    "log_ratio": LOG_SCALE,
    "innovation_along": 1.0,
    "innovation_across": 1.0,
    "log_variance": 1.0,
    "previous": 1.0,
    "curvature": 1.0,
}
"""Blocks of M numbers in this order, each with the scale that it is multiplied by in the row."""

TRACK_FEATURES = {
    "ticks": TICK_SCALE,
    "ticks_left": TICK_SCALE,
    "log_doubt": LOG_SCALE,
    "speed": 1.0,
    "displacement_along": LENGTH_SCALE,
    "displacement_across": LENGTH_SCALE,
    "anchor_xx": 1.0,
    "anchor_xv": 1.0,
    "anchor_vv": 1.0,
    "log_noise": 1.0,
}
"""Single numbers behind the blocks, each with its scale."""


class Layout:
    """Where each quantity stands in an observation of a bank with M hypotheses.

    >>> layout = Layout(3)
    >>> layout.width
    28
    >>> layout.read(np.zeros((5, 28), np.float32), "log_ratio").shape
    (5, 3)
    """

    def __init__(self, hypotheses: int):
        if hypotheses < 3 or hypotheses % 2 == 0:
            raise reject("hypotheses", hypotheses, "an odd number >= 3")
        self.hypotheses = hypotheses
        self.slices: dict[str, slice] = {}
        self.scales = HYPOTHESIS_FEATURES | TRACK_FEATURES
        start = 0
        for name in self.scales:
            size = hypotheses if name in HYPOTHESIS_FEATURES else 1
            self.slices[name] = slice(start, start + size)
            start += size
        self.width = start

    @classmethod
    def of_width(cls, width: int) -> "Layout":
        """The layout of observations of a given width."""
        hypotheses, rest = divmod(width - len(TRACK_FEATURES), len(HYPOTHESIS_FEATURES))
        if rest or hypotheses < 3 or hypotheses % 2 == 0:
            raise reject("width", width, "6 M + 10 for M = 3, 5, 7, ... hypotheses")
        return cls(hypotheses)

    @classmethod
    def of_rows(cls, observation: NDArray[Any]) -> "Layout":
        """The layout of a batch of rows, (N, width); a single row is refused."""
        if observation.ndim != 2:
            raise reject("observation shape", observation.shape, "(N, width), one row a track")
        return cls.of_width(observation.shape[1])

    def read(self, observation: NDArray[Any], name: str) -> NDArray[np.float64]:
        """A quantity in its own unit, (..., M) per hypothesis or (...) per track.

        Args:
            observation: (..., width).
            name: a key of `HYPOTHESIS_FEATURES` or `TRACK_FEATURES`.
        """
        if name not in self.slices:
            raise reject("name", name, "one of " + ", ".join(self.slices))
        values = np.asarray(observation)[..., self.slices[name]].astype(np.float64) / self.scales[name]
        return values if name in HYPOTHESIS_FEATURES else values[..., 0]


@njit(cache=True)
def write_segment(
    row: NDArray[np.float32],
    track: Any,
    radii: NDArray[np.float64],
    variances: NDArray[np.float64],
) -> None:
    """Fill what stays the same over a segment. row: (6 M + 10,); track: one record of `track.TRACK`."""
    n = radii.size
    M = 2 * n + 1
    y_axis = variances.size - 1
    for h in range(M):
        row[4 * M + h] = 1.0 if h == track.active_mode else 0.0
    row[5 * M] = 0.0
    for c in range(n):
        row[5 * M + 1 + c] = 1.0 / radii[c]
        row[5 * M + 1 + n + c] = -1.0 / radii[c]
    base = 6 * M
    row[base + 3] = track.speed
    for k in range(3):
        row[base + 6 + k] = 0.5 * (
            track.kept_covariance[0, k] / variances[0] + track.kept_covariance[y_axis, k] / variances[y_axis]
        )
    row[base + 9] = 0.5 * (math.log(variances[0]) + math.log(variances[y_axis]))


@njit(cache=True)
def write_tick(
    row: NDArray[np.float32],
    filters: NDArray[np.float64],
    gains: NDArray[np.float64],
    track: Any,
    log_noise: float,
    noise_whitener: float,
) -> None:
    """Fill what changes with every tick.

    Args:
        row: (6 M + 10,), in which `write_segment` has filled the rest.
        track: one record of `track.TRACK`.
        log_noise: ln R, of the geometric mean of the two variances.
        noise_whitener: 1 / sqrt(R) [1/m].
    """
    M = filters.shape[1]
    n = M // 2
    y_axis = gains.shape[0] - 1
    best = bank.likeliest(filters)
    top = filters[bank.LOG_LIKELIHOOD, best]
    others = 0.0
    for h in range(M):
        ratio = filters[bank.LOG_LIKELIHOOD, h] - top
        row[h] = LOG_SCALE * max(ratio, LOG_FLOOR)
        if h != best and ratio > NEGLIGIBLE:
            others += math.exp(ratio)

    along_x, along_y = track.heading[0], track.heading[1]
    for h in range(M):
        white_x, white_y = filters[bank.WHITE_X, h], filters[bank.WHITE_Y, h]
        row[M + h] = along_x * white_x + along_y * white_y
        row[2 * M + h] = along_x * white_y - along_y * white_x
    for c in range(n + 1):
        log_variance = 0.5 * (gains[0, bank.LOG_VARIANCE, c] + gains[y_axis, bank.LOG_VARIANCE, c])
        row[3 * M + c] = log_variance - log_noise
        if c > 0:
            row[3 * M + n + c] = log_variance - log_noise

    shift_x = (track.measurement[0] - track.anchor[0]) * noise_whitener
    shift_y = (track.measurement[1] - track.anchor[2]) * noise_whitener
    base = 6 * M
    row[base] = TICK_SCALE * track.tick
    row[base + 1] = TICK_SCALE * (track.length - track.tick)
    row[base + 2] = LOG_SCALE * (
        max(math.log(others / (1.0 + others)), LOG_FLOOR) if others > 0.0 else LOG_FLOOR
    )
    row[base + 4] = LENGTH_SCALE * (along_x * shift_x + along_y * shift_y)
    row[base + 5] = LENGTH_SCALE * (along_x * shift_y - along_y * shift_x)
