"""Filters on the radar data set: errors and forecasts of the test flights."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines import Scores
from studies.papers.figures import new_figure
from studies.papers.report import markdown_table
from studies.radar.dataset import (
    COLUMNS,
    HORIZONS,
    STATISTICS,
    RadarData,
    score_estimates,
)
from studies.radar.filters import (
    COMBINED,
    CONTENDERS,
    ROBUST,
    SLOW,
    THESIS,
    filter_tracks,
)
from studies.radar.network import UPDATES, filter_with, radar_net
from studies.radar.parallel import Progress, run_calls, silent
from studies.radar.radars import NOISES, Noise
from studies.radar.reproduction import TRIALS, tune_filters
from studies.radar.tables import NOISE_NAMES

FILTERS = (*THESIS, "CV", "IMM (CV, CA)", *ROBUST, *SLOW, COMBINED)
NETWORK = "recurrent network"
ERRORS = (10, 20, 50, 100, 200, 500)
Found = Mapping[Noise, Sequence[Scores]]
Figures = Mapping[Noise, Mapping[str, Mapping[str, Any]]]


def score_radar_data(
    data: RadarData,
    folder: Path,
    trials: int = TRIALS,
    updates: int = UPDATES,
    jobs: int = 1,
    progress: Progress = silent,
) -> Found:
    """Return the scores of all filters by noise, those of the thesis first, tuned and trained on
    the training flights.

    A killed run goes on from the trials and weights in the folder. Trials of each tuning, updates
    of the network; see `reproduction.reproduce`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    parameters = tune_filters(
        data.tracks["training"],
        data.seed,
        folder,
        trials,
        jobs,
        progress,
        (*ROBUST, *SLOW),
    )
    net = radar_net(
        data,
        folder / "network.safetensors",
        lambda update: progress(NETWORK, update, updates),
        updates,
    )
    named = product(NOISES, FILTERS)
    calls = {
        (noise, name): partial(score_filter, name, parameters[noise][name], data, noise)
        for noise, name in named
    }
    found = run_calls(calls, jobs, progress, "test flights")
    scores = {noise: [found[noise, name] for name in FILTERS] for noise in NOISES}
    for noise, tracks in data.tracks["test"].items():
        filtered = filter_with(
            net,
            tracks.measurements.swapaxes(0, 1),
            tracks.times.T,
        )
        scores[noise].append(score_estimates(NETWORK, filtered, data, noise))
    return scores


def score_filter(
    name: str,
    parameters: Mapping[str, float],
    data: RadarData,
    noise: Noise,
) -> Scores:
    """Return the scores of one filter."""
    filtered = filter_tracks(
        CONTENDERS[name],
        parameters,
        data.tracks["test"][noise],
        HORIZONS,
    )
    return score_estimates(name, filtered, data, noise)


def radar_tables(found: Found) -> str:
    """Return a table for each noise, in Markdown: RMSE and half width of its 95 % interval, true
    positions in the stated 95 % region, and the interval of the ratio of the position RMSE to that
    of the best filter of the thesis on the same flights.
    """
    position = STATISTICS["position"]
    ahead = [f"{horizon:g} s ahead, m" for horizon in HORIZONS]
    text = ""
    for noise, scores in found.items():
        of_thesis = scores[: len(THESIS)]
        best = min(of_thesis, key=lambda filtered: float(filtered.curve(position)[0]))
        rows = []
        for filtered in scores:
            *plain, first, second, third = (filtered.estimate(STATISTICS[name]) for name in COLUMNS)
            cells = [
                f"{figure.value:.{digits}f} ± {(figure.high - figure.low) / 2:.{digits}f}"
                for figure, digits in zip(plain, (2, 2, 1, 1, 1), strict=True)
            ]
            shares = [100.0 * covered.value for covered in (first, second, third)]
            cells.append("-" if np.isnan(shares[0]) else " ".join(f"{part:.0f}" for part in shares))
            ratio = filtered.ratio(best, position)
            cells.append("" if filtered is best else f"{ratio.low:.2f} to {ratio.high:.2f}")
            rows.append((filtered.name, *cells))
        heads = (NOISE_NAMES[noise], "position, m", "velocity, m/s", *ahead, "covered, %", "ratio")
        text += markdown_table(heads, rows) + "\n"
    return text


def radar_json(found: Found) -> Figures:
    """Return the figures by noise, filter and column."""
    return {
        noise: {
            filtered.name: {name: filtered.estimate(STATISTICS[name]) for name in COLUMNS}
            for filtered in scores
        }
        for noise, scores in found.items()
    }


def radar_figure(found: Figures) -> Figure:
    """Return the errors of all filters now and ahead, from `radar_json`, one panel for each
    noise.
    """
    title = "RMSE of the position, with its 95 % interval"
    figure, panels = new_figure(
        title,
        (11.5, 5.6),
        (1.0,) * len(found),
    )
    marks = dict(zip(("position", *COLUMNS[2 : 2 + len(HORIZONS)]), "os^D", strict=True))
    for axes, (noise, filters) in zip(panels, found.items(), strict=True):
        for column, marker in marks.items():
            estimates = [of_filter[column] for of_filter in filters.values()]
            values = np.array([estimate.value for estimate in estimates])
            low = values - [estimate.low for estimate in estimates]
            high = [estimate.high for estimate in estimates] - values
            axes.errorbar(
                values,
                range(len(filters)),
                xerr=[low, high],
                fmt=marker,
                markersize=5,
                label="now" if column == "position" else f"{column.split()[1]} s ahead",
            )
        axes.set(
            title=NOISE_NAMES[noise],
            xscale="log",
            xlabel="m",
        )
        axes.set_yticks(range(len(filters)), list(filters))
        axes.invert_yaxis()
        axes.set_xticks(ERRORS, [f"{error:g}" for error in ERRORS])
        axes.minorticks_off()
    panels[0].legend()
    return figure
