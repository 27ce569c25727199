"""What every filter of the bank did at a tick, in the axes of the plane, for `info` and
`KalmanBank`. A row has the `BANK_COLUMNS` of one filter.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import estimate_of, filter_model
from hybrid_env.core.compilation import apart, stay_apart
from hybrid_env.core.memory import BANK_COLUMNS, LANES

ESTIMATES = BANK_COLUMNS["innovations"] + BANK_COLUMNS["innovation_covariances"]
COVARIANCES = ESTIMATES + BANK_COLUMNS["estimates"]


@apart
def write_innovations(
    bank_ticks: FloatArray, b: int, block: Any, first: int, last: int, bank: Any, setting: Any
) -> None:
    """Write the innovations of lanes first .. last - 1 of block b and their covariances, before
    the filters step.

    Without a measurement the innovation is NaN, and its covariance is that for a position of
    variance R.
    """
    stay_apart()
    model = filter_model(setting)
    for lane in range(first, last):
        missing = math.isnan(block.measurement[0, lane])
        noise_xx = model.variance_x
        noise_xy = 0.0
        noise_yy = model.variance_y
        if setting.irregular and not missing:
            # Of fused sensors, which have one R.
            noise_xx *= block.noise[0, lane]
            noise_xy = model.variance_x * block.noise[1, lane]
            noise_yy *= block.noise[2, lane]
        for h in range(bank.hypotheses.size):
            row = bank_ticks[b * LANES + lane, h]
            x, y, xx, xy, yy = operations.predicted_position(bank, h, lane, model)
            row[0] = block.measurement[0, lane] - x
            row[1] = block.measurement[1, lane] - y
            row[2], row[3], row[4] = xx + noise_xx, xy + noise_xy, yy + noise_yy


@apart
def write_corrected(bank_ticks: FloatArray, b: int, first: int, last: int, bank: Any) -> None:
    """Write estimates and covariances of lanes first .. last - 1 of block b, after the filters
    have stepped.
    """
    stay_apart()
    for lane in range(first, last):
        for h in range(bank.hypotheses.size):
            row = bank_ticks[b * LANES + lane, h]
            for k, value in enumerate(estimate_of(bank.hypotheses, h, lane)):
                row[ESTIMATES + k] = value
            for k, value in enumerate(operations.covariance(bank, h, lane)):
                row[COVARIANCES + k] = value


def read_bank_ticks(rows: FloatArray) -> dict[str, FloatArray]:
    """Return copies of the columns of rows, (..., M, columns), by their names in `info`: (..., M,
    2) innovations, (..., M, 2, 2) their covariances, (..., M, 4) estimates, (..., M, 4, 4)
    covariances.
    """
    ends = np.cumsum(list(BANK_COLUMNS.values()))
    parts = dict(zip(BANK_COLUMNS, np.split(rows, ends[:-1], axis=-1), strict=True))
    sizes = {"innovation_covariances": 2, "covariances": 4}
    return {
        name: full_matrices(part, sizes[name]) if name in sizes else part.copy()
        for name, part in parts.items()
    }


def full_matrices(triangles: FloatArray, size: int) -> FloatArray:
    """Return symmetric matrices (..., size, size) of their upper triangles row by row."""
    rows, columns = np.triu_indices(size)
    matrices = np.empty((*triangles.shape[:-1], size, size))
    matrices[..., rows, columns] = matrices[..., columns, rows] = triangles
    return matrices
