"""Ticks without a measurement, in which the filters of a bank only predict, or with one of another variance.

The innovations of such a tick are zero, and their variance is that of the measurement that is missing.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.anchor_aware_bank import LARGEST, AnchorAwareBank, predict_hypothesis
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.elementary import log
from hybrid_env.core.imm_bank import ImmBank, ImmModel, mix, predict, step_imm
from hybrid_env.core.imm_merging import merge, normalize
from hybrid_env.core.kalman import predict_covariance
from hybrid_env.core.published_bank import (
    PublishedBank,
    Triangle4,
    predict_estimate,
    radius_column,
    set_estimate,
    signed_radius,
)


@internal
def predict_published(bank: PublishedBank, lane: int, model: Any) -> None:
    """Advance every filter of a lane by one tick without a measurement: only the prediction of eq. (2).

    The innovations are zero. Their variance is that of the measurement that is missing.
    """
    axes, columns = bank.covariances.shape
    for axis in range(axes):
        variance = model.variance_x if axis == 0 else model.variance_y
        for column in range(columns):
            shared = bank.covariances[axis, column]
            xx, xv, vv = predict_covariance(
                (shared.xx[lane], shared.xv[lane], shared.vv[lane]),
                shared.cosine[lane], shared.sine_velocity[lane], shared.sine_position[lane],
                model.process_variance,
            )  # fmt: skip
            shared.xx[lane], shared.xv[lane], shared.vv[lane] = xx, xv, vv
            bank.gains[axis, column].log_variance[lane] = log(xx + variance)
    for h in range(bank.hypotheses.size):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        column = radius_column(h, columns - 1)
        x, vx, y, vy = predict_estimate(kalman, bank.covariances[0, column], lane)
        set_estimate(kalman, lane, (x, vx, y, vy))
        innovation.white_x[lane] = innovation.white_y[lane] = 0.0
        innovation.log_variance[lane] = 0.5 * (
            bank.gains[0, column].log_variance[lane] + bank.gains[axes - 1, column].log_variance[lane]
        )


@internal
def predict_aware(bank: AnchorAwareBank, lane: int, model: Any) -> None:
    """Advance every filter of a lane by one tick without a measurement; see `predict_published`."""
    for h in range(bank.hypotheses.size):
        kalman, innovation = bank.hypotheses[h], bank.innovations[h]
        x, u, y, v, predicted = predict_hypothesis(kalman, lane, model)
        # also False for NaN: a filter that diverges keeps its state
        valid = (predicted[0] + predicted[13] < LARGEST * LARGEST) & (
            predicted[7] + predicted[18] < LARGEST * LARGEST
        )
        if valid & (abs(u) + abs(v) < LARGEST):
            set_estimate(kalman, lane, (x, u, y, v))
            for k, value in enumerate(predicted):
                kalman.covariance[k, lane] = value
        sigma_x = max(predicted[0] if valid else 0.0, 0.0) + model.variance_x
        sigma_y = max(predicted[13] if valid else 0.0, 0.0) + model.variance_y
        innovation.white_x[lane] = innovation.white_y[lane] = 0.0
        innovation.log_variance[lane] = 0.5 * (log(sigma_x) + log(sigma_y))


@inlined
def _finite(covariance: Triangle4, u: float, v: float) -> bool:
    """Whether a predicted filter has not diverged; False for NaN."""
    return (
        (covariance[0] + covariance[7] < LARGEST * LARGEST)
        & (covariance[4] + covariance[9] < LARGEST * LARGEST)
        & (abs(u) + abs(v) < LARGEST)
    )


@internal
def _predict_imm_hypothesis(
    kalman: Any, innovation: Any, block: Any, lane: int, curvature: float, model: Any
) -> None:
    """Mix and predict one filter of a lane in a tick without a measurement."""
    prior, mean, mixed = mix(kalman, block, lane, model)
    moved, predicted = predict(mean, mixed, curvature, model)
    finite = _finite(predicted, moved[1], moved[3])
    set_estimate(kalman, lane, moved if finite else mean)
    for k, value in enumerate(predicted if finite else mixed):
        kalman.covariance[k, lane] = value
    sigma_x, sigma_y = (
        kalman.covariance[0, lane] + model.variance_x,
        kalman.covariance[7, lane] + model.variance_y,
    )
    innovation.white_x[lane] = innovation.white_y[lane] = 0.0
    innovation.log_variance[lane] = 0.5 * (log(sigma_x) + log(sigma_y))
    kalman.log_likelihood[lane] = 0.0
    kalman.log_probability[lane] = log(prior)


@internal
def predict_imm(bank: ImmBank, block: Any, lane: int, radii: NDArray[np.float64], model: Any) -> None:
    """Advance every filter of a lane by one tick without a measurement: mixing, prediction and output.

    The probabilities follow the Markov chain. The innovations are zero; their variance is that of the
    measurement that is missing. Arguments as in `step_imm`.
    """
    for h in range(bank.hypotheses.size):
        radius = signed_radius(h, radii)
        curvature = 0.0 if radius == 0.0 else 1.0 / radius
        _predict_imm_hypothesis(bank.hypotheses[h], bank.innovations[h], block, lane, curvature, model)
    normalize(bank, lane, lane + 1)
    merge(bank, block, lane, lane + 1)


@internal
def step_imm_irregular(
    bank: ImmBank, block: Any, first: int, last: int, radii: NDArray[np.float64], model: Any, robust: Any
) -> None:
    """Advance every filter where measurements may be missing or of different variances, lane by lane.

    Args:
        block: also with `variance_ratio`, (LANES,), of the measurement over R.
        bank, first, last, radii, model, robust: see `step_imm`.
    """
    for lane in range(first, last):
        if math.isnan(block.measurement[0, lane]):
            predict_imm(bank, block, lane, radii, model)
        else:
            ratio = block.variance_ratio[lane]
            of_tick = ImmModel(
                model.tau, model.process_variance, ratio * model.variance_x, ratio * model.variance_y,
                model.stay_probability, model.switch_probability, model.freedom,
            )  # fmt: skip
            step_imm(bank, block, lane, lane + 1, radii, of_tick, robust)
