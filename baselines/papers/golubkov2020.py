"""Golubkov 2020, detection of a right turn at an unknown moment: settings, study, analysis.

The print shows one realisation ("12 ticks") and names neither alpha nor beta; here the delay's distribution
is given at four of them. The delay counts from tick 20. A run counts as missed if nothing is detected in the
20 ticks of the turn, a false alarm before them included.

Where this departs from the print: the root of eq. (7) is |Sigma_0| / |Sigma_1| (printed inverted); the turn
tested is the right one, p = 2, as in the experiment, not p = 1 as in the algorithm. k lambda_k is the
Shiryaev-Roberts statistic: alpha and beta are no error rates, which the false alarms without a turn show.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.papers.reproduction import Cell, Finding, Reproduction
from baselines.recordings.change_detection import Detection, detect_switch
from hybrid_env.checks import check_integer
from hybrid_env.simulation import Simulation, simulate

PAPER = "Golubkov 2020"
SCHEME = "golubkov2020"
SWITCH = 20  # ticks before the turn
START = (0.0, 0.0, 0.0, 2.0)
RIGHT_TURN = 2  # p = 2
ALPHAS = (0.1, 0.05, 0.01, 0.001)
PUBLISHED_DELAY = 12  # ticks, of the one realisation shown
PERCENTILES = (5, 25, 50, 75, 95)
HORIZON = 60  # ticks of the turn in the study of identification
IDENTIFICATION = {"3 hypotheses": (5.0,), "21 hypotheses": tuple(float(radius) for radius in range(1, 11))}


def watch(recording: Simulation, alpha: float, **options: Any) -> Detection:
    """The paper's detector of a right turn."""
    return detect_switch(recording.measurements, START, tested=[RIGHT_TURN], alpha=alpha, **options)


def delay_figures(ticks: NDArray[np.int64]) -> dict[str, float]:
    """False alarms [%], mean and percentiles of the delay [ticks], missed [%]."""
    delays = ticks[ticks > SWITCH] - SWITCH
    figures = {"false alarms by tick 20, %": 100.0 * float(((ticks > 0) & (ticks <= SWITCH)).mean())}
    figures["mean delay"] = float(delays.mean()) if delays.size else math.nan
    for percentile in PERCENTILES:
        figures[f"{percentile} % of delays"] = (
            float(np.percentile(delays, percentile)) if delays.size else math.nan
        )
    return figures | {"missed by tick 40, %": 100.0 * (1.0 - delays.size / ticks.size)}


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """The distribution behind the published realisation, and what alpha means without a turn."""
    runs = check_integer("runs", runs, minimum=2)
    recording = simulate(SCHEME, runs, seed, start=START)
    quiet = simulate(f"S{2 * SWITCH}", runs, seed + 1, start=START)
    cells: list[Cell] = []
    findings: list[Finding] = []
    pictures: dict[str, Any] = {}
    for alpha in ALPHAS:
        found = watch(recording, alpha)
        row = f"alpha = {alpha:g}"
        figures = delay_figures(found.ticks)
        delays = found.ticks[found.ticks > SWITCH] - SWITCH
        low, high = np.percentile(delays, [2.5, 97.5]) if delays.size else (math.nan, math.nan)
        cells.append(
            Cell("Delay of the one realisation shown, ticks", row, "delay", PUBLISHED_DELAY,
                 figures["mean delay"], float(low), float(high), 1)
        )  # fmt: skip
        cells += [
            Cell("Distribution", row, name, math.nan, value, *_bounds(found.ticks, name, seed), 2)
            for name, value in figures.items()
        ]
        alarms = 100.0 * (watch(quiet, alpha).ticks > 0).mean()
        printed = delay_figures(watch(recording, alpha, printed_sign=True).ticks)
        findings.append(
            Finding(f"{row}: alarms in 40 ticks without a turn", f"{alarms:.2f} %", f"{100 * alpha:g} %")
        )
        findings.append(
            Finding(
                f"{row}: root of eq. (7) as printed",
                f"mean delay {printed['mean delay']:.1f}, missed {printed['missed by tick 40, %']:.1f} %",
            )
        )
        pictures[row] = (recording, found)
    findings += _identification(max(runs // 4, 2), seed)
    return Reproduction(PAPER, runs, seed, tuple(cells), tuple(findings), pictures)


def _bounds(ticks: NDArray[np.int64], name: str, seed: int) -> tuple[float, float]:
    """95 % bootstrap interval of one figure of `delay_figures` over our runs."""
    generator = np.random.default_rng(seed)
    values = [delay_figures(generator.choice(ticks, ticks.size))[name] for _ in range(200)]
    low, high = np.nanpercentile(values, [2.5, 97.5])
    return float(low), float(high)


def _identification(runs: int, seed: int) -> list[Finding]:
    """The paper's future work: which turn it is, at an unknown moment, every turn equally likely."""
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
            found = detect_switch(measurements, START, radii=radii, alpha=0.01, margin=margin)
            hit = found.ticks > SWITCH
            sides = (found.modes > len(radii)) == (truth > len(radii))
            rule = (
                "at detection" if margin == 0.0 else f"and ahead of every other by ln {math.exp(margin):.0f}"
            )
            findings.append(
                Finding(
                    f"which turn, {name}, alpha = 0.01, {rule}",
                    f"side right {100 * sides[hit].mean():.1f} %, turn right "
                    f"{100 * (found.modes == truth)[hit].mean():.1f} %, mean delay "
                    f"{(found.ticks[hit] - SWITCH).mean():.1f} ticks, none within {HORIZON}: "
                    f"{100 * (found.ticks == 0).mean():.1f} %",
                    "named as future work",
                )
            )
    return findings
