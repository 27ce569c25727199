"""Filters on the radar data set: errors on the test flights."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from baselines import Scores, Statistic
from studies.radar.dataset import RadarData
from studies.radar.filters import COMBINED, CONTENDERS, ROBUST, filter_tracks
from studies.radar.radars import NOISE_NAMES, Noise, flight_errors
from studies.radar.tuning import tune
from studies.results import in_parallel, markdown_table, with_half

# RMSE of flights: position [m] and velocity [m/s] as means over the axes, position by eq. (1.25) of
# the thesis [m], measurements as means over the axes [m]. See `flight_errors`.
COLUMNS = ("position", "velocity", "distance", "measured")
STATISTICS = {name: Statistic((name,), np.positive) for name in COLUMNS}
# The error that a filter leaves of that of the measurements.
STATISTICS["noise reduction ratio"] = Statistic(("position", "measured"), np.divide)
ByNoise = Mapping[Noise, Sequence[Scores]]
# The filter with which all filters are compared on the same flights. No filter of the thesis has a
# smaller error here, and none has a larger one in the tables of the thesis.
REFERENCE = "KF CV"


def score_radar_data(data: RadarData, folder: Path, trials: int, jobs: int) -> ByNoise:
    """Return the scores of all filters by noise, those of the thesis first, tuned on the training
    flights.

    A killed run goes on from the trials in the folder; see `tune` for the number of trials.
    """
    names = [name for name in CONTENDERS if name not in (ROBUST, COMBINED)]
    tuned = partial(
        joblib.delayed(tune),
        training=data.tracks["training"],
        trials=trials,
        seed=data.seed,
        folder=folder,
    )
    calls = [tuned(name, noise) for noise in NOISE_NAMES for name in names]
    results = iter(in_parallel(calls, jobs, "tuning"))
    by_noise = {noise: {name: next(results) for name in names} for noise in NOISE_NAMES}
    # For both noises, after the plain CV filter, with which it is compared.
    robustly = tuned(ROBUST, None, plain=by_noise["gaussian"]["CV"])
    [student] = in_parallel([robustly], jobs, "tuning of the robust filter")
    # With the parameters that the IMM and the robust update have alone.
    combined = by_noise["gaussian"]["IMM (CV, CA)"] | {
        key: student[key] for key in ("degrees of freedom", "scale")
    }
    scores: dict[Noise, list[Scores]] = {}
    for noise, parameters in by_noise.items():
        filters = parameters | {ROBUST: student, COMBINED: combined}
        calls = [joblib.delayed(score_filter)(*each, data, noise) for each in filters.items()]
        scores[noise] = in_parallel(calls, jobs, NOISE_NAMES[noise])
    return scores


def score_filter(
    name: str, parameters: Mapping[str, float], data: RadarData, noise: Noise
) -> Scores:
    """Return the scores of one filter."""
    tracks = data.tracks["test"][noise]
    filtered = filter_tracks(CONTENDERS[name], parameters, tracks)
    position, distance = flight_errors(filtered.positions, tracks.positions).T
    velocity, _ = flight_errors(filtered.velocities, tracks.velocities).T
    measured, _ = flight_errors(tracks.measurements, tracks.positions).T
    values = np.column_stack([position, velocity, distance, measured])
    return Scores(name, "", (0.0,), COLUMNS, values[..., None])


def radar_tables(by_noise: ByNoise) -> tuple[str, dict[str, Any]]:
    """Return a table for each noise, in Markdown, and the estimates by noise, filter and statistic:
    RMSE and half width of its 95 % interval, noise reduction ratio, and the interval of the ratio
    of the position RMSE to that of the reference on the same flights.
    """
    text = ""
    content: dict[str, Any] = {}
    for noise, scores in by_noise.items():
        reference = next(of_filter for of_filter in scores if of_filter.name == REFERENCE)
        content[noise] = {}
        rows = []
        for of_filter in scores:
            estimates = {name: of_filter.estimate(value) for name, value in STATISTICS.items()}
            content[noise][of_filter.name] = estimates
            ratio = of_filter.ratio(reference, STATISTICS["position"])
            compared = f"{ratio.low:.2f} to {ratio.high:.2f}"
            rows.append(
                (
                    of_filter.name,
                    with_half(estimates["position"], 2),
                    f"{estimates['distance'].value:.1f}",
                    f"{estimates['noise reduction ratio'].value:.2f}",
                    "1" if of_filter is reference else compared,
                    with_half(estimates["velocity"], 2),
                )
            )
        heads = (
            NOISE_NAMES[noise],
            "position: mean over the axes, m",
            "Euclidean (1.25), m",
            "noise reduction ratio",
            f"position / that of {REFERENCE}",
            "velocity: mean over the axes, m/s",
        )
        text += markdown_table(heads, rows) + "\n"
    return text, content
