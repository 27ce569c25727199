"""Roads away from the model, and what deciders lose on them that are not told.

On four roads away from the model an agent or rule keeps its weights, its default threshold and the
nominal model. Beside it stand classical rules in the same episodes, with the true model: their
filters know the process noise, radii or law of the durations, some are fitted to the true noise,
and thresholds are selected on other episodes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd
from matplotlib import colormaps
from matplotlib.figure import Figure

from agents import bound_scores, find_decider, select_threshold, sweep, task_of
from hybrid_env import RandomScheme
from studies.pictures import draw_estimates
from studies.results import in_brackets, markdown_table

Row = dict[str, Any]


# Options of an environment in which nobody is told, and those of the same world in which rules are
# told.
Level = tuple[dict[str, Any], dict[str, Any]]


@dataclass(frozen=True)
class Road:
    """Worlds that depart further and further from the model."""

    title: str
    env_id: str
    # Rules that are told the truth; the best of them at each level is the reference.
    rules: tuple[str, ...]
    # Deciders that are not told.
    deciders: tuple[str, ...]
    # By name.
    levels: dict[str, Level]


def _radius(factor: float) -> Level:
    """Return turns of a multiple of the listed radius of 5 m."""
    flown = (factor * 5.0,)
    untold = {"scheme": RandomScheme(radii=flown), "correctness": "type"}
    return untold, {"radii": flown, "correctness": "type"}


def _process(factor: float) -> Level:
    """Return process noise of a multiple of Q = 0.001 m^2/s^2."""
    variance = factor * 0.001
    return {"object_variance": variance}, {"process_variance": variance}


# Environment, rules that are told, and deciders that are not.
ANNOUNCED = (
    "HybridTrackPublished-v0",
    ("propagated", "propagated-robust"),
    ("shipped", "msprt", "at-once", "ate"),
)
ROADS = (
    Road(
        "tails of the noise: Student's t, degrees of freedom",
        *ANNOUNCED,
        {"normal": ({}, {})}
        | {f"{k:g}": ({"noise": f"student_t {k:g}"},) * 2 for k in (10, 5, 3, 2, 1.5)},
    ),
    Road(
        "process noise of the object over Q",
        *ANNOUNCED,
        {"1": ({}, {})} | {f"{factor}": _process(factor) for factor in (3, 10, 30, 100)},
    ),
    Road(
        "radius of turns over the listed one",
        *ANNOUNCED,
        {f"{factor:g}": _radius(factor) for factor in (1.0, 1.25, 1.5, 2.0, 2.5)},
    ),
    Road(
        "rhythm: durations",
        "HybridTrackQuickest-v0",
        ("beam",),
        ("shipped", "robust", "beam-adaptive", "beam-default", "threshold"),
        {"25 + geometric 50": ({}, {})}
        | {
            f"uniform {law}": ({"durations": f"uniform {law}"},) * 2
            for law in ("25-125", "50-100", "65-85", "72-78")
        },
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
            levels={name: road.levels[name] for name in [*road.levels][:: len(road.levels) - 1]},
        )
        for road in ROADS
    ]


def respond(road: Road, level: str, episodes: int, seed: int) -> list[Row]:
    """Return rows, as in JSON, of the best rule that is told and of the deciders at one level, and
    of the bound if switches are announced, which bounds rules only if the noise is normal.

    The gap is the reward less that of this rule on the same episodes; None in its own row.
    """
    task = task_of(road.env_id)
    goal = task.statistic("reward")
    world, model = (task.changed(options) for options in road.levels[level])
    rules = []
    for name in road.rules:
        decider = find_decider(name, model.options)
        threshold = select_threshold(model, decider, episodes)
        rules.append(sweep(model, decider, episodes, seed, thresholds=(threshold,)))
    best = max(rules, key=lambda scores: scores.estimate(goal).value)
    compared = [best]
    for name in road.deciders:
        # Made for the nominal model.
        decider = find_decider(name, task.options)
        compared.append(sweep(world, decider, episodes, seed, thresholds=(decider.default,)))
    if task.options.switches == "announced":
        compared.append(bound_scores(model, episodes, seed))
    return [
        {
            "road": road.title,
            "level": level,
            "decider": scores.name,
            "reward": scores.estimate(goal),
            "gap": None if scores is best else scores.difference(best, goal),
        }
        for scores in compared
    ]


def markdown(rows: Sequence[Row]) -> str:
    """Return a table for each road."""
    parts = []
    for road, here in pd.DataFrame(rows).groupby("road", sort=False):
        lines = []
        for level, at_level in here.groupby("level", sort=False):
            reference, *others = at_level.to_dict("records")
            best = f"{reference['reward'].value:.3f} ({reference['decider']})"
            gaps = [in_brackets(row["gap"], 3, sign="+") for row in others]
            lines.append([level, best, *gaps])
        names = (f"{row['decider']} less it" for row in others)
        head = ["level", "best rule that is told", *names]
        parts.append(f"## {road[0].upper()}{road[1:]}\n\n{markdown_table(head, lines)}")
    return "\n\n".join(parts) + "\n"


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the gaps along each road, with their 95 % intervals."""
    canvas = Figure(figsize=(13.0, 9.0), layout="constrained")
    frame = pd.DataFrame([row for row in rows if row["gap"] is not None])
    numbers = {name: k for k, name in enumerate(frame.decider.unique())}
    roads = frame.groupby("road", sort=False)
    for (road, here), axes in zip(roads, canvas.subplots(2, 2).flat, strict=True):
        for name, curve in here.groupby("decider", sort=False):
            colour = colormaps["tab20"](numbers[name])
            draw_estimates(axes, curve.level, curve.gap, marker="o", color=colour, label=name)
        axes.axhline(0.0, color="0.75", linewidth=0.8, linestyle="--", zorder=0)
        axes.set_xlabel(road)
        axes.legend(frameon=False, fontsize=8)
    canvas.supylabel("reward less that of the best rule that is told")
    return canvas
