"""Filters on the radar data set: errors and forecasts of the test flights."""

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from rich.table import Table

from agents.evaluation.cells import bounds_cell, estimate_cell, filled_table
from agents.figures.canvas import new_canvas, plain_axes
from agents.figures.curves import error_bars
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores
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
Figures = Mapping[Noise, Mapping[str, Mapping[str, Estimate]]]


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
    found = run_calls(calls, jobs, lambda done: progress("test flights", done, len(calls)))
    scores = {noise: [found[noise, name] for name in FILTERS] for noise in NOISES}
    for noise, tracks in data.tracks["test"].items():
        filtered = filter_with(net, tracks.measurements.swapaxes(0, 1), tracks.times.T)
        scores[noise].append(score_estimates(NETWORK, filtered, data, noise))
    return scores


def score_filter(
    name: str,
    parameters: Mapping[str, float],
    data: RadarData,
    noise: Noise,
) -> Scores:
    """Return the scores of one filter."""
    filtered = filter_tracks(CONTENDERS[name], parameters, data.tracks["test"][noise], HORIZONS)
    return score_estimates(name, filtered, data, noise)


def radar_tables(found: Found) -> list[Table]:
    """Return a table for each noise."""
    heads = ["filter", "position\nm", "velocity\nm/s", *(f"{h:g} s\nahead, m" for h in HORIZONS)]
    heads += ["covered\n%", "position,\nratio"]
    tables = []
    for noise, scores in found.items():
        best = min(
            scores[: len(THESIS)],
            key=lambda one: float(one.curve(STATISTICS["position"])[0]),
        )
        rows = []
        for one in scores:
            figures = [one.estimate(STATISTICS[name]) for name in COLUMNS]
            plain = figures[: -len(HORIZONS)]
            covered = figures[-len(HORIZONS) :]
            cells = [
                estimate_cell(figure, 1.0, 1 if k > 1 else 2) for k, figure in enumerate(plain)
            ]
            shares = " ".join(
                "-" if share.value != share.value else f"{100 * share.value:.0f}"
                for share in covered
            )
            ratio = "" if one is best else bounds_cell(one.ratio(best, STATISTICS["position"]), 2)
            rows.append((one.name, *cells, shares, ratio))
        notes = (
            f"RMSE and half width of its 95 % interval, {scores[0].episodes} flights; covered: true"
            " positions in the stated 95 % region 1, 2 and 5 s ahead; ratio: to the best filter of"
            f" the thesis, {best.name}, on the same flights, with its 95 % interval."
        )
        tables.append(filled_table(f"Radar tracks, {NOISE_NAMES[noise]}", heads, rows, notes))
    return tables


def radar_json(found: Found) -> Figures:
    """Return the figures by noise, filter and column."""
    return {
        noise: {
            one.name: {name: one.estimate(STATISTICS[name]) for name in COLUMNS} for one in scores
        }
        for noise, scores in found.items()
    }


def radar_figure(found: Figures) -> Figure:
    """Return the errors of all filters now and ahead, from `radar_json`, one panel for each
    noise.
    """
    figure = new_canvas((11.5, 5.6))
    panels = figure.subplots(1, len(found), sharex=True, sharey=True)
    marks = dict(zip(("position", *COLUMNS[2 : 2 + len(HORIZONS)]), "os^D", strict=True))
    for axes, (noise, filters) in zip(panels, found.items(), strict=True):
        for column, marker in marks.items():
            errors = [one[column] for one in filters.values()][::-1]
            values = [one.value for one in errors]
            bars = error_bars(errors)
            label = "now" if column == "position" else f"{column.split()[1]} s ahead"
            axes.errorbar(
                values,
                range(len(filters)),
                xerr=bars,
                fmt=marker,
                markersize=5,
                label=label,
            )
        axes.set_yticks(range(len(filters)), list(filters)[::-1])
        axes.set_xscale("log")
        axes.set_xticks(ERRORS, [f"{error:g}" for error in ERRORS])
        axes.xaxis.set_minor_locator(NullLocator())
        axes.set_title(NOISE_NAMES[noise])
        plain_axes(axes, "RMSE of the position, m, with its 95 % interval")
    figure.legend(
        *panels[0].get_legend_handles_labels(),
        loc="outside upper center",
        ncol=4,
        frameon=False,
    )
    return figure
