"""Detection of a switch at an unknown moment. Golubkov 2020.

The nominal filter goes straight. At every tick a new filter of each turn starts at the nominal estimate and
covariance, for the hypothesis that the turn begins with this tick. lambda_k averages the likelihood ratios of
all starts so far, eq. (6); where it passes A the switch is declared. k lambda_k is the Shiryaev-Roberts
statistic, so Wald's alpha and beta are names of thresholds here and not error rates.

Where the print is wrong: under the root of eq. (7) stands |Sigma_0| / |Sigma_1|, not its inverse, and
Sigma = H P H' + R; `printed_sign=True` shows what the print's root does. Its algorithm is written for p = 1
(a left turn) and its experiment uses p = 2; here any turn may be tested. All is computed in logarithms.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.deciders.sprt import sprt_thresholds
from baselines.filters.recording import Filters, check_recording, make_filters
from hybrid_env.checks import check_flag, check_integer, check_positive, check_radii, reject
from hybrid_env.core.compilation import compiled
from hybrid_env.core.published_bank import (
    IDENTITY,
    PublishedBank,
    begin_published,
    covariance_published,
    estimate_of,
    published_arrays,
    published_of_block,
    step_published,
)
from hybrid_env.core.records import LANES

FloatArray = NDArray[np.float64]
UNDETECTED = 0


@dataclass(frozen=True)
class Detection:
    """What was detected in n runs of T ticks with M hypotheses; a single run has no first axis.

    Attributes:
        ticks: (n,) first tick at which a tested hypothesis passes A, from 1 on; 0 where none does.
        modes: (n,) the hypothesis whose ratio is largest then; -1 where none is.
        log_ratios: (n, T, M) ln lambda_k of each turn; NaN in the column of the straight line.
        upper, lower: ln A and ln B.
        accepted: (n,) first tick at which every tested ratio lies at or below B, the print's decision for
            no change; 0 where it does not happen. It does not stop the search.
    """

    ticks: NDArray[np.int64]
    modes: NDArray[np.int64]
    log_ratios: FloatArray
    upper: float
    lower: float
    accepted: NDArray[np.int64]


@compiled
def _ratios_of_run(
    measurements: FloatArray,
    start: FloatArray,
    nominal: Filters,
    started: PublishedBank,
    printed_sign: bool,
    log_ratios: FloatArray,
) -> None:
    """Write ln lambda_k (T, M). nominal: of which the straight filter counts; started: one bank per tick."""
    bank, radii, model = nominal
    total = measurements.shape[0]
    hypotheses = bank.hypotheses.size
    x, vx, y, vy = start
    begin_published(bank, 0, (x, vx, y, vy), IDENTITY, radii, model)
    determinants = np.zeros((total, hypotheses))  # sum of ln |Sigma_1| - ln |Sigma_0|, for the printed root
    before = np.zeros(total)  # the nominal log-likelihood when filter j starts
    log_psi = np.empty((total, hypotheses))
    measurement = np.zeros((2, LANES))
    straight = bank.hypotheses[0]
    for k in range(total):
        measurement[:, 0] = measurements[k]
        before[k] = straight.log_likelihood[0]
        anchor, covariance = estimate_of(bank.hypotheses, 0, 0), covariance_published(bank, 0, 0)
        begin_published(published_of_block(started, k), 0, anchor, covariance, radii, model)
        step_published(bank, 0, 1, measurement, model)
        for j in range(k + 1):
            running = published_of_block(started, j)
            step_published(running, 0, 1, measurement, model)
            for h in range(1, hypotheses):
                # logarithm of psi_j, eq. (7): likelihood of a turn since tick j over the straight line's
                log_psi[j, h] = running.hypotheses[h].log_likelihood[0] - (
                    straight.log_likelihood[0] - before[j]
                )
                if printed_sign:
                    determinants[j, h] += 2.0 * (
                        running.innovations[h].log_variance[0] - bank.innovations[0].log_variance[0]
                    )
                    log_psi[j, h] += determinants[j, h]
        for h in range(1, hypotheses):
            largest = log_psi[: k + 1, h].max()
            mean = np.exp(log_psi[: k + 1, h] - largest).sum() / (k + 1.0)
            log_ratios[k, h] = largest + math.log(mean)


def detect_switch(
    measurements: ArrayLike,
    start: ArrayLike | None = None,
    *,
    radii: ArrayLike = (5.0,),
    tested: ArrayLike | None = None,
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
    alpha: float = 0.1,
    beta: float | None = None,
    margin: float = 0.0,
    printed_sign: bool = False,
) -> Detection:
    """Watch recorded coordinates of an object on a straight line for the beginning of a turn.

    Args:
        measurements: (T, 2) coordinates [m], or (n, T, 2) of n runs.
        start: (4,) or (n, 4) estimate one tick before the first measurement; None takes `ate.first_estimate`.
        radii: turn radii [m]; hypotheses 1 .. n turn left, n + 1 .. 2 n right.
        tested: hypotheses that may be declared; None tests them all.
        tau, process_variance, measurement_variance: as in `ate.track`.
        alpha, beta: thresholds A = (1 - beta) / alpha and B = beta / (1 - alpha); beta None takes alpha.
        margin: by how much the largest ln lambda must also beat that of every other tested hypothesis; 0 is
            the published detection, more identifies the turn as well.
        printed_sign: the root of eq. (7) as it stands in the print.

    Raises:
        ArgumentError: names the argument, its value and what is allowed.
    """
    tau = check_positive("tau", tau)
    total = np.shape(measurements)[-2] if np.ndim(measurements) in (2, 3) else 0
    values, _, starts = check_recording(measurements, [max(total, 1)], start, tau)
    bank_radii = check_radii("radii", radii)
    hypotheses = 2 * bank_radii.size + 1
    chosen = np.arange(1, hypotheses) if tested is None else np.atleast_1d(np.asarray(tested))
    if chosen.size == 0 or not all(
        1 <= check_integer("tested", mode, minimum=1) < hypotheses for mode in chosen.tolist()
    ):
        raise reject("tested", tested, f"one or more hypotheses from 1 to {hypotheses - 1}")
    nominal = make_filters(bank_radii, tau, process_variance, measurement_variance)
    upper, lower = sprt_thresholds(alpha, beta)
    margin = check_positive("margin", margin, allow_zero=True)
    sign = check_flag("printed_sign", printed_sign)

    axes = len(nominal.bank.covariances)
    started = published_arrays(bank_radii.size, axes, total)
    log_ratios = np.full((len(values), total, hypotheses), np.nan)
    for run, recording in enumerate(values):
        _ratios_of_run(recording, starts[run], nominal, started, sign, log_ratios[run])
    return _decide(log_ratios, chosen, upper, lower, margin, np.ndim(measurements) == 2)


def _decide(
    log_ratios: FloatArray, tested: NDArray[Any], upper: float, lower: float, margin: float, single: bool
) -> Detection:
    """Rule (3) on the ratios of the tested hypotheses."""
    ranked = np.sort(log_ratios[:, :, tested], axis=-1)
    largest = ranked[:, :, -1]
    passed = largest >= upper
    if tested.size > 1:
        passed &= largest - ranked[:, :, -2] >= margin
    detected = passed.any(1)
    first = passed.argmax(1)
    at = log_ratios[np.arange(len(first)), first][:, tested]
    ticks = np.where(detected, first + 1, UNDETECTED)
    modes = np.where(detected, tested[at.argmax(1)], -1)
    below = largest <= lower
    accepted = np.where(below.any(1), below.argmax(1) + 1, 0)
    if single:
        return Detection(ticks[0], modes[0], log_ratios[0], upper, lower, accepted[0])
    return Detection(ticks, modes, log_ratios, upper, lower, accepted)
