"""Golubkov 2020: detection of a right turn at an unknown time; settings and reproduction.

The nominal filter assumes straight motion. At every tick a new filter of each turn starts from the
nominal estimate and covariance, for the hypothesis that the turn begins at this tick. lambda_k is
the mean of the likelihood ratios of all start times so far, eq. (6); a switch is declared when
lambda_k >= A. k lambda_k is the Shiryaev-Roberts statistic: alpha and beta determine the
thresholds, but are no error probabilities, as the false-alarm rates without a turn show.

The paper shows one realisation, with a delay of 12 ticks, and states neither alpha nor beta; here
is the distribution of the delay, from tick 20 on. A run that does not detect the turn within its 20
ticks, also after a false alarm, has missed it. Deviations from the text: the root in eq. (7) is
|Sigma_0| / |Sigma_1| (published inverted, as with `published_root=True`), Sigma = H P H' + R, and
the tested turn is p = 2, as in the experiment, not p = 1.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from baselines.recordings.arrays import check_recording, make_filters
from baselines.rules.measurements import run_compiled
from baselines.rules.restarted import RestartModel, begin_restarted, restart_arrays, step_restarted
from baselines.rules.sprt import sprt_thresholds
from hybrid_env.checks import (
    FloatArray,
    IntArray,
    check_flag,
    check_integer,
    check_positive,
    dimensions,
    reject,
)
from hybrid_env.core.banks.bank import IDENTITY, FilterModel
from hybrid_env.limits import check_within, distinct_radii
from hybrid_env.simulation import Simulation, simulate
from studies.papers.reproduction import Cell, Finding, Reproduction, table_row

PAPER = "Golubkov 2020"
SCHEME = "golubkov2020"
# Number of ticks before the turn.
SWITCH = 20
# State one tick before the first measurement, [x, vx, y, vy] [m, m/s].
START = (0.0, 0.0, 0.0, 2.0)
# p = 2.
RIGHT_TURN = 2
ALPHAS = (0.1, 0.05, 0.01, 0.001)
# Delay of the published realisation [ticks].
PUBLISHED_DELAY = 12
PERCENTILES = (5, 25, 50, 75, 95)
# Bounds the memory.
RUNS_AT_ONCE = 256
# Length of the turn in the identification study [ticks].
HORIZON = 60
# Turn radii of each bank in the identification study [m].
IDENTIFICATION = {
    "3 hypotheses": (5.0,),
    "21 hypotheses": tuple(float(radius) for radius in range(1, 11)),
}
MEAN_DELAY = "mean delay of the detected runs"
ONE_RUN = "one observation beside four values of alpha, which is not stated"
PUBLISHED_TABLE = "Detection delay of the published realisation, ticks"
DISTRIBUTION = "Distribution of the delay"
DELAY_INTERVAL = "The interval contains 95 % of the delays of single runs."
BOOTSTRAP_INTERVAL = "The interval is the 95 % bootstrap confidence interval over all runs."


class Detection(NamedTuple):
    """Results of the detector for n runs of T ticks and M hypotheses. A single run has no first
    axis.
    """

    # (n,) first tick at which a tested hypothesis is declared, counted from 1; 0 without a
    # detection.
    ticks: IntArray
    # (n,) the hypothesis with the largest ratio at this tick; -1 without a detection.
    modes: IntArray
    # (n, T, M) ln lambda_k of each turn, NaN in the column of the straight line.
    log_ratios: FloatArray
    # Ln A.
    upper: float
    # Ln B.
    lower: float


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
        measurements, start, tau, process_variance, measurement_variance: see `baselines.track_ate`.
        radii: n turn radii [m]; hypotheses 1 .. n are left turns, n + 1 .. 2 n are right turns.
        tested: hypotheses that may be declared; None tests all turns.
        alpha, beta: determine the thresholds A = (1 - beta) / alpha and B = beta / (1 - alpha);
            None for beta uses alpha.
        margin: minimum difference between the largest ln lambda and that of every other tested
            hypothesis at the detection; 0 is the published rule, larger values also identify the
            radius.
        published_root: True uses the published ratio of determinants in eq. (7).
    """
    tau = check_within("tau", tau)
    total = np.shape(measurements)[-2] if dimensions(measurements) in (2, 3) else 0
    values, _, starts = check_recording(measurements, [max(total, 1)], start, tau)
    bank_radii = np.array(distinct_radii("radii", radii))
    hypotheses = 2 * bank_radii.size + 1
    modes = (
        range(1, hypotheses) if tested is None else [tested] if dimensions(tested) == 0 else tested
    )
    if not isinstance(modes, (Sequence, np.ndarray)) or len(modes) == 0:
        raise reject("tested", tested, f"one or more hypotheses from 1 to {hypotheses - 1}")
    chosen = np.array([check_integer("tested", mode, 1, hypotheses - 1) for mode in modes])
    model = make_filters(bank_radii, tau, process_variance, measurement_variance).model
    upper, lower = sprt_thresholds(alpha, beta)
    margin = check_positive("margin", margin, allow_zero=True)
    root = check_flag("published_root", published_root)

    log_ratios = np.full((len(values), total, hypotheses), np.nan)
    for first in range(0, len(values), RUNS_AT_ONCE):
        part = slice(first, first + RUNS_AT_ONCE)
        log_ratios[part, :, 1:] = _log_ratios(values[part], starts[part], bank_radii, model, root)
    ranked = np.sort(log_ratios[:, :, chosen], axis=-1)
    largest = ranked[:, :, -1]
    passed = largest >= upper
    if chosen.size > 1:
        passed &= largest - ranked[:, :, -2] >= margin
    detected = passed.any(1)
    first_tick = passed.argmax(1)
    at = log_ratios[np.arange(len(values)), first_tick][:, chosen]
    ticks = np.where(detected, first_tick + 1, 0)
    found = np.where(detected, chosen[at.argmax(1)], -1)
    if np.ndim(measurements) == 2:
        return Detection(ticks[0], found[0], log_ratios[0], upper, lower)
    return Detection(ticks, found, log_ratios, upper, lower)


def _log_ratios(
    values: FloatArray,
    starts: FloatArray,
    radii: FloatArray,
    model: FilterModel,
    published_root: bool,
) -> FloatArray:
    """Return ln lambda_k of the turns, (n, T, M - 1), from measurements (n, T, 2) and starts (n,
    4).
    """
    runs, total = values.shape[:2]
    ticks = np.ascontiguousarray(values.swapaxes(0, 1))
    # The statement never changes.
    rule = RestartModel(radii, total, True, True, math.inf, 0.0, model)
    filters = restart_arrays(runs, 2 * radii.size + 1, total)
    for run, start in enumerate(starts):
        run_compiled(begin_restarted, filters, run, 0, np.concatenate([start, IDENTITY]), rule)
    log_ratios = np.empty((runs, total, 2 * radii.size))
    # Sum of ln |Sigma_1| - ln |Sigma_0|.
    determinants = np.zeros(filters.started["log_likelihood"].shape)
    starts_of = np.arange(determinants[0, 0].size).reshape(determinants.shape[2:])
    for k, measured in enumerate(ticks):
        run_compiled(step_restarted, filters, measured, rule)
        log_ratios[:, k] = filters.log_ratios[:, 1:]
        if published_root:
            straight = filters.stated_filters[:, None, None]
            determinants += _log_determinants(filters.started, model)
            determinants -= _log_determinants(straight, model)[..., :1]
            determinants[..., starts_of > k] = 0.0
            log_psi = (
                filters.started["log_likelihood"]
                - straight["log_likelihood"][..., :1]
                + determinants
            )
            log_psi[..., starts_of > k] = -np.inf
            log_ratios[:, k] = logsumexp(log_psi[:, 1:], axis=(2, 3)) - math.log(k + 1.0)
    return log_ratios


def _log_determinants(filters: NDArray[Any], model: FilterModel) -> FloatArray:
    """Return ln |Sigma| - ln |R| of the last tick: Sigma = R^2 / (R - P) on each axis, P
    corrected.
    """
    x, y = (filters["covariance"][..., entry, :] for entry in (0, 13))
    return -np.log(1.0 - x / model.variance_x) - np.log(1.0 - y / model.variance_y)


def run_detector(recording: Simulation, alpha: float, **options: Any) -> Detection:
    """Run the paper's detector of a right turn; options are those of `detect_switch`."""
    return detect_switch(recording.measurements, START, tested=[RIGHT_TURN], alpha=alpha, **options)


def delay_statistics(ticks: IntArray) -> dict[str, float]:
    """Rates of false alarms and missed turns [%], mean and quantiles of the delay [ticks], of
    detections (n,).
    """
    delays = ticks[ticks > SWITCH] - SWITCH
    known = delays if delays.size else np.array([math.nan])
    quantiles = zip(PERCENTILES, np.percentile(known, PERCENTILES).tolist(), strict=True)
    return {
        "false alarms by tick 20, %": 100.0 * float(((ticks > 0) & (ticks <= SWITCH)).mean()),
        MEAN_DELAY: float(known.mean()),
        **{f"{percentile} % quantile": value for percentile, value in quantiles},
        "missed by tick 40, %": 100.0 * (1.0 - delays.size / ticks.size),
    }


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Distribution of the detection delay, false alarms without a turn, and identification of
    the turn.

    Arguments as of `golubkov2018.reproduce`; the identification study uses a quarter of the runs.
    """
    runs = check_integer("runs", runs, minimum=2)
    recording = simulate(SCHEME, runs, seed, start=START)
    no_turn = simulate(f"S{2 * SWITCH}", runs, seed + 1, start=START)
    cells: list[Cell] = []
    findings: list[Finding] = []
    examples: dict[str, Any] = {}
    for alpha in ALPHAS:
        detection = run_detector(recording, alpha)
        row = f"alpha = {alpha:g}"
        statistics = delay_statistics(detection.ticks)
        delays = detection.ticks[detection.ticks > SWITCH] - SWITCH
        low, high = (
            np.percentile(delays, [2.5, 97.5]).tolist() if delays.size else (math.nan, math.nan)
        )
        delay = statistics[MEAN_DELAY], low, high
        cells.append(
            Cell(
                PUBLISHED_TABLE,
                row,
                MEAN_DELAY,
                PUBLISHED_DELAY,
                *delay,
                1,
                DELAY_INTERVAL,
                excuse=ONE_RUN,
            )
        )
        draw = np.random.default_rng(seed).choice
        resampled = [[*delay_statistics(draw(detection.ticks, runs)).values()] for _ in range(200)]
        interval = ([*statistics.values()], *np.nanpercentile(resampled, [2.5, 97.5], axis=0))
        nothing = [math.nan] * len(statistics)
        cells += table_row(DISTRIBUTION, row, statistics, nothing, interval, 2, BOOTSTRAP_INTERVAL)
        false_alarms = 100.0 * (run_detector(no_turn, alpha).ticks > 0).mean()
        root = delay_statistics(run_detector(recording, alpha, published_root=True).ticks)
        text = f"{MEAN_DELAY} {root[MEAN_DELAY]:.1f}, missed {root['missed by tick 40, %']:.1f} %"
        findings += [
            Finding(
                f"{row}: false alarms in 40 ticks without a turn",
                f"{false_alarms:.2f} %",
                f"{100 * alpha:g} %",
            ),
            Finding(f"{row}: root of eq. (7) as published", text),
        ]
        examples[row] = (recording, detection)
    findings += _identification(max(runs // 4, 2), seed)
    return Reproduction(PAPER, runs, seed, tuple(cells), tuple(findings), examples, size="one run")


def _identification(runs: int, seed: int) -> list[Finding]:
    """Identification of the turn at an unknown time, all turns equally frequent; named as future
    work.
    """
    findings = []
    for name, radii in IDENTIFICATION.items():
        turns = [f"{side}{HORIZON}r{radius:g}" for side in "LR" for radius in radii]
        parts = [
            simulate(
                f"S{SWITCH} {turn}",
                max(runs // len(turns), 1),
                seed + index,
                start=START,
            ).measurements
            for index, turn in enumerate(turns)
        ]
        truth = np.repeat(np.arange(1, len(turns) + 1), [len(part) for part in parts])
        for margin in (0.0, math.log(9.0), math.log(99.0)):
            found = detect_switch(
                np.concatenate(parts),
                START,
                radii=radii,
                alpha=0.01,
                margin=margin,
            )
            detected = found.ticks > SWITCH
            sides = (found.modes > len(radii)) == (truth > len(radii))
            rule = (
                "no margin"
                if margin == 0.0
                else f"margin ln {math.exp(margin):.0f} over every other turn"
            )
            text = (
                f"correct direction {100 * sides[detected].mean():.1f} %, correct turn"
                f" {100 * (found.modes == truth)[detected].mean():.1f} %, mean delay"
                f" {(found.ticks[detected] - SWITCH).mean():.1f} ticks, not detected within"
                f" {HORIZON} ticks {100 * (found.ticks == 0).mean():.1f} %"
            )
            setting = f"identification of the turn, {name}, alpha = 0.01, {rule}"
            findings.append(Finding(setting, text, "named as future work"))
    return findings
