"""Filters on the radar data set: errors and forecasts of the test flights."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from matplotlib.figure import Figure

from baselines import Scores
from studies.pictures import draw_estimates
from studies.radar.dataset import HORIZONS, STATISTICS, RadarData, score_estimates
from studies.radar.filters import COMBINED, CONTENDERS, ROBUST, filter_tracks
from studies.radar.radars import NOISE_NAMES, Noise
from studies.radar.tuning import tune_filters
from studies.results import in_parallel, markdown_table, with_half

ByNoise = Mapping[Noise, Sequence[Scores]]
# The filter with which all filters are compared on the same flights. No filter of the thesis has a
# smaller error here, and none has a larger one in the tables of the thesis.
REFERENCE = "KF CV"


def score_radar_data(data: RadarData, folder: Path, trials: int, jobs: int) -> ByNoise:
    """Return the scores of all filters by noise, those of the thesis first, tuned on the training
    flights.

    A killed run goes on from the trials in the folder; see `tune_filters` for the arguments.
    """
    names = [name for name in CONTENDERS if name not in (ROBUST, COMBINED)]
    tuned = tune_filters(names, data.tracks["training"], data.seed, folder, trials, jobs, ROBUST)
    # With the parameters that the IMM and the robust update have alone.
    student = tuned["gaussian"][ROBUST]
    combined = tuned["gaussian"]["IMM (CV, CA)"] | {
        key: student[key] for key in ("degrees of freedom", "scale")
    }
    scores: dict[Noise, list[Scores]] = {}
    for noise, parameters in tuned.items():
        filters = parameters | {COMBINED: combined}
        calls = [joblib.delayed(score_filter)(*each, data, noise) for each in filters.items()]
        scores[noise] = in_parallel(calls, jobs, NOISE_NAMES[noise])
    return scores


def score_filter(
    name: str, parameters: Mapping[str, float], data: RadarData, noise: Noise
) -> Scores:
    """Return the scores of one filter."""
    tracks = data.tracks["test"][noise]
    filtered = filter_tracks(CONTENDERS[name], parameters, tracks, HORIZONS)
    return score_estimates(name, filtered, data, noise)


def radar_tables(by_noise: ByNoise) -> str:
    """Return a table for each noise, in Markdown: RMSE and half width of its 95 % interval, noise
    reduction ratio, forecasts at the farthest horizon, and the interval of the ratio of the
    position RMSE to that of the reference on the same flights.
    """
    farthest = f"{HORIZONS[-1]:g}"
    text = ""
    for noise, scores in by_noise.items():
        reference = next(of_filter for of_filter in scores if of_filter.name == REFERENCE)
        rows = []
        for of_filter in scores:
            estimates = {name: of_filter.estimate(value) for name, value in STATISTICS.items()}
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
                    with_half(estimates[f"ahead {farthest}"], 1),
                )
            )
        heads = (
            NOISE_NAMES[noise],
            "position: mean over the axes, m",
            "Euclidean (1.25), m",
            "noise reduction ratio",
            f"position / that of {REFERENCE}",
            "velocity: mean over the axes, m/s",
            f"position {farthest} s ahead, m",
        )
        text += markdown_table(heads, rows) + "\n"
    return text


def radar_json(by_noise: ByNoise) -> dict[str, Any]:
    """Return the estimates by noise, filter and column."""
    return {
        noise: {
            of_filter.name: {
                name: of_filter.estimate(statistic) for name, statistic in STATISTICS.items()
            }
            for of_filter in scores
        }
        for noise, scores in by_noise.items()
    }


def radar_figure(by_noise: ByNoise) -> Figure:
    """Return the errors of all filters now and ahead, one panel for each noise."""
    figure = Figure(figsize=(11.5, 5.6), layout="constrained", dpi=110)
    figure.suptitle("RMSE of the position, mean over the axes, with its 95 % interval")
    panels = figure.subplots(1, len(by_noise))
    labels = {"position": "now"} | {f"ahead {h:g}": f"{h:g} s ahead" for h in HORIZONS}
    for axes, (noise, scores) in zip(panels, by_noise.items(), strict=True):
        places = np.arange(len(scores))
        for (column, label), marker in zip(labels.items(), "os^D", strict=True):
            estimates = [of_filter.estimate(STATISTICS[column]) for of_filter in scores]
            draw_estimates(axes, places, estimates, True, fmt=marker, markersize=5, label=label)
        axes.set(title=NOISE_NAMES[noise], xscale="log", xlabel="m")
        ticks = (10, 20, 50, 100, 200, 500)
        axes.set_xticks(ticks, [str(tick) for tick in ticks])
        axes.minorticks_off()
        axes.set_yticks(places, [of_filter.name for of_filter in scores])
        axes.invert_yaxis()
        axes.grid(alpha=0.25)
    panels[0].legend()
    return figure
