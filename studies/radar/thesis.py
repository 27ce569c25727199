"""Novospaskyi 2025, tables 3.1 to 3.6: flights, tuning on 30 % of them, parameters, and errors on
these flights and on the others, next to the published values.

Why KF CV has velocity errors of hundreds of metres per second in the thesis: its tuned R is about
1e-9 m^2, where the noise has 156 m^2. With discrete process noise and R / Q towards 0, the gains of
position and velocity approach 1 and 2 / t: v' = 2 (z_k - z_{k-1}) / t - v. The velocity error
changes sign at every measurement instead of decaying, and all the noise is summed. The position
error, which alone was tuned, hardly shows it.
"""

from collections.abc import Callable
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
from scipy.linalg import solve_discrete_are

from studies.filters.motion_models import MotionModel
from studies.papers.published import Finding, FloatArray, Reproduction, intervals, table_row
from studies.radar.filters import THESIS, UNTRIED
from studies.radar.flights import FLIGHTS, point_mass_flights
from studies.radar.radars import (
    NOISE_NAMES,
    NOISES,
    SIGMA,
    Noise,
    Scan,
    Tracks,
    measure,
    scan_flights,
)
from studies.radar.tuning import TRIALS, errors, tune_filters
from studies.results import in_parallel

METRICS = ("position RMSE, m", "position MAE, m", "velocity RMSE, m/s", "velocity MAE, m/s")
# The same errors by the formulas of the thesis, see `flight_errors`.
FORMULAS = (
    "position RMSE (1.25), m",
    "position MAE (1.26), m",
    "velocity RMSE (1.25), m/s",
    "velocity MAE (1.26), m/s",
)
UNFILTERED = "no filter"
PUBLISHED = "{}, published parameters"
TABLES: dict[Noise, str] = {
    "gaussian": "Table 3.5, Gaussian noise",
    "levy": "Table 3.6, Levy noise",
}
Errors = dict[Noise, dict[str, tuple[float, float, float, float]]]
# Tables 3.5 and 3.6: errors of the test flights, in the order of `METRICS`.
TEST_ERRORS: Errors = {
    "gaussian": {
        UNFILTERED: (12.512, 9.930, 24.042, 22.327),
        "g-h": (11.437, 8.420, 8.259, 5.230),
        "KF CV": (16.929, 12.099, 433.265, 300.787),
        "KF CA": (9.885, 7.867, 8.748, 6.348),
        "KF CJ": (12.052, 9.465, 12.775, 8.473),
    },
    "levy": {
        UNFILTERED: (41.798, 20.449, 24.042, 22.327),
        "g-h": (31.499, 18.396, 13.075, 7.675),
        "KF CV": (35.511, 20.397, 459.790, 313.543),
        "KF CA": (29.365, 19.008, 14.161, 9.269),
        "KF CJ": (31.439, 19.797, 19.585, 12.927),
    },
}
# Errors of the training flights.
TRAINING_ERRORS: Errors = {
    "gaussian": {
        UNFILTERED: (12.567, 10.007, 24.013, 22.125),
        "g-h": (11.552, 8.584, 8.395, 5.412),
        "KF CV": (15.087, 11.787, 451.977, 317.751),
        "KF CA": (9.695, 7.672, 8.830, 6.350),
        "KF CJ": (12.293, 9.658, 13.116, 8.727),
    },
    "levy": {
        UNFILTERED: (39.439, 20.444, 24.013, 22.125),
        "g-h": (29.230, 17.886, 12.384, 7.570),
        "KF CV": (33.845, 20.481, 474.622, 334.961),
        "KF CA": (27.277, 18.082, 13.244, 8.871),
        "KF CJ": (29.608, 19.132, 18.477, 12.410),
    },
}
# Tables 3.1 to 3.4: tuned parameters. The last two are window and ratio (its alpha) of the moving
# average, with the weight ratio^i for a measurement i scans old; before them are g and h, or the
# diagonal of R [m^2] and q (its sigma_q).
PARAMETERS: dict[Noise, dict[str, tuple[Any, ...]]] = {
    "gaussian": {
        "g-h": (0.737, 0.316, 2, 0.03),
        "KF CV": ((9e-10, 1.5e-9, 2e-4), 0.003, 2, 0.05),
        "KF CA": ((0.435, 0.725, 96658.6), 0.574, 10, 0.01),
        "KF CJ": ((0.008, 0.013, 1771.7), 0.008, 8, 0.001),
    },
    "levy": {
        "g-h": (0.490, 0.163, 13, 0.05),
        "KF CV": ((1.27e-4, 6.33e-5, 2.53e-4), 0.006, 3, 0.3),
        "KF CA": ((52233.5, 26116.7, 104466.9), 4.833, 13, 0.05),
        "KF CJ": ((52233.5, 26116.7, 104466.9), 1.274, 12, 0.05),
    },
}


def reproduce(
    runs: int = 10,
    seed: int = 0,
    *,
    folder: Path,
    flights: int = FLIGHTS,
    trials: int = TRIALS,
    jobs: int = 1,
) -> Reproduction:
    """Reproduce tables 3.1 to 3.6, with the g-h-k filter beside the filters of the thesis.

    Args:
        runs: number of seeds of the noise on the test flights, at least 1.
        seed: of flights, radars, noise and tuning.
        folder: for finished trials, from which a killed run goes on; it is created.
        flights: number of flights, at least 4.
        trials: number of trials of each tuning.
        jobs: number of processes for tunings and evaluations; the results do not depend on it.
    """
    scans, first = scan_flights(point_mass_flights(flights, seed), seed)
    training = {noise: measure(scans[:first], noise, (seed, 2)) for noise in NOISES}
    compared = *THESIS, *UNTRIED
    tuned = tune_filters(compared, training, seed, folder, trials, jobs)
    # The measurements for which the filters are tuned, and those with noise that no tuning has met.
    splits = {
        "training": (scans[:first], [(seed, 2)]),
        "test": (scans[first:], [(seed, 3, run) for run in range(runs)]),
    }
    calls = {}
    for noise in NOISES:
        filters: dict[str, tuple[str | None, dict[str, Any]]] = {UNFILTERED: (None, {})}
        filters |= {name: (name, parameters) for name, parameters in tuned[noise].items()}
        for name, values in PARAMETERS[noise].items():
            kinds = ("g", "h") if name == "g-h" else ("variances", "q")
            parameters = dict(zip((*kinds, "window", "ratio"), values, strict=True))
            filters[PUBLISHED.format(name)] = name, parameters
        for (label, chosen), (split, seen) in product(filters.items(), splits.items()):
            call = joblib.delayed(evaluate)(*chosen, noise, *seen)
            calls[noise, split, label] = call
    results = in_parallel([*calls.values()], jobs, "flights")
    by_filter = dict(zip(calls, results, strict=True))
    tests = {
        (noise, label): of_filter
        for (noise, split, label), of_filter in by_filter.items()
        if split == "test"
    }
    rows = []
    for noise in NOISES:
        for split, published in (("test", TEST_ERRORS), ("training", TRAINING_ERRORS)):
            title = TABLES[noise] + ("" if split == "test" else ", training flights")
            labels = {row: row for row in (UNFILTERED, *compared)}
            by_row = {row: by_filter[noise, split, label] for row, label in labels.items()}
            rows += _error_rows(title, published[noise], by_row, seed)
            labels = {row: PUBLISHED.format(row) for row in THESIS}
            by_row = {row: by_filter[noise, split, label] for row, label in labels.items()}
            title += ", with the published parameters"
            rows += _error_rows(title, published[noise], by_row, seed)
        rows += _formula_rows(noise, tests, seed)
        rows += _reduction_rows(noise, tests, seed)
    findings = [*_parameters(tuned), *_orders(tests)]
    return Reproduction("Novospaskyi 2025", runs, seed, rows, findings, size=f"{FLIGHTS} flights")


def evaluate(
    name: str | None,
    parameters: dict[str, Any],
    noise: Noise,
    scans: list[Scan],
    streams: list[tuple[int, ...]],
) -> FloatArray:
    """`tuning.errors` of a filter, or of no filter, on flights with the noise of each stream,
    (streams, F, 8).
    """
    parts = [vars(measure(scans, noise, stream)) for stream in streams]
    tracks = {key: np.concatenate([part[key] for part in parts], axis=1) for key in parts[0]}
    return errors(name, parameters, Tracks(**tracks)).reshape(len(streams), len(scans), -1)


def _error_rows(
    title: str,
    published: dict[str, tuple[float, float, float, float]],
    by_row: dict[str, FloatArray],
    seed: int,
) -> list[pd.DataFrame]:
    """Return the rows of a table of errors as means over the axes, of errors (runs, F, 8)."""
    rows = []
    for row, of_filter in by_row.items():
        rows.append(
            table_row(
                title,
                row,
                METRICS,
                published.get(row, (np.nan,) * 4),
                _of_flights(of_filter[..., :4], np.positive, seed),
                2,
                _note(of_filter),
                "noise and averaging were chosen from this row" if row == UNFILTERED else "",
            )
        )
    return rows


def _formula_rows(
    noise: Noise, tests: dict[tuple[Noise, str], FloatArray], seed: int
) -> list[pd.DataFrame]:
    """Return the rows of the errors of all settings by the formulas of the thesis."""
    rows = []
    for (of_noise, row), of_filter in tests.items():
        if of_noise == noise:
            rows.append(
                table_row(
                    f"{TABLES[noise]}, by the formulas of the thesis",
                    row,
                    FORMULAS,
                    np.nan,
                    _of_flights(of_filter[..., 4:], np.positive, seed),
                    2,
                    _note(of_filter),
                )
            )
    return rows


def _reduction_rows(
    noise: Noise, tests: dict[tuple[Noise, str], FloatArray], seed: int
) -> list[pd.DataFrame]:
    """Return the rows of the noise reduction ratio, the position RMSE over that of no filter."""
    published = TEST_ERRORS[noise]
    rows = []
    for row in (*THESIS, *UNTRIED):
        pair = np.stack([tests[noise, row][..., 0], tests[noise, UNFILTERED][..., 0]], axis=-1)
        rows.append(
            table_row(
                f"{TABLES[noise]}, noise reduction ratio",
                row,
                ("position RMSE / that of no filter",),
                [published[row][0] / published[UNFILTERED][0] if row in published else np.nan],
                _of_flights(pair, lambda means: means[..., :1] / means[..., 1:], seed),
                3,
                _note(pair),
            )
        )
    return rows


def _of_flights(
    of_filter: FloatArray, statistics: Callable[[FloatArray], FloatArray], seed: int
) -> list[FloatArray]:
    """Return `intervals` of errors (runs, F, n): those of a study of the size of the thesis, which
    has one noise for each flight, and our own, with flights as the runs.
    """
    count, size = of_filter.shape[1:]
    of_study = intervals(of_filter.reshape(-1, size), statistics, seed, count)
    of_means = intervals(of_filter.mean(0), statistics, seed)
    return [*of_study[:3], *of_means[3:]]


def _note(of_filter: FloatArray) -> str:
    return f"The interval contains 95 % of studies with {of_filter.shape[1]} flights."


def steady_gains(name: Any, ratio: float, step: float = 1.0) -> tuple[float, float]:
    """Return the gains of position and velocity, the latter times the step, of a Kalman filter of
    the thesis in its steady state with equal time steps [s]; `ratio` is R / q.
    """
    model = MotionModel(name, axes=1, noise=1.0, discretization="discrete")
    measured = np.eye(model.order)[:, :1]
    covariance = solve_discrete_are(
        model.transition(step).T, measured, model.step_noise(step), np.array([[ratio]])
    )
    gain = covariance[:, 0] / (covariance[0, 0] + ratio)
    return float(gain[0]), float(gain[1] * step)


def _parameters(tuned: dict[Noise, dict[str, dict[str, Any]]]) -> list[Finding]:
    """Tables 3.1 to 3.4: parameters of the filters beside the published ones. Of R and q only the
    ratio matters, so that a Kalman filter has its gains in their place.
    """

    def text(*values: float) -> str:
        return " ".join(f"{value:.3f}" for value in values)

    findings: list[Finding] = []
    for noise, name in product(NOISES, (*THESIS, *UNTRIED)):
        ours = tuned[noise][name]
        average = f"window {ours['window']}, ratio {ours['ratio']:.3f}"
        label = f"Tables 3.1 to 3.4, {NOISE_NAMES[noise]}, {name}: "
        if "q" not in ours:
            keys = [key for key in "ghk" if key in ours]
            result = text(*(ours[key] for key in keys))
            label += ", ".join(keys)
            claim = text(*PARAMETERS[noise][name][:2]) if name in PARAMETERS[noise] else ""
        else:
            kind = name.removeprefix("KF ")
            variances, q, *_ = PARAMETERS[noise][name]
            gains = [steady_gains(kind, variance / q) for variance in variances]
            position, velocity = (text(*each) for each in zip(*gains, strict=True))
            result = text(*steady_gains(kind, SIGMA**2 / ours["q"]))
            label += "steady gains of position and velocity at steps of 1 s"
            claim = f"{position} and {velocity} on x, y, z"
        if claim:
            *_, window, ratio = PARAMETERS[noise][name]
            claim += f"; window {window}, ratio {ratio:.3f}"
        findings.append((label, f"{result}; {average}", claim))
    return findings


def _orders(by_filter: dict[tuple[Noise, str], FloatArray]) -> list[Finding]:
    """In how many noise seeds the filters of the thesis have the order of its errors, from errors
    (runs, F, 8) by noise and name.
    """
    findings: list[Finding] = []
    for (noise, title), metric in product(NOISE_NAMES.items(), (0, 2)):
        ours = {name: by_filter[noise, name][..., metric].mean(1) for name in THESIS}
        order = sorted(THESIS, key=lambda name: TEST_ERRORS[noise][name][metric])
        pairs = (
            f"{first} before {second} {np.sum(ours[first] < ours[second])} of {len(ours[first])}"
            for first, second in pairwise(order)
        )
        label = f"noise seeds with each published pair of {METRICS[metric]}, {title}"
        findings.append((label, ", ".join(pairs), ""))
    return findings
