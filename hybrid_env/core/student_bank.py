"""The published bank with a robust likelihood: the innovations have a Student t distribution.

The log-likelihood of a tick is that of the bivariate Student t density whose scale matrix is the innovation
variance, and the correction of the estimate is weighted by `kalman.student_weight`, as in Agamennoni, Nieto &
Nebot 2012, "Approximate inference in state-space models with heavy-tailed noise", with one iteration. A
measurement far from the prediction therefore changes neither much.

An approximation: the covariances are those of the Kalman filter. The left and the right turn of a radius
share them as in `published_bank`, and they do not grow after an outlier.
"""

from typing import Any, NamedTuple

from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.kalman import student_log_likelihood, student_weight
from hybrid_env.core.published_bank import (
    FloatArray,
    correct_estimate,
    predict_estimate,
    published_banks,
    radius_column,
    step_covariances,
)


class StudentBank(NamedTuple):
    """The bank of a block of tracks, with the arrays of `published_bank.PublishedBank`."""

    hypotheses: NDArray[Any]
    covariances: NDArray[Any]
    innovations: NDArray[Any]
    gains: NDArray[Any]


@inlined
def student_banks(setting: Any) -> StudentBank:
    """Return the banks of all blocks from the addresses in a record `records.PARAMETERS`."""
    banks = published_banks(setting)
    return StudentBank(banks.hypotheses, banks.covariances, banks.innovations, banks.gains)


@internal
def student_of_block(banks: StudentBank, block: int) -> StudentBank:
    """Return the bank of one block."""
    return StudentBank(banks.hypotheses[block], banks.covariances[block], banks.innovations, banks.gains)


@inlined
def _step_hypothesis(
    bank: StudentBank, h: int, first: int, last: int, measurement: FloatArray, freedom: float
) -> None:
    """Advance one filter and its log-likelihood, after `step_covariances`."""
    axes, columns = bank.covariances.shape
    kalman, innovation = bank.hypotheses[h], bank.innovations[h]
    column = radius_column(h, columns - 1)
    shared = bank.covariances[0, column]
    gain_x, gain_y = bank.gains[0, column], bank.gains[axes - 1, column]
    for lane in range(first, last):
        predicted = predict_estimate(kalman, shared, lane)
        innovation_x, innovation_y = measurement[0, lane] - predicted[0], measurement[1, lane] - predicted[2]
        white_x, white_y = innovation_x * gain_x.whitener[lane], innovation_y * gain_y.whitener[lane]
        weight = student_weight(white_x, white_y, freedom)
        correct_estimate(
            kalman, predicted, gain_x, gain_y, lane, weight * innovation_x, weight * innovation_y
        )
        log_variance = 0.5 * (gain_x.log_variance[lane] + gain_y.log_variance[lane])
        innovation.white_x[lane] = white_x
        innovation.white_y[lane] = white_y
        innovation.log_variance[lane] = log_variance
        kalman.log_likelihood[lane] += student_log_likelihood(white_x, white_y, log_variance, freedom)


@internal
def step_student(bank: StudentBank, first: int, last: int, measurement: FloatArray, model: Any) -> None:
    """Advance every filter and its log-likelihood by one tick; see `published_bank.step_published`.

    Args:
        bank, first, last, measurement: see there.
        model: a `FilterModel`, or a record with its fields; `freedom` is above 0.
    """
    step_covariances(bank, first, last, model)
    for h in range(bank.hypotheses.size):
        _step_hypothesis(bank, h, first, last, measurement, model.freedom)


@internal
def follow_student(
    bank: StudentBank, lane: int, hypothesis: int, measurement: FloatArray, model: Any
) -> None:
    """Advance the filter of one hypothesis of a lane by one tick, without its log-likelihood."""
    before = bank.hypotheses[hypothesis].log_likelihood[lane]
    step_covariances(bank, lane, lane + 1, model)
    _step_hypothesis(bank, hypothesis, lane, lane + 1, measurement, model.freedom)
    bank.hypotheses[hypothesis].log_likelihood[lane] = before
