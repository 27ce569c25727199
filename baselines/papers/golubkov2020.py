"""Golubkov 2020: settings and reproduction of the detection of a right turn at an unknown time.

The paper shows one realisation, with a delay of 12 ticks, and states neither alpha nor beta. The
reproduction gives the distribution of the delay at four values of alpha. Delays are counted from tick 20,
after which the turn begins. A run counts as missed if the turn is not detected within its 20 ticks; this
includes runs with an earlier false alarm.

Deviations from the published text: the root in eq. (7) is |Sigma_0| / |Sigma_1| (published inverted); the
tested turn is the right one, p = 2, as in the experiment, not p = 1 as in the algorithm. k lambda_k is the
Shiryaev-Roberts statistic. alpha and beta are therefore not error probabilities, as the false-alarm rates
without a turn show.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.papers.reproduction import Cell, Finding, Reproduction, table_row
from baselines.papers.switch_detection import Detection, detect_switch
from hybrid_env.checks import check_integer
from hybrid_env.simulation import Simulation, simulate

PAPER = "Golubkov 2020"
SCHEME = "golubkov2020"
SWITCH = 20
"""Number of ticks before the turn."""

START = (0.0, 0.0, 0.0, 2.0)
"""State one tick before the first measurement, [x, vx, y, vy] [m, m/s]."""

RIGHT_TURN = 2  # p = 2
ALPHAS = (0.1, 0.05, 0.01, 0.001)
PUBLISHED_DELAY = 12
"""Delay of the published realisation [ticks]."""

PERCENTILES = (5, 25, 50, 75, 95)
HORIZON = 60
"""Length of the turn in the identification study [ticks]."""

IDENTIFICATION = {"3 hypotheses": (5.0,), "21 hypotheses": tuple(float(radius) for radius in range(1, 11))}
"""Turn radii of each bank in the identification study [m]."""

PUBLISHED_TABLE = "Detection delay of the published realisation, ticks"
DISTRIBUTION = "Distribution of the delay"
DELAY_INTERVAL = "The interval contains 95 % of the delays of single runs."
BOOTSTRAP_INTERVAL = "The interval is the 95 % bootstrap confidence interval over all runs."


def run_detector(recording: Simulation, alpha: float, **options: Any) -> Detection:
    """Run the paper's detector of a right turn; options are those of `detect_switch`."""
    return detect_switch(recording.measurements, START, tested=[RIGHT_TURN], alpha=alpha, **options)


def delay_statistics(ticks: NDArray[np.int64]) -> dict[str, float]:
    """Rates of false alarms and missed turns [%], mean and quantiles of the delay [ticks].

    Args:
        ticks: (n,) detection tick of each run, 0 if there is none.
    """
    delays = ticks[ticks > SWITCH] - SWITCH
    statistics = {"false alarms by tick 20, %": 100.0 * float(((ticks > 0) & (ticks <= SWITCH)).mean())}
    statistics["mean delay"] = float(delays.mean()) if delays.size else math.nan
    for percentile in PERCENTILES:
        statistics[f"{percentile} % quantile"] = (
            float(np.percentile(delays, percentile)) if delays.size else math.nan
        )
    return statistics | {"missed by tick 40, %": 100.0 * (1.0 - delays.size / ticks.size)}


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Distribution of the detection delay, false alarms without a turn, and identification of the turn.

    Args:
        runs: number of runs, at least 2; the identification study uses a quarter of them.
        seed: seed of the simulated recordings.

    Raises:
        ArgumentError: `runs` or `seed` is out of range.
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
        low, high = np.percentile(delays, [2.5, 97.5]) if delays.size else (math.nan, math.nan)
        value = ([statistics["mean delay"]], [low], [high])
        cells += table_row(PUBLISHED_TABLE, row, ["delay"], [PUBLISHED_DELAY], value, 1, DELAY_INTERVAL)
        interval = ([*statistics.values()], *_bootstrap_interval(detection.ticks, seed))
        nothing = [math.nan] * len(statistics)
        cells += table_row(DISTRIBUTION, row, statistics, nothing, interval, 2, BOOTSTRAP_INTERVAL)
        false_alarms = 100.0 * (run_detector(no_turn, alpha).ticks > 0).mean()
        published_root = delay_statistics(run_detector(recording, alpha, published_root=True).ticks)
        findings += [
            Finding(
                f"{row}: false alarms in 40 ticks without a turn",
                f"{false_alarms:.2f} %",
                f"{100 * alpha:g} %",
            ),
            Finding(
                f"{row}: root of eq. (7) as published",
                f"mean delay {published_root['mean delay']:.1f}, "
                f"missed {published_root['missed by tick 40, %']:.1f} %",
            ),
        ]
        examples[row] = (recording, detection)
    findings += _identification(max(runs // 4, 2), seed)
    return Reproduction(PAPER, runs, seed, tuple(cells), tuple(findings), examples)


def _bootstrap_interval(ticks: NDArray[np.int64], seed: int) -> NDArray[np.float64]:
    """Bounds of the 95 % bootstrap confidence intervals of the `delay_statistics`, (2, S)."""
    generator = np.random.default_rng(seed)
    values = [list(delay_statistics(generator.choice(ticks, ticks.size)).values()) for _ in range(200)]
    return np.asarray(np.nanpercentile(values, [2.5, 97.5], axis=0), np.float64)


def _identification(runs: int, seed: int) -> list[Finding]:
    """Identification of the turn at an unknown time, which the paper names as future work.

    All turns are equally frequent.
    """
    findings = []
    for name, radii in IDENTIFICATION.items():
        turns = [(side, radius) for side in "LR" for radius in radii]
        parts = [
            simulate(
                f"S{SWITCH} {side}{HORIZON}r{radius:g}", max(runs // len(turns), 1), seed + index, start=START
            )
            for index, (side, radius) in enumerate(turns)
        ]
        measurements = np.concatenate([part.measurements for part in parts])
        truth = np.repeat(np.arange(1, len(turns) + 1), [len(part.measurements) for part in parts])
        for margin in (0.0, math.log(9.0), math.log(99.0)):
            detection = detect_switch(measurements, START, radii=radii, alpha=0.01, margin=margin)
            detected = detection.ticks > SWITCH
            correct_sides = (detection.modes > len(radii)) == (truth > len(radii))
            rule = "no margin" if margin == 0.0 else f"margin ln {math.exp(margin):.0f} over every other turn"
            findings.append(
                Finding(
                    f"identification of the turn, {name}, alpha = 0.01, {rule}",
                    f"correct direction {100 * correct_sides[detected].mean():.1f} %, correct turn "
                    f"{100 * (detection.modes == truth)[detected].mean():.1f} %, mean delay "
                    f"{(detection.ticks[detected] - SWITCH).mean():.1f} ticks, not detected within {HORIZON} "
                    f"ticks {100 * (detection.ticks == 0).mean():.1f} %",
                    "named as future work",
                )
            )
    return findings
