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
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.special import logsumexp

from baselines import MeanRatioDecider, sprt_thresholds
from hybrid_env import QuickestOptions, simulate
from studies.papers.figures import (
    DARK_GREY,
    GREY,
    TRUTH,
    TYPE_COLOURS,
    draw_by_type,
    new_figure,
    style_map,
)
from studies.papers.reproduction import Cell, Finding, Reproduction, table_row

PAPER = "Golubkov 2020"
SCHEME = "golubkov2020"
# Number of ticks before the turn.
SWITCH = 20
# State one tick before the first measurement, [x, vx, y, vy] [m, m/s].
START = (0.0, 0.0, 0.0, 2.0)
# R [m^2].
VARIANCE = 0.1
# Upper triangle of P = I at the start.
IDENTITY = np.eye(4)[np.triu_indices(4)]
# Logarithm of a ratio that is not reached.
NEVER = 1e9
# p = 2.
RIGHT_TURN = 2
ALPHAS = (0.1, 0.05, 0.01, 0.001)
# Delay of the published realisation [ticks].
PUBLISHED_DELAY = 12
PERCENTILES = (5, 25, 50, 75, 95)
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
    """Results of the detector for n runs of T ticks and M hypotheses."""

    # (n,) first tick at which a tested hypothesis is declared, counted from 1; 0 without a
    # detection.
    ticks: NDArray[np.int64]
    # (n,) the hypothesis with the largest ratio at this tick.
    modes: NDArray[np.int64]
    # (n, T, M) ln lambda_k of each turn.
    log_ratios: NDArray[np.float64]


def start_row(start: Sequence[float], hypotheses: int) -> NDArray[np.float64]:
    """Return the first observation of `MeanRatioDecider`, straight from a state with P = I."""
    straight = np.full(hypotheses, -math.inf)
    straight[0] = 0.0
    return np.concatenate([[0.0, 0.0], start, IDENTITY, straight])


def log_ratios(
    measurements: NDArray[np.float64],
    radii: tuple[float, ...] = (5.0,),
    published_root: bool = False,
) -> NDArray[np.float64]:
    """Return ln lambda_k of measurements (n, T, 2), (n, T, M); `published_root` takes the ratio
    of determinants in eq. (7) as it is printed.
    """
    runs, total = measurements.shape[:2]
    options = QuickestOptions(radii=radii, measurement_variance=VARIANCE)
    rule = MeanRatioDecider(options, NEVER, 0.0, total)
    rows = np.tile(start_row(START, options.hypotheses), (runs, 1))
    _, filters = rule.predict(rows)
    found = np.empty((runs, total, options.hypotheses))
    # Sum of ln |Sigma_1| - ln |Sigma_0|.
    determinants = np.zeros(filters.started["log_likelihood"].shape)
    starts = np.arange(determinants[0, 0].size).reshape(determinants.shape[2:])
    for k, measured in enumerate(measurements.swapaxes(0, 1)):
        rows[:, :2] = measured
        _, filters = rule.predict(rows, filters)
        found[:, k] = filters.log_ratios
        if published_root:
            straight = filters.stated_filters[:, None, None]
            determinants += _log_determinants(filters.started)
            determinants -= _log_determinants(straight)[..., :1]
            determinants[..., starts > k] = 0.0
            log_psi = filters.started["log_likelihood"] + determinants
            log_psi = log_psi - straight["log_likelihood"][..., :1]
            log_psi[..., starts > k] = -np.inf
            found[:, k, 1:] = logsumexp(log_psi[:, 1:], axis=(2, 3)) - math.log(k + 1.0)
    return found


def _log_determinants(filters: NDArray[Any]) -> NDArray[np.float64]:
    """Return ln |Sigma| - ln |R| of the last tick: Sigma = R^2 / (R - P) on each axis, P
    corrected.
    """
    x, y = (filters["covariance"][..., entry, :] for entry in (0, 13))
    return -np.log(1.0 - x / VARIANCE) - np.log(1.0 - y / VARIANCE)


def detect(
    ratios: NDArray[np.float64],
    alpha: float,
    tested: Sequence[int] = (RIGHT_TURN,),
    margin: float = 0.0,
) -> Detection:
    """Detect the switch from straight motion to a turn.

    Args:
        ratios: (n, T, M) of `log_ratios`.
        alpha: of both thresholds.
        tested: hypotheses that may be declared.
        margin: smallest difference between the largest ln lambda and that of every other tested
            hypothesis at the detection; 0 is the published rule, larger values also identify the
            radius.
    """
    of_tested = ratios[:, :, list(tested)]
    ranked = np.sort(of_tested, axis=-1)
    passed = ranked[:, :, -1] >= sprt_thresholds(alpha)[0]
    if len(tested) > 1:
        passed &= ranked[:, :, -1] - ranked[:, :, -2] >= margin
    first = passed.argmax(1)
    modes = np.array(tested)[of_tested[np.arange(len(ratios)), first].argmax(1)]
    return Detection(
        np.where(passed.any(1), first + 1, 0),
        modes,
        ratios,
    )


def delay_statistics(ticks: NDArray[np.int64]) -> dict[str, float]:
    """Rates of false alarms and missed turns [%], mean and quantiles of the delay [ticks], of
    detections (n,).
    """
    delays = ticks[ticks > SWITCH] - SWITCH
    known = delays if delays.size else np.array([math.nan])
    quantiles = zip(
        PERCENTILES,
        np.percentile(known, PERCENTILES).tolist(),
        strict=True,
    )
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
    recording = simulate(SCHEME, runs, seed, start=START)
    no_turn = simulate(f"S{2 * SWITCH}", runs, seed + 1, start=START)
    ratios, without_turn = (log_ratios(part.measurements) for part in (recording, no_turn))
    with_published_root = log_ratios(recording.measurements, published_root=True)
    cells: list[Cell] = []
    findings: list[Finding] = []
    examples: dict[str, Any] = {}
    for alpha in ALPHAS:
        detection = detect(ratios, alpha)
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
        false_alarms = 100.0 * (detect(without_turn, alpha).ticks > 0).mean()
        root = delay_statistics(detect(with_published_root, alpha).ticks)
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
    return Reproduction(
        PAPER,
        runs,
        seed,
        tuple(cells),
        tuple(findings),
        examples,
        size="one run",
    )


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
        ratios = log_ratios(np.concatenate(parts), radii)
        for margin in (0.0, math.log(9.0), math.log(99.0)):
            detection = detect(
                ratios,
                0.01,
                range(1, len(turns) + 1),
                margin,
            )
            detected = detection.ticks > SWITCH
            sides = (detection.modes > len(radii)) == (truth > len(radii))
            rule = (
                "no margin"
                if margin == 0.0
                else f"margin ln {math.exp(margin):.0f} over every other turn"
            )
            text = (
                f"correct direction {100 * sides[detected].mean():.1f} %, correct turn"
                f" {100 * (detection.modes == truth)[detected].mean():.1f} %, mean delay"
                f" {(detection.ticks[detected] - SWITCH).mean():.1f} ticks, not detected within"
                f" {HORIZON} ticks {100 * (detection.ticks == 0).mean():.1f} %"
            )
            setting = f"identification of the turn, {name}, alpha = 0.01, {rule}"
            findings.append(Finding(setting, text, "named as future work"))
    return findings


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name: one run, its ln lambda, and the distribution of the
    delay.
    """
    title = f"{PAPER}: detection of a right turn (r = 5 m) that begins after tick {SWITCH}"
    figure, (ground, ratios, delays) = new_figure(
        title,
        (15.5, 5.2),
        (0.9, 1.2, 1.2),
    )
    (recording, detection), *_ = result.examples.values()
    style_map(ground, "One run in the plane")
    ground.plot(
        *recording.measurements[0].T,
        ".",
        color=GREY,
        markersize=4,
        label="measurements",
    )
    types = np.repeat([0, RIGHT_TURN], recording.lengths)
    draw_by_type(
        ground,
        recording.truth[0][:, [0, 2]],
        types,
        linewidths=1.8,
    )
    for kind, name in ((0, "straight"), (RIGHT_TURN, "right turn")):
        ground.plot(
            [],
            [],
            color=TYPE_COLOURS[kind],
            label=name,
        )

    values = detection.log_ratios[0][:, RIGHT_TURN]
    ratios.plot(
        np.arange(1, len(values) + 1),
        values,
        color=TYPE_COLOURS[RIGHT_TURN],
    )
    for name, value in zip(("ln A", "ln B"), sprt_thresholds(ALPHAS[0]), strict=True):
        label = f"{name} = {value:.1f}"
        ratios.axhline(
            value,
            color=DARK_GREY,
            linestyle="--",
            linewidth=0.9,
            label=label,
        )
    ratios.axvline(
        SWITCH + 0.5,
        color=GREY,
        linewidth=0.9,
        label="turn begins",
    )
    tick = int(detection.ticks[0])
    if tick:
        ratios.plot(tick, values[tick - 1], "o", color=TRUTH, label=f"detected at tick {tick}")
    ratios.set(
        title=f"The same run: averaged likelihood ratio λ, alpha = {ALPHAS[0]:g}",
        xlabel="tick",
        ylabel="ln λ of a right turn against straight motion",
    )

    for name, (_, of_alpha) in result.examples.items():
        seen = of_alpha.ticks[of_alpha.ticks > SWITCH] - SWITCH
        share = [100.0 * (seen <= delay).sum() / result.runs for delay in range(SWITCH + 1)]
        delays.step(
            range(SWITCH + 1),
            share,
            where="post",
            label=name,
        )
    delays.axvline(PUBLISHED_DELAY, color=GREY, label=f"published: {PUBLISHED_DELAY}")
    delays.set(
        title=f"{result.runs} runs: distribution of the delay",
        xlabel="delay since the turn began [ticks]",
        ylabel="runs with the turn detected [%]",
        xlim=(0, 1.35 * SWITCH),
        ylim=(0, 100),
    )
    for axes in (ground, ratios, delays):
        axes.legend()
    return {"golubkov2020.png": figure}
