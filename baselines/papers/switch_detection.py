"""Detection of a switch at an unknown time. Golubkov 2020.

The nominal filter assumes straight motion. At every tick a new filter of each turn starts from the nominal
estimate and covariance, for the hypothesis that the turn begins at this tick. lambda_k is the mean of the
likelihood ratios of all start times so far, eq. (6); a switch is declared when lambda_k >= A. Because
k lambda_k is the Shiryaev-Roberts statistic, alpha and beta determine the thresholds here, but they are not
error probabilities.

Two equations are corrected: the root in eq. (7) is that of |Sigma_0| / |Sigma_1|, the inverse of the
published ratio, and Sigma = H P H' + R. `published_root=True` uses the published ratio. The published
algorithm is stated for p = 1 (a left turn) and its experiment uses p = 2; here any turn can be tested. All
computations are in logarithms.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.recordings.arrays import Filters, check_recording, make_filters
from baselines.rules.sprt import sprt_thresholds
from hybrid_env.checks import check_flag, check_integer, check_positive, dimensions, reject
from hybrid_env.core.banks.bank import IDENTITY, bank_arrays, estimate_of
from hybrid_env.core.banks.published import (
    PublishedBank,
    begin_published,
    covariance_published,
    published_of_block,
    step_published,
)
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.records import LANES
from hybrid_env.limits import check_within, distinct_radii

FloatArray = NDArray[np.float64]
UNDETECTED = 0


@dataclass(frozen=True)
class Detection:
    """Results of the detector for n runs of T ticks and M hypotheses. A single run has no first axis.

    Attributes:
        ticks: (n,) detection time, the first tick at which a tested hypothesis is declared, counted from 1;
            0 if there is no detection.
        modes: (n,) the hypothesis with the largest ratio at this tick; -1 if there is no detection.
        log_ratios: (n, T, M) ln lambda_k of each turn, NaN in the column of the straight line.
        upper: ln A.
        lower: ln B.
        accepted: (n,) first tick at which every tested ratio is <= B, the published decision that there is
            no change; 0 if this does not occur. It does not stop the detection.
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
    published_root: bool,
    log_ratios: FloatArray,
) -> None:
    """Write ln lambda_k, (T, M), of one run. `nominal` provides the straight filter, `started` T banks."""
    bank, radii, model = nominal
    total = measurements.shape[0]
    hypotheses = bank.hypotheses.size
    x, vx, y, vy = start
    begin_published(bank, 0, (x, vx, y, vy), IDENTITY, radii, model)
    determinants = np.zeros((total, hypotheses))  # sum of ln |Sigma_1| - ln |Sigma_0|
    before = np.zeros(total)  # nominal log-likelihood when filter j starts
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
                # ln psi_j, eq. (7): log-likelihood ratio of a turn that begins at tick j to the straight line
                log_psi[j, h] = running.hypotheses[h].log_likelihood[0] - (
                    straight.log_likelihood[0] - before[j]
                )
                if published_root:
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
    published_root: bool = False,
) -> Detection:
    """Detect the switch from straight motion to a turn in recorded positions.

    Args:
        measurements: (T, 2) measured positions [m], or (n, T, 2) for n runs.
        start: (4,) or (n, 4) estimate [x, vx, y, vy] one tick before the first measurement [m, m/s]; None
            uses `first_estimate`.
        radii: n turn radii [m]; hypotheses 1 .. n are left turns, n + 1 .. 2 n are right turns.
        tested: hypotheses that may be declared; None tests all turns.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        alpha, beta: determine the thresholds A = (1 - beta) / alpha and B = beta / (1 - alpha); None for beta
            uses alpha.
        margin: minimum difference between the largest ln lambda and that of every other tested hypothesis at
            the detection; 0 is the published rule, larger values also identify the radius.
        published_root: True uses the published ratio of determinants in eq. (7).

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    tau = check_within("tau", tau)
    total = np.shape(measurements)[-2] if dimensions(measurements) in (2, 3) else 0
    values, _, starts = check_recording(measurements, [max(total, 1)], start, tau)
    bank_radii = np.array(distinct_radii("radii", radii))
    hypotheses = 2 * bank_radii.size + 1
    modes = range(1, hypotheses) if tested is None else [tested] if dimensions(tested) == 0 else tested
    if not isinstance(modes, (Sequence, np.ndarray)) or len(modes) == 0:
        raise reject("tested", tested, f"one or more hypotheses from 1 to {hypotheses - 1}")
    chosen = np.array([check_integer("tested", mode, 1, hypotheses - 1) for mode in modes])
    nominal = make_filters(bank_radii, tau, process_variance, measurement_variance)
    upper, lower = sprt_thresholds(alpha, beta)
    margin = check_positive("margin", margin, allow_zero=True)
    root = check_flag("published_root", published_root)

    axes = len(nominal.bank.covariances)
    started = bank_arrays(PublishedBank, bank_radii.size, axes, total)
    log_ratios = np.full((len(values), total, hypotheses), np.nan)
    for run, recording in enumerate(values):
        arguments = recording, starts[run], nominal, started, root, log_ratios[run]
        if run == 0:
            prepare(_ratios_of_run, *arguments)
        _ratios_of_run(*arguments)
    return _decide(log_ratios, chosen, upper, lower, margin, np.ndim(measurements) == 2)


def _decide(
    log_ratios: FloatArray, tested: NDArray[Any], upper: float, lower: float, margin: float, single: bool
) -> Detection:
    """Apply rule (3) to the ratios of the tested hypotheses."""
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
