"""Golubkov 2020: detection of a right turn at an unknown time.

The nominal filter assumes straight motion. At every tick a new filter of each turn starts from the
nominal estimate and covariance, for the hypothesis that the turn begins at this tick. lambda_k is
the mean of the likelihood ratios of all start times so far, eq. (6); a switch is declared when
lambda_k >= A. k lambda_k is the Shiryaev-Roberts statistic: alpha and beta determine the
thresholds, but are no error probabilities.

The paper shows one realisation, with a delay of 12 ticks, and states neither alpha nor beta; here
is the distribution of the delay, from tick 20 on. A run that does not detect the turn within its 20
ticks, also after a false alarm, has missed it. Deviations from the text: the root in eq. (7) is
|Sigma_0| / |Sigma_1| (published inverted), and Sigma = H P H' + R.
"""

import math

import numpy as np

from baselines import RestartDecider, sprt_thresholds
from hybrid_env import QuickestOptions
from studies.arrays import FloatArray, IntArray
from studies.papers.published import Reproduction, table_row
from studies.papers.setting import GOLUBKOV_2020 as SETTING
from studies.papers.setting import Setting

# Number of straight ticks.
SWITCH = 20


def ratios_of(measurements: FloatArray, setting: Setting, variance: float) -> FloatArray:
    """Return ln lambda_k of every turn after every tick, (n, T, turns), of a detector that never
    decides, from measurements (n, T, 2) with R [m^2] and straight motion at the start with P = I.
    """
    options = QuickestOptions(
        radii=setting.radii,
        process_variance=setting.process_variance,
        measurement_variance=variance,
    )
    # No ratio reaches the threshold.
    rule = RestartDecider(options, 1e9, 0.0, measurements.shape[1], mean=True)
    straight = np.full(options.hypotheses, -math.inf)
    straight[0] = 0.0
    row = np.concatenate([[0.0, 0.0], setting.start, np.eye(4)[np.triu_indices(4)], straight])
    rows = np.tile(row, (len(measurements), 1))
    _, filters = rule.predict(rows)
    ratios = []
    for measured in measurements.swapaxes(0, 1):
        rows[:, :2] = measured
        _, filters = rule.predict(rows, filters)
        ratios.append(filters.log_ratios[:, 1:].copy())
    return np.stack(ratios, axis=1)


def delays_after(ticks: IntArray) -> IntArray:
    """Return the delays of the runs that detect the turn, from the ticks of detection, (n,)."""
    return ticks[ticks > SWITCH] - SWITCH


def delay_statistics(ticks: IntArray) -> dict[str, float]:
    """Mean and first quartile of the delay [ticks], and rate of missed turns [%], of detections
    (n,).
    """
    delays = delays_after(ticks)
    known = delays if delays.size else np.array([math.nan])
    return {
        "mean delay of the detected runs": float(known.mean()),
        "25 % quantile": float(np.percentile(known, 25)),
        "missed by tick 40, %": 100.0 * (1.0 - delays.size / ticks.size),
    }


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Distribution of the detection delay; arguments as of `golubkov2018.reproduce`."""
    variance = SETTING.variances["R"]
    measurements = SETTING.simulate(runs, seed, variance).measurements
    # Ratios of the right turn.
    ratios = ratios_of(measurements, SETTING, variance)[..., 1]
    rows = []
    for alpha in (0.1, 0.05, 0.01, 0.001):
        row = f"alpha = {alpha:g}"
        passed = ratios >= sprt_thresholds(alpha)[0]
        # Counted from 1, 0 without a detection.
        ticks = np.where(passed.any(1), passed.argmax(1) + 1, 0)
        statistics = delay_statistics(ticks)
        name, mean = next(iter(statistics.items()))
        delays = delays_after(ticks)
        bounds = np.percentile(delays, [2.5, 97.5]) if delays.size else (math.nan, math.nan)
        rows.append(
            table_row(
                "Detection delay of the published realisation, ticks",
                row,
                [name],
                12.0,
                (mean, *bounds),
                1,
                "The interval contains 95 % of the delays of single runs.",
                "one observation beside four values of alpha, which is not stated",
            )
        )
        draw = np.random.default_rng(seed).choice
        resampled = [[*delay_statistics(draw(ticks, runs)).values()] for _ in range(200)]
        rows.append(
            table_row(
                "Distribution of the delay",
                row,
                statistics,
                math.nan,
                [[*statistics.values()], *np.nanpercentile(resampled, [2.5, 97.5], axis=0)],
                2,
                "The interval is the 95 % bootstrap confidence interval over all runs.",
            )
        )
    return Reproduction(SETTING.paper, runs, seed, rows, (), size="one run")
