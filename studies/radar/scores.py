"""Filters on the radar data set: errors and forecasts of the test flights."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from matplotlib.figure import Figure

from agents import markdown_table
from baselines import Scores
from studies.pictures import draw_estimates
from studies.radar.dataset import HORIZONS, STATISTICS, RadarData, score_estimates
from studies.radar.filters import COMBINED, CONTENDERS, ROBUST, SLOW, SOUND, THESIS, filter_tracks
from studies.radar.network import filter_with, radar_net
from studies.radar.radars import NOISE_NAMES, Noise
from studies.radar.tuning import tune_filters
from studies.results import in_parallel

ByNoise = Mapping[Noise, Sequence[Scores]]


def score_radar_data(
    data: RadarData,
    folder: Path,
    trials: int,
    updates: int,
    jobs: int,
) -> ByNoise:
    """Return the scores of all filters by noise, those of the thesis first, tuned and trained on
    the training flights.

    A killed run goes on from the trials and weights in the folder. Trials of each tuning, updates
    of the network; see `thesis.reproduce`.
    """
    robust = *ROBUST, *SLOW
    names = *THESIS, *SOUND
    tuned = tune_filters(
        names,
        data.tracks["training"],
        data.seed,
        folder,
        trials,
        jobs,
        robust,
    )
    net = radar_net(data, folder / "network.safetensors", updates)
    # With the parameters that the IMM and the robust update have alone.
    student = tuned["gaussian"]["CV, Student-t"]
    combined = tuned["gaussian"]["IMM (CV, CA)"] | {
        key: student[key] for key in ("degrees of freedom", "scale")
    }
    scores: dict[Noise, list[Scores]] = {}
    for noise, parameters in tuned.items():
        filters = {name: parameters[name] for name in (*names, *robust)} | {COMBINED: combined}
        calls = [joblib.delayed(score_filter)(*each, data, noise) for each in filters.items()]
        scores[noise] = in_parallel(calls, jobs, NOISE_NAMES[noise])
        tracks = data.tracks["test"][noise]
        filtered = filter_with(net, tracks.measurements, tracks.times)
        scores[noise].append(
            score_estimates(
                "recurrent network",
                filtered,
                data,
                noise,
            )
        )
    return scores


def score_filter(
    name: str,
    parameters: Mapping[str, float],
    data: RadarData,
    noise: Noise,
) -> Scores:
    """Return the scores of one filter."""
    tracks = data.tracks["test"][noise]
    filtered = filter_tracks(
        CONTENDERS[name],
        parameters,
        tracks,
        HORIZONS,
    )
    return score_estimates(
        name,
        filtered,
        data,
        noise,
    )


def radar_tables(by_noise: ByNoise) -> str:
    """Return a table for each noise, in Markdown: RMSE and half width of its 95 % interval, true
    positions in the stated 95 % region, and the interval of the ratio of the position RMSE to that
    of the best filter of the thesis on the same flights.
    """
    position = STATISTICS["position"]
    ahead = [f"{horizon:g} s ahead, m" for horizon in HORIZONS]
    text = ""
    for noise, scores in by_noise.items():
        best = min(scores[: len(THESIS)], key=lambda of_filter: of_filter.curve(position)[0])
        rows = []
        for of_filter in scores:
            values = [of_filter.estimate(statistic) for statistic in STATISTICS.values()]
            errors = zip(values, (2, 2, 1, 1, 1), strict=False)
            cells = [
                f"{value.value:.{digits}f} ± {(value.high - value.low) / 2:.{digits}f}"
                for value, digits in errors
            ]
            shares = " ".join(f"{100.0 * share.value:.0f}" for share in values[-len(HORIZONS) :])
            ratio = of_filter.ratio(best, position)
            compared = "" if of_filter is best else f"{ratio.low:.2f} to {ratio.high:.2f}"
            rows.append((of_filter.name, *cells, shares.replace("nan nan nan", "-"), compared))
        heads = NOISE_NAMES[noise], "position, m", "velocity, m/s", *ahead, "covered, %", "ratio"
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
    figure.suptitle("RMSE of the position, with its 95 % interval")
    panels = figure.subplots(1, len(by_noise))
    labels = {"position": "now"} | {f"ahead {h:g}": f"{h:g} s ahead" for h in HORIZONS}
    for axes, (noise, scores) in zip(panels, by_noise.items(), strict=True):
        places = np.arange(len(scores))
        for (column, label), marker in zip(labels.items(), "os^D", strict=True):
            estimates = [of_filter.estimate(STATISTICS[column]) for of_filter in scores]
            draw_estimates(
                axes,
                places,
                estimates,
                True,
                fmt=marker,
                markersize=5,
                label=label,
            )
        axes.set(title=NOISE_NAMES[noise], xscale="log", xlabel="m")
        axes.set_yticks(places, [of_filter.name for of_filter in scores])
        axes.invert_yaxis()
        axes.grid(alpha=0.25)
    panels[0].legend()
    return figure
