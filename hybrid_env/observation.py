"""The row that a policy reads: its layout by name, and the kernel's writer.

One flat float32 row holds six blocks of M numbers, one per hypothesis, then ten numbers of the track.
`Layout` finds every quantity by name and undoes the scaling.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import reject
from hybrid_env.core.compilation import internal
from hybrid_env.core.elementary import exp, log
from hybrid_env.core.in_place import in_place
from hybrid_env.core.instructions import larger, smaller, span

LOG_FLOOR = -30.0  # log-likelihood ratios and log-probabilities are clipped here
LARGEST = 1e6  # innovations over their deviation are clipped here
NEGLIGIBLE = -100.0  # exp of less changes no clipped log-probability

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
    "log_error_probability": LOG_SCALE,
    "speed": 1.0,
    "displacement_along": LENGTH_SCALE,
    "displacement_across": LENGTH_SCALE,
    "anchor_xx": 1.0,
    "anchor_xv": 1.0,
    "anchor_vv": 1.0,
    "log_noise": 1.0,
}
"""Single numbers behind the blocks, each with its scale."""


BLOCKS, SINGLES = len(HYPOTHESIS_FEATURES), len(TRACK_FEATURES)


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
        hypotheses, rest = divmod(width - SINGLES, BLOCKS)
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


@internal
def row_width(hypotheses: int) -> int:
    """Numbers of a row."""
    return BLOCKS * hypotheses + SINGLES


@internal
def write_segment(
    row: NDArray[np.float32],
    block: Any,
    lane: int,
    radii: NDArray[np.float64],
    variance_x: float,
    variance_y: float,
    log_noise: float,
) -> None:
    """Fill what stays the same over a segment. row: (6 M + 10,); variances R of each axis [m^2]."""
    n = radii.size
    M = 2 * n + 1
    for h in span(0, M):
        row[4 * M + h] = 1.0 if h == block.active_mode[lane] else 0.0
    row[5 * M] = 0.0
    for c in span(0, n):
        row[5 * M + 1 + c] = 1.0 / radii[c]
        row[5 * M + 1 + n + c] = -1.0 / radii[c]
    base = 6 * M
    row[base + 3] = block.speed[lane]
    kept = block.kept_covariance
    row[base + 6] = larger(0.5 * (kept[0, lane] / variance_x + kept[7, lane] / variance_y), 0.0)
    row[base + 7] = 0.5 * (kept[1, lane] / variance_x + kept[8, lane] / variance_y)
    row[base + 8] = larger(0.5 * (kept[4, lane] / variance_x + kept[9, lane] / variance_y), 0.0)
    row[base + 9] = log_noise


@internal
def weigh(scratch: Any, hypotheses: NDArray[Any], first: int, last: int) -> None:
    """The largest log-likelihood, and the logarithm of the posterior that is not its hypothesis's."""
    for lane in span(first, last):
        scratch.top[lane] = in_place(hypotheses[0]).log_likelihood[lane]
        scratch.doubt[lane] = 0.0
        scratch.equals[lane] = -1.0  # the best itself
    for h in span(1, hypotheses.size):
        kalman = in_place(hypotheses[h])
        for lane in span(first, last):
            scratch.top[lane] = larger(scratch.top[lane], kalman.log_likelihood[lane])
    for h in span(0, hypotheses.size):
        kalman = in_place(hypotheses[h])
        for lane in span(first, last):
            ratio = kalman.log_likelihood[lane] - scratch.top[lane]
            below = ratio < 0.0  # the equals apart: beside a 1, the small ones would lose their digits
            scratch.doubt[lane] += exp(larger(ratio, NEGLIGIBLE)) if below else 0.0
            scratch.equals[lane] += 0.0 if below else 1.0
    for lane in span(first, last):
        others = scratch.doubt[lane] + scratch.equals[lane]
        scratch.doubt[lane] = larger(log(others / (1.0 + others)), LOG_FLOOR)


@internal
def write_tick(
    row: NDArray[np.float32],
    block: Any,
    lane: int,
    scratch: Any,
    bank: Any,
    log_noise: float,
    noise_whitener: float,
) -> None:
    """Fill what changes with every tick, after `weigh`.

    Args:
        row: (6 M + 10,), in which `write_segment` has filled the rest.
        log_noise: ln R, of the geometric mean of the two variances.
        noise_whitener: 1 / sqrt(R) [1/m].
    """
    M = bank.hypotheses.size
    along_x, along_y = block.heading[0, lane], block.heading[1, lane]
    top = scratch.top[lane]
    for h in span(0, M):
        kalman, innovation = in_place(bank.hypotheses[h]), in_place(bank.innovations[h])
        white_x = larger(smaller(innovation.white_x[lane], LARGEST), -LARGEST)
        white_y = larger(smaller(innovation.white_y[lane], LARGEST), -LARGEST)
        row[h] = LOG_SCALE * larger(kalman.log_likelihood[lane] - top, LOG_FLOOR)
        row[M + h] = along_x * white_x + along_y * white_y
        row[2 * M + h] = along_x * white_y - along_y * white_x
        row[3 * M + h] = larger(innovation.log_variance[lane] - log_noise, 0.0)  # less only by rounding
    shift_x = (block.measurement[0, lane] - block.anchor[0, lane]) * noise_whitener
    shift_y = (block.measurement[1, lane] - block.anchor[2, lane]) * noise_whitener
    base = 6 * M
    row[base] = TICK_SCALE * block.tick[lane]
    row[base + 1] = TICK_SCALE * (block.length[lane] - block.tick[lane])
    row[base + 2] = LOG_SCALE * scratch.doubt[lane]
    row[base + 4] = LENGTH_SCALE * (along_x * shift_x + along_y * shift_y)
    row[base + 5] = LENGTH_SCALE * (along_x * shift_y - along_y * shift_x)
