"""Deciders that are not told how the world departs from the model, beside the best rule that is
told.

On four roads away from the model an agent or rule keeps its weights, its default threshold and the
nominal model. Beside it stand classical rules in the same episodes, with the true model: their
filters know the process noise, radii or law of the durations, some are fitted to the true noise,
and thresholds are selected on other episodes.
"""

import functools
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from agents.evaluation.cells import in_brackets, markdown_table
from agents.evaluation.registry import find_family
from agents.evaluation.task import sweep
from agents.evaluation.tasks import ENVIRONMENTS, task_of
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_styles
from agents.interface.parallel import Call
from agents.studies.shifts import evaluate_world
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from hybrid_env import RandomScheme

TOLD = {ANNOUNCED: ("calibrated", "calibrated-robust"), UNKNOWN: ("beam",)}
"""Rules that are told the truth; the best of them at each level is the reference."""
DECIDERS = {
    ANNOUNCED: ("shipped", "shipped-threshold", "msprt", "ate"),
    UNKNOWN: ("shipped", "shipped-margin", "robust", "beam-adaptive", "beam-default", "threshold"),
}
"""Deciders that are not told."""
# Listed radius [m] and Q [m^2/s^2].
RADIUS, VARIANCE = 5.0, 0.001
Row = dict[str, Any]

Level = tuple[str, dict[str, Any], dict[str, Any]]
"""A world on a road: name, options of an environment in which nobody is told, those of the same
one that is told.
"""


def _radius(factor: float) -> Level:
    flown = (factor * RADIUS,)
    untold = {"scheme": RandomScheme(radii=flown), "correctness": "type"}
    return f"{factor:g}", untold, {"radii": flown, "correctness": "type"}


PROCESS: list[Level] = [
    (f"{k}", {"object_variance": k * VARIANCE}, {"process_variance": k * VARIANCE})
    for k in (3, 10, 30, 100)
]
TAILS: list[Level] = [
    (f"{freedom:g}", noise, noise)
    for freedom in (10, 5, 3, 2, 1.5)
    for noise in [{"noise": f"student_t {freedom:g}"}]
]
LAWS = ("uniform 25-125", "uniform 50-100", "uniform 65-85", "uniform 72-78")
RHYTHMS: list[Level] = [
    (
        law.replace(" ", "\n"),
        {"durations": law},
        {"durations": law},
    )
    for law in LAWS
]
ROADS: dict[str, tuple[str, list[Level]]] = {
    "tails of the noise: Student's t, degrees of freedom": (
        ANNOUNCED,
        [("normal", {}, {}), *TAILS],
    ),
    "process noise of the object over Q": (ANNOUNCED, [("1", {}, {}), *PROCESS]),
    "radius of turns over the listed one": (
        ANNOUNCED,
        list(map(_radius, (1.0, 1.25, 1.5, 2.0, 2.5))),
    ),
    "rhythm: durations": (UNKNOWN, [("25 +\ngeometric 50", {}, {}), *RHYTHMS]),
}


def calls(further: Sequence[str], episodes: int, seed: int) -> dict[str, Call]:
    """Return the parts of the study by name, with `further` deciders for announced switches and
    three hypotheses.
    """
    found: dict[str, Call] = {}
    for road, (switches, levels) in ROADS.items():
        names = DECIDERS[switches] + (tuple(further) if switches == ANNOUNCED else ())
        for level in levels:
            name = f"{road}: {level[0]}".replace("\n", " ")
            found[name] = functools.partial(respond, road, level, switches, names, episodes, seed)
    return found


def respond(
    road: str,
    level: Level,
    switches: str,
    names: Sequence[str],
    episodes: int,
    seed: int,
) -> list[Row]:
    """Return rows, as in JSON, of the best told rule and of the deciders at one level; arguments
    as in `calls`.

    The gap is the reward less that of this rule on the same episodes; None in its own row.
    """
    task = task_of(ENVIRONMENTS[switches])
    title, untold_options, told_options = level
    told = task.changed(told_options)
    world = task.changed(untold_options)
    goal = task.statistic(task.goal)
    rules = [evaluate_world(name, title, told, None, episodes, seed) for name in TOLD[switches]]
    best = max(rules, key=lambda one: one.reward.value)
    place = {"road": road, "level": title.replace("\n", " ")}
    rows: list[Row] = [
        place
        | {
            "decider": best.decider,
            "reward": best.reward,
            "gap": None,
        }
    ]
    for name in names:
        # Made for the nominal model.
        family = find_family(name, task.options)
        scores = sweep(world, family, episodes, seed, thresholds=(family.default,))
        gap = scores.difference(best.own, goal)
        rows.append(
            place
            | {
                "decider": scores.name,
                "reward": scores.estimate(goal),
                "gap": gap,
            }
        )
    return rows


def markdown(found: Sequence[Row]) -> str:
    """Return a table for each road."""
    parts = []
    for road in dict.fromkeys(row["road"] for row in found):
        here = [row for row in found if row["road"] == road]
        names = dict.fromkeys(row["decider"] for row in here if row["gap"] is not None)
        lines = []
        for level in dict.fromkeys(row["level"] for row in here):
            told, *others = (row for row in here if row["level"] == level)
            gaps = [in_brackets(row["gap"], 3, sign="+") for row in others]
            lines.append([level, f"{told['reward'].value:.3f} ({told['decider']})", *gaps])
        head = ["level", "best rule that is told", *(f"{name} less it" for name in names)]
        parts.append(f"## {road[0].upper()}{road[1:]}\n\n{markdown_table(head, lines)}")
    return "\n\n".join(parts) + "\n"


def figure(found: Sequence[Row]) -> Figure:
    """Draw the gaps along each road, with their 95 % intervals."""
    panels = []
    untold = [row for row in found if row["gap"] is not None]
    styles = decider_styles(dict.fromkeys(row["decider"] for row in untold))
    for road, (_, levels) in ROADS.items():
        curves = []
        for name, style in styles.items():
            gaps = [row["gap"] for row in untold if (row["road"], row["decider"]) == (road, name)]
            if gaps:
                curves.append(Curve(name, style, range(len(gaps)), gaps))
        ticks = {float(k): title for k, (title, *_) in enumerate(levels)}
        x = Axis(road, limits=(-0.2, len(levels) - 0.1), ticks=ticks)
        panels.append(
            Panel(
                "",
                x,
                Axis("reward less that of the best rule that is told", levels=(0.0,)),
                curves,
            )
        )
    title = "What deciders lose that are not told how the world departs from the model"
    return curve_figure([panels[:2], panels[2:]], (13.0, 9.0), title)
