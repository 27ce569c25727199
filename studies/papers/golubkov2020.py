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
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from baselines import MeanRatioDecider, sprt_thresholds
from hybrid_env import QuickestOptions
from studies.papers.published import Finding, FloatArray, IntArray, Reproduction, table_row
from studies.papers.setting import GOLUBKOV_2018, Setting
from studies.papers.setting import GOLUBKOV_2020 as SETTING

# Number of ticks before the turn.
SWITCH = 20
MEAN_DELAY = "mean delay of the detected runs"
BOOTSTRAP_INTERVAL = "The interval is the 95 % bootstrap confidence interval over all runs."


def run_detector(
    measurements: FloatArray,
    setting: Setting,
    variance: float,
    threshold: float,
    window: int,
) -> Iterator[tuple[IntArray, Any]]:
    """Yield the statements (n,) and filters of the detector after every tick of measurements (n, T,
    2) with R [m^2], from straight motion at the start with P = I; it tests moments of the switch up
    to a window of ticks ago.
    """
    options = QuickestOptions(
        radii=setting.radii,
        process_variance=setting.process_variance,
        measurement_variance=variance,
    )
    rule = MeanRatioDecider(
        options,
        threshold,
        0.0,
        window,
    )
    straight = np.full(options.hypotheses, -math.inf)
    straight[0] = 0.0
    row = np.concatenate([[0.0, 0.0], setting.start, np.eye(4)[np.triu_indices(4)], straight])
    rows = np.tile(row, (len(measurements), 1))
    _, filters = rule.predict(rows)
    for measured in measurements.swapaxes(0, 1):
        rows[:, :2] = measured
        stated, filters = rule.predict(rows, filters)
        yield stated, filters


def log_ratios(
    measurements: FloatArray,
    radii: tuple[float, ...] = SETTING.radii,
) -> FloatArray:
    """Return ln lambda_k of each of M hypotheses, (n, T, M), of measurements (n, T, 2)."""
    # A threshold that no ratio reaches.
    ticks = run_detector(
        measurements,
        replace(SETTING, radii=radii),
        SETTING.variances["R"],
        1e9,
        measurements.shape[1],
    )
    return np.stack([filters.log_ratios.copy() for _, filters in ticks], axis=1)


def detect(
    ratios: FloatArray,
    alpha: float,
    tested: Sequence[int] = (2,),
    margin: float = 0.0,
) -> tuple[IntArray, IntArray]:
    """Detect the switch from straight motion to a turn.

    Args:
        ratios: (n, T, M) of `log_ratios`.
        alpha: of both thresholds.
        tested: hypotheses that may be declared; of three, 2 is the right turn.
        margin: smallest difference between the largest ln lambda and that of every other tested
            hypothesis at the detection; 0 is the published rule, larger values also identify the
            radius.

    Returns:
        ticks: (n,) first tick at which a tested hypothesis is declared, counted from 1; 0 without a
            detection.
        modes: (n,) the hypothesis with the largest ratio at this tick.
    """
    of_tested = ratios[:, :, list(tested)]
    ranked = np.sort(of_tested, axis=-1)
    passed = ranked[:, :, -1] >= sprt_thresholds(alpha)[0]
    if len(tested) > 1:
        passed &= ranked[:, :, -1] - ranked[:, :, -2] >= margin
    first = passed.argmax(1)
    modes = np.array(tested)[of_tested[np.arange(len(ratios)), first].argmax(1)]
    return np.where(passed.any(1), first + 1, 0), modes


def delay_statistics(ticks: IntArray) -> dict[str, float]:
    """Mean and first quartile of the delay [ticks], and rate of missed turns [%], of detections
    (n,).
    """
    delays = ticks[ticks > SWITCH] - SWITCH
    known = delays if delays.size else np.array([math.nan])
    return {
        MEAN_DELAY: float(known.mean()),
        "25 % quantile": float(np.percentile(known, 25)),
        "missed by tick 40, %": 100.0 * (1.0 - delays.size / ticks.size),
    }


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Distribution of the detection delay, and identification of the turn.

    Arguments as of `golubkov2018.reproduce`; the identification study uses a quarter of the runs.
    """
    recording = SETTING.simulate(runs, seed, SETTING.variances["R"])
    ratios = log_ratios(recording.measurements)
    rows = []
    for alpha in (0.1, 0.05, 0.01, 0.001):
        row = f"alpha = {alpha:g}"
        ticks, _ = detect(ratios, alpha)
        statistics = delay_statistics(ticks)
        delays = ticks[ticks > SWITCH] - SWITCH
        bounds = np.percentile(delays, [2.5, 97.5]) if delays.size else (math.nan, math.nan)
        rows.append(
            table_row(
                "Detection delay of the published realisation, ticks",
                row,
                [MEAN_DELAY],
                12.0,
                np.array([[statistics[MEAN_DELAY], *bounds]]).T,
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
                BOOTSTRAP_INTERVAL,
            )
        )
    findings = _identification(max(runs // 4, 2), seed)
    return Reproduction(SETTING.paper, runs, seed, rows, findings, size="one run")


def _identification(runs: int, seed: int, horizon: int = 60) -> list[Finding]:
    """Identification of one of 20 turns of `horizon` ticks at an unknown time, all equally
    frequent; named as future work.
    """
    radii = GOLUBKOV_2018.radii
    turns = [f"{side}{horizon}r{radius:g}" for side in "LR" for radius in radii]
    parts = [
        SETTING.simulate(
            max(runs // len(turns), 1),
            seed + index,
            SETTING.variances["R"],
            scheme=f"S{SWITCH} {turn}",
        ).measurements
        for index, turn in enumerate(turns)
    ]
    truth = np.repeat(np.arange(1, len(turns) + 1), [len(part) for part in parts])
    ratios = log_ratios(np.concatenate(parts), radii)
    findings = []
    for odds in (1, 99):
        ticks, modes = detect(ratios, 0.01, range(1, len(turns) + 1), math.log(odds))
        detected = ticks > SWITCH
        sides = (modes > len(radii)) == (truth > len(radii))
        text = (
            f"correct direction {100 * sides[detected].mean():.1f} %, correct turn"
            f" {100 * (modes == truth)[detected].mean():.1f} %, not detected within {horizon} ticks"
            f" {100 * (ticks == 0).mean():.1f} %"
        )
        setting = f"identification of the turn, alpha = 0.01, lead of ln {odds} over every other"
        findings.append((setting, text, "named as future work"))
    return findings
