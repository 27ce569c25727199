"""What every filter of the bank did at the present tick, in the axes of the plane, for `info`."""

import math
from typing import Any

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import estimate_of, filter_model
from hybrid_env.core.compilation import internal
from hybrid_env.core.records import BANK_COLUMNS, LANES

ESTIMATES = BANK_COLUMNS["innovations"] + BANK_COLUMNS["innovation_covariances"]
COVARIANCES = ESTIMATES + BANK_COLUMNS["estimates"]


@internal
def write_innovations(
    bank_ticks: FloatArray, b: int, block: Any, first: int, last: int, bank: Any, setting: Any
) -> None:
    """Write the innovations of lanes first .. last - 1 of block b and their covariances, before the filters step.

    Without a measurement the innovation is NaN, and its covariance is that for a position of variance R.
    """
    model = filter_model(setting, 1.0)
    for lane in range(first, last):
        missing = math.isnan(block.measurement[0, lane])
        noise_xx, noise_xy, noise_yy = model.variance_x, 0.0, model.variance_y
        if setting.irregular and not missing:
            # of fused sensors, which have one R
            noise_xx *= block.noise[0, lane]
            noise_xy = model.variance_x * block.noise[1, lane]
            noise_yy *= block.noise[2, lane]
        for h in range(bank.hypotheses.size):
            row = bank_ticks[b * LANES + lane, h]
            x, y, xx, xy, yy = operations.predicted_position(bank, h, lane, model)
            row[0] = block.measurement[0, lane] - x
            row[1] = block.measurement[1, lane] - y
            row[2], row[3], row[4] = xx + noise_xx, xy + noise_xy, yy + noise_yy


@internal
def write_corrected(bank_ticks: FloatArray, b: int, first: int, last: int, bank: Any) -> None:
    """Write estimates and covariances of lanes first .. last - 1 of block b, after the filters have stepped."""
    for lane in range(first, last):
        for h in range(bank.hypotheses.size):
            row = bank_ticks[b * LANES + lane, h]
            for k, value in enumerate(estimate_of(bank.hypotheses, h, lane)):
                row[ESTIMATES + k] = value
            for k, value in enumerate(operations.covariance(bank, h, lane)):
                row[COVARIANCES + k] = value
