"""Filters on the radar data set: errors and forecasts of the test flights."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from matplotlib.figure import Figure

from agents import markdown_table
from baselines import Scores
from studies.radar.dataset import HORIZONS, STATISTICS, RadarData, score_estimates
from studies.radar.filters import COMBINED, CONTENDERS, ROBUST, SLOW, THESIS, filter_tracks
from studies.radar.network import UPDATES, filter_with, radar_net
from studies.radar.radars import NOISE_NAMES, Noise
from studies.radar.tuning import TRIALS, tune_filters
from studies.results import in_parallel

ByNoise = Mapping[Noise, Sequence[Scores]]


def score_radar_data(
    data: RadarData,
    folder: Path,
    trials: int = TRIALS,
    updates: int = UPDATES,
    jobs: int = 1,
) -> ByNoise:
    """Return the scores of all filters by noise, those of the thesis first, tuned and trained on
    the training flights.

    A killed run goes on from the trials and weights in the folder. Trials of each tuning, updates
    of the network; see `thesis.reproduce`.
    """
    training = data.tracks["training"]
    tuned = tune_filters(
        training,
        data.seed,
        folder,
        trials,
        jobs,
        (*ROBUST, *SLOW),
    )
    net = radar_net(
        data,
        folder / "network.safetensors",
        updates,
    )
    names = (
        *THESIS,
        "CV",
        "IMM (CV, CA)",
        *ROBUST,
        *SLOW,
        COMBINED,
    )
    scores: dict[Noise, list[Scores]] = {}
    for noise, parameters in tuned.items():
        calls = [
            joblib.delayed(score_filter)(name, parameters[name], data, noise) for name in names
        ]
        scores[noise] = in_parallel(calls, jobs, NOISE_NAMES[noise])
    for noise, tracks in data.tracks["test"].items():
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
        of_thesis = scores[: len(THESIS)]
        best = min(of_thesis, key=lambda filtered: float(filtered.curve(position)[0]))
        rows = []
        for filtered in scores:
            figures = [filtered.estimate(statistic) for statistic in STATISTICS.values()]
            cells = [
                f"{figure.value:.{digits}f} ± {(figure.high - figure.low) / 2:.{digits}f}"
                for figure, digits in zip(figures, (2, 2, 1, 1, 1), strict=False)
            ]
            shares = [100.0 * covered.value for covered in figures[-len(HORIZONS) :]]
            cells.append("-" if np.isnan(shares[0]) else " ".join(f"{part:.0f}" for part in shares))
            ratio = filtered.ratio(best, position)
            cells.append("" if filtered is best else f"{ratio.low:.2f} to {ratio.high:.2f}")
            rows.append((filtered.name, *cells))
        heads = (
            NOISE_NAMES[noise],
            "position, m",
            "velocity, m/s",
            *ahead,
            "covered, %",
            "ratio",
        )
        text += markdown_table(heads, rows) + "\n"
    return text


def radar_json(by_noise: ByNoise) -> dict[str, Any]:
    """Return the figures by noise, filter and column."""
    return {
        noise: {
            filtered.name: {
                name: filtered.estimate(statistic).as_json()
                for name, statistic in STATISTICS.items()
            }
            for filtered in scores
        }
        for noise, scores in by_noise.items()
    }


def radar_figure(by_noise: ByNoise) -> Figure:
    """Return the errors of all filters now and ahead, one panel for each noise."""
    figure = Figure(
        figsize=(11.5, 5.6),
        layout="constrained",
        dpi=110,
    )
    figure.suptitle("RMSE of the position, with its 95 % interval")
    panels = figure.subplots(1, len(by_noise))
    columns = ["position", *(f"ahead {horizon:g}" for horizon in HORIZONS)]
    for axes, (noise, scores) in zip(panels, by_noise.items(), strict=True):
        for column, marker in zip(columns, "os^D", strict=True):
            estimates = [filtered.estimate(STATISTICS[column]) for filtered in scores]
            value, low, high = np.array([[*vars(each).values()] for each in estimates]).T
            axes.errorbar(
                value,
                range(len(scores)),
                xerr=[value - low, high - value],
                fmt=marker,
                markersize=5,
                label="now" if column == "position" else f"{column.split()[1]} s ahead",
            )
        axes.set(
            title=NOISE_NAMES[noise],
            xscale="log",
            xlabel="m",
        )
        axes.set_yticks(range(len(scores)), [filtered.name for filtered in scores])
        axes.invert_yaxis()
        axes.grid(alpha=0.25)
    panels[0].legend()
    return figure
