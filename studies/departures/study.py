"""Roads away from the model, and what deciders lose on them that are not told.

On four roads away from the model an agent or rule keeps its weights, its default threshold and the
nominal model. Beside it stand classical rules in the same episodes, with the true model: their
filters know the process noise, radii or law of the durations, some are fitted to the true noise,
and thresholds are selected on other episodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from agents import find_family, in_brackets, markdown_table, select_threshold, sweep, task_of
from hybrid_env import RandomScheme

Row = dict[str, Any]


@dataclass(frozen=True)
class Level:
    """A world on a road."""

    name: str
    # Options of an environment in which nobody is told.
    untold: dict[str, Any]
    # Those of the same environment, in which rules are told.
    told: dict[str, Any]


@dataclass(frozen=True)
class Road:
    """Worlds that depart further and further from the model."""

    title: str
    env_id: str
    # Rules that are told the truth; the best of them at each level is the reference.
    rules: tuple[str, ...]
    # Deciders that are not told.
    deciders: tuple[str, ...]
    levels: tuple[Level, ...]


def _alike(name: str, options: dict[str, Any]) -> Level:
    return Level(name, options, options)


def _radius(factor: float) -> Level:
    """Return turns of a multiple of the listed radius of 5 m."""
    flown = (factor * 5.0,)
    untold = {"scheme": RandomScheme(radii=flown), "correctness": "type"}
    return Level(f"{factor:g}", untold, {"radii": flown, "correctness": "type"})


def _process(factor: float) -> Level:
    """Return process noise of a multiple of Q = 0.001 m^2/s^2."""
    variance = factor * 0.001
    return Level(f"{factor}", {"object_variance": variance}, {"process_variance": variance})


ANNOUNCED: tuple[str, tuple[str, ...], tuple[str, ...]] = (
    "HybridTrackPublished-v0",
    ("calibrated", "calibrated-robust"),
    ("shipped", "shipped-threshold", "msprt", "ate"),
)
UNKNOWN: tuple[str, tuple[str, ...], tuple[str, ...]] = (
    "HybridTrackQuickest-v0",
    ("beam",),
    ("shipped", "shipped-margin", "robust", "beam-adaptive", "beam-default", "threshold"),
)
ROADS = (
    Road(
        "tails of the noise: Student's t, degrees of freedom",
        *ANNOUNCED,
        (
            Level("normal", {}, {}),
            *(_alike(f"{k:g}", {"noise": f"student_t {k:g}"}) for k in (10, 5, 3, 2, 1.5)),
        ),
    ),
    Road(
        "process noise of the object over Q",
        *ANNOUNCED,
        (Level("1", {}, {}), *map(_process, (3, 10, 30, 100))),
    ),
    Road(
        "radius of turns over the listed one",
        *ANNOUNCED,
        tuple(map(_radius, (1.0, 1.25, 1.5, 2.0, 2.5))),
    ),
    Road(
        "rhythm: durations",
        *UNKNOWN,
        (
            Level("25 + geometric 50", {}, {}),
            *(
                _alike(law, {"durations": law})
                for law in ("uniform 25-125", "uniform 50-100", "uniform 65-85", "uniform 72-78")
            ),
        ),
    ),
)


def all_roads(further: Sequence[str] = ()) -> list[Road]:
    """Return all roads, with `further` deciders for announced switches."""
    return [
        replace(road, deciders=(*road.deciders, *further)) if road.env_id == ANNOUNCED[0] else road
        for road in ROADS
    ]


def quick_roads() -> list[Road]:
    """Return the ends of the roads, with one rule that is told and that is not."""
    return [
        replace(
            road,
            rules=road.deciders[-1:],
            deciders=road.deciders[-1:],
            levels=road.levels[:: len(road.levels) - 1],
        )
        for road in ROADS
    ]


def respond(road: Road, level: Level, episodes: int, seed: int) -> list[Row]:
    """Return rows, as in JSON, of the best rule that is told and of the deciders at one level.

    The gap is the reward less that of this rule on the same episodes; None in its own row.
    """
    task = task_of(road.env_id)
    goal = task.statistic(task.goal)
    told, world = task.changed(level.told), task.changed(level.untold)
    rules = []
    for name in road.rules:
        family = find_family(name, told.options)
        threshold = select_threshold(told, family, episodes)
        rules.append(
            sweep(
                told,
                family,
                episodes,
                seed,
                thresholds=(threshold,),
            )
        )
    best = max(rules, key=lambda scores: scores.estimate(goal).value)
    place: Row = {"road": road.title, "level": level.name}
    rows: list[Row] = [
        place
        | {
            "decider": best.name,
            "reward": best.estimate(goal),
            "gap": None,
        }
    ]
    for name in road.deciders:
        # Made for the nominal model.
        family = find_family(name, task.options)
        scores = sweep(
            world,
            family,
            episodes,
            seed,
            thresholds=(family.default,),
        )
        gap = scores.difference(best, goal)
        rows.append(
            place
            | {
                "decider": scores.name,
                "reward": scores.estimate(goal),
                "gap": gap,
            }
        )
    return rows


def markdown(rows: Sequence[Row]) -> str:
    """Return a table for each road."""
    parts = []
    for road in dict.fromkeys(row["road"] for row in rows):
        here = [row for row in rows if row["road"] == road]
        names = dict.fromkeys(row["decider"] for row in here if row["gap"] is not None)
        lines = []
        for level in dict.fromkeys(row["level"] for row in here):
            told, *others = (row for row in here if row["level"] == level)
            gaps = [in_brackets(row["gap"], 3, sign="+") for row in others]
            lines.append([level, f"{told['reward'].value:.3f} ({told['decider']})", *gaps])
        head = ["level", "best rule that is told", *(f"{name} less it" for name in names)]
        parts.append(f"## {road[0].upper()}{road[1:]}\n\n{markdown_table(head, lines)}")
    return "\n\n".join(parts) + "\n"


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the gaps along each road, with their 95 % intervals."""
    canvas, grid = plt.subplots(
        2,
        2,
        figsize=(13.0, 9.0),
        layout="constrained",
    )
    untold = [row for row in rows if row["gap"] is not None]
    names = list(dict.fromkeys(row["decider"] for row in untold))
    colours = dict(zip(names, plt.colormaps["tab20"](range(20)), strict=False))
    for road, axes in zip(dict.fromkeys(row["road"] for row in rows), grid.flat, strict=False):
        here = [row for row in untold if row["road"] == road]
        levels = list(dict.fromkeys(row["level"] for row in here))
        for name in dict.fromkeys(row["decider"] for row in here):
            gaps = [row["gap"] for row in here if row["decider"] == name]
            values = np.array([gap.value for gap in gaps])
            bars = [values - [gap.low for gap in gaps], [gap.high for gap in gaps] - values]
            axes.errorbar(
                levels,
                values,
                bars,
                marker="o",
                color=colours[name],
                label=name,
            )
        axes.axhline(
            0.0,
            color="0.75",
            linewidth=0.8,
            linestyle="--",
            zorder=0,
        )
        axes.set_xlabel(road)
        axes.legend(frameon=False, fontsize=8)
    canvas.supylabel("reward less that of the best rule that is told")
    return canvas
