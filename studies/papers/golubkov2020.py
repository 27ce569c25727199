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

The paper leaves open which of several turns has begun. Here the same detector tests the 20 turns of
Golubkov 2018, and names one at the first tick at which its lambda_k reaches A and all other turns
together have at most a given posterior probability, the error. All turns are equally probable
before.
"""

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from baselines import RestartDecider, sprt_thresholds
from hybrid_env import QuickestOptions
from studies.papers.published import FloatArray, IntArray, Reproduction, intervals, table_row
from studies.papers.setting import GOLUBKOV_2018, Setting
from studies.papers.setting import GOLUBKOV_2020 as SETTING

# Number of straight ticks.
SWITCH = 20
# For the naming of turns: alpha = beta of the detection, and errors that are allowed.
NAMING_ALPHA = 0.01
ERRORS = (1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
BANKS: tuple[Literal["published", "anchor_aware"], ...] = ("published", "anchor_aware")
NAMING = "Detection with identification"
BOOTSTRAP_INTERVAL = "The interval is the 95 % bootstrap confidence interval over all runs."


def run_detector(
    measurements: FloatArray,
    setting: Setting,
    variance: float,
    threshold: float,
    window: int,
    bank: Literal["published", "anchor_aware"] = "published",
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
    rule = RestartDecider(options, threshold, 0.0, window, bank, mean=True)
    straight = np.full(options.hypotheses, -math.inf)
    straight[0] = 0.0
    row = np.concatenate([[0.0, 0.0], setting.start, np.eye(4)[np.triu_indices(4)], straight])
    rows = np.tile(row, (len(measurements), 1))
    _, filters = rule.predict(rows)
    for measured in measurements.swapaxes(0, 1):
        rows[:, :2] = measured
        stated, filters = rule.predict(rows, filters)
        yield stated, filters


def ratios_of(
    measurements: FloatArray,
    setting: Setting,
    variance: float,
    bank: Literal["published", "anchor_aware"] = "published",
) -> FloatArray:
    """Return ln lambda_k of every turn after every tick, (n, T, turns), of a detector that never
    decides.
    """
    window = measurements.shape[1]
    # No ratio reaches the threshold.
    ticks = run_detector(measurements, setting, variance, 1e9, window, bank)
    return np.stack([filters.log_ratios[:, 1:].copy() for _, filters in ticks], axis=1)


def name_turns(ratios: FloatArray, threshold: float, error: float) -> tuple[IntArray, IntArray]:
    """Return the named turns (n,), -1 if undecided, and the ticks of the naming (n,), from ln
    lambda_k (n, T, turns), ln A and the largest probability of all other turns.
    """
    best = ratios.argmax(2)
    relative = np.exp(ratios - ratios.max(2, keepdims=True))
    others = 1.0 - 1.0 / relative.sum(2)
    named = (ratios.max(2) >= threshold) & (others <= error)
    first = named.argmax(1)
    turns = best[np.arange(len(best)), first]
    return np.where(named.any(1), turns, -1), first + 1


def naming_statistics(values: FloatArray) -> FloatArray:
    """Return shares of namings [%] and the mean delay [ticks], (..., 4), from means of 0 or 1 for
    named, named right, right side, and of the delays of named turns, (..., 4).
    """
    named, right, side, delay = np.moveaxis(values, -1, 0)
    some = np.where(named > 0.0, named, np.nan)
    parts = [100.0 * right / some, 100.0 * side / some, 100.0 * (1.0 - named), delay / some]
    return np.stack(parts, axis=-1)


def identification(runs: int, seed: int) -> list[pd.DataFrame]:
    """Return how often the right one of 20 turns is named, over the error that is allowed: where
    the published turn begins, and where each turn begins equally often.
    """
    variance = SETTING.variances["R"]
    setting = replace(SETTING, radii=GOLUBKOV_2018.radii)
    radii = setting.signed_radii[1:]
    each = max(runs // radii.size, 1)
    schemes = [f"S20 {'L' if radius > 0.0 else 'R'}20r{abs(radius):g}" for radius in radii]
    drawn = [
        setting.simulate(each, seed + k, variance, scheme=scheme)
        for k, scheme in enumerate(schemes)
    ]
    published = setting.simulate(runs, seed, variance)
    worlds = {
        "published turn": ([published], np.full(runs, radii.tolist().index(-5.0))),
        "every turn": (drawn, np.repeat(np.arange(radii.size), each)),
    }
    rows = []
    for (world, (recordings, truth)), bank in product(worlds.items(), BANKS):
        measurements = np.concatenate([recording.measurements for recording in recordings])
        ratios = ratios_of(measurements, setting, variance, bank)
        for error in ERRORS:
            turns, ticks = name_turns(ratios, sprt_thresholds(NAMING_ALPHA)[0], error)
            named = turns >= 0
            # A turn that is named before it begins is a wrong one.
            begun = named & (ticks > SWITCH)
            right = begun & (turns == truth)
            side = begun & (radii[turns] * radii[truth] > 0.0)
            values = np.stack([named, right, side, named * (ticks - SWITCH)], axis=1)
            results = intervals(values.astype(float), naming_statistics, seed, len(values))
            rows.append(
                table_row(
                    f"{NAMING}, {world}, {bank.replace('_', '-')} bank",
                    f"error {error:g}",
                    ("turn right, %", "side right, %", "undecided, %", "delay, ticks"),
                    math.nan,
                    results[:3],
                    1,
                    f"{BOOTSTRAP_INTERVAL} The shares of right ones are those of named turns.",
                )
            )
    return rows


def naming_figure(cells: pd.DataFrame) -> Figure:
    """Draw the share of right names over the share of undecided runs, from cells of
    `identification`; the errors stand beside the last curve.
    """
    figure = Figure(figsize=(8.0, 5.0), layout="constrained", dpi=110)
    axes = figure.subplots()
    for table, here in cells.groupby("table", sort=False):
        curve = here.pivot(index="row", columns="column", values="ours")
        curve = curve.sort_index(ascending=False)
        axes.plot(
            curve["undecided, %"],
            curve["turn right, %"],
            marker="o",
            label=str(table).removeprefix(f"{NAMING}, "),
        )
    for row, undecided, right in curve[["undecided, %", "turn right, %"]].itertuples():
        axes.annotate(
            row, (undecided, right), textcoords="offset points", xytext=(-8, 2), ha="right"
        )
    axes.set(xlabel="undecided, % of runs", ylabel="right, % of named turns", xlim=(0.0, 102.0))
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left")
    return figure


def delays_after(ticks: IntArray, switch: int = SWITCH) -> IntArray:
    """Return the delays of the runs that detect the turn after a number of straight ticks, from
    the ticks of detection, (n,).
    """
    return ticks[ticks > switch] - switch


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
                BOOTSTRAP_INTERVAL,
            )
        )
    of_naming = identification(runs, seed)
    return Reproduction(
        SETTING.paper,
        runs,
        seed,
        rows + of_naming,
        (),
        size="one run",
        figure=naming_figure(pd.concat(of_naming)),
    )
