"""The table and the picture of the league, from the files of deciders."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import filled_table, markdown_table
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_styles
from agents.league.protocol import GROUPS, KINDS, QUICKEST, WORLDS, read_entry, scores_of
from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import mean

ENTRIES = Path(__file__).parent / "entries"
REWARD = mean("reward")


def shipped_entries() -> list[dict[str, Any]]:
    """Return the entries that come with the package."""
    return [read_entry(path) for path in sorted(ENTRIES.glob("*.json"))]


def reward(entry: dict[str, Any], world: str) -> Estimate | None:
    """Return the mean reward of a decider in a world with its interval; None where it did not
    play.
    """
    scores = scores_of(entry, world)
    return None if scores is None else scores.estimate(REWARD, 0)


def best_of_rest(
    entries: Sequence[dict[str, Any]],
    mine: dict[str, Any],
    world: str,
) -> dict[str, Any] | None:
    """Return the entry with the largest reward in a world among the others that are not
    informed.
    """
    others = [one for one in entries if one is not mine and one["kind"] != "informed"]
    found = [
        (value.value, one["title"], one)
        for one in others
        if (value := reward(one, world)) is not None
    ]
    return max(found, key=lambda one: one[:2])[2] if found else None


def _ordered(entries: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(entries, key=lambda one: (KINDS.index(one["kind"]), one["title"]))


def league_table(entries: Sequence[dict[str, Any]]) -> Table:
    """Return a table with deciders in rows and the mean rewards over the worlds of each
    environment.
    """
    names = [
        env_id.rpartition(":")[2].removesuffix("-v0").replace("Track", "Track\n", 1)
        for env_id in GROUPS
    ]
    heads = [
        f"{name}\n{len(worlds)} worlds" for name, worlds in zip(names, GROUPS.values(), strict=True)
    ]
    rows = []
    for entry in _ordered(entries):
        cells = []
        for worlds in GROUPS.values():
            known = [value.value for world in worlds if (value := reward(entry, world)) is not None]
            cells.append(f"{np.mean(known):.3f}" if len(known) == len(worlds) else "-")
        rows.append((escape(entry["title"]), entry["kind"], *cells))
    return filled_table(
        "League: mean reward over the worlds of each environment",
        ("decider", "kind", *heads),
        rows,
        "informed: told what a user does not know. recurrent, memoryless: learned or own deciders"
        " with and without memory. -: it cannot decide in one of the worlds.",
        2,
    )


def world_table(entry: dict[str, Any], entries: Sequence[dict[str, Any]]) -> Table:
    """Return a table of a decider in every world, with the paired difference to the best of the
    others.
    """
    rows: list[tuple[str, ...]] = []
    for world in WORLDS:
        mine = scores_of(entry, world)
        cells = ["-", "-", "", ""]
        if mine is not None:
            cells[:2] = f"{mine.thresholds[0]:g}", _bounds(mine.estimate(REWARD, 0))
            best = best_of_rest(entries, entry, world)
            theirs = None if best is None else scores_of(best, world)
            if theirs is not None:
                cells[2:] = escape(theirs.name), _bounds(mine.difference(theirs, REWARD), "+")
        rows.append((world, *cells))
    return filled_table(
        f"{escape(entry['title'])} ({entry['kind']}) in every world",
        ("world", "threshold", "reward", "best other", "difference"),
        rows,
        "difference: reward less that of the best other decider that is not informed, on the same"
        " episodes. ± half width of the 95 % confidence interval.",
    )


def _bounds(estimate: Estimate, sign: str = "") -> str:
    return f"{estimate.value:{sign}.3f} ±{(estimate.high - estimate.low) / 2:.3f}"


def league_markdown(entries: Sequence[dict[str, Any]]) -> str:
    """Return two tables in Markdown, of announced and of unknown switches: deciders in rows,
    worlds in columns.
    """
    tables = []
    for is_unknown in (False, True):
        worlds = [
            world for world, (env_id, _) in WORLDS.items() if (env_id == QUICKEST) == is_unknown
        ]
        rows = []
        for entry in _ordered(entries):
            values = [reward(entry, world) for world in worlds]
            if any(values):
                cells = ["-" if value is None else f"{value.value:.3f}" for value in values]
                rows.append((entry["title"], entry["kind"], *cells))
        tables.append(markdown_table(("decider", "kind", *worlds), rows))
    return "\n".join(tables)


def league_figure(entries: Sequence[dict[str, Any]]) -> Figure:
    """Return a figure of the rewards of all deciders in all worlds."""
    styles = decider_styles(entry["title"] for entry in entries)
    curves = []
    worlds = list(WORLDS)
    shift = 0.7 / max(1, len(entries) - 1)
    for index, entry in enumerate(entries):
        found = {
            place: value
            for place, world in enumerate(worlds)
            if (value := reward(entry, world)) is not None
        }
        places = [place + index * shift - 0.35 for place in found]
        name = f"{entry['title']} ({entry['kind']})"
        curves.append(
            Curve(
                name,
                styles[entry["title"]],
                places,
                [*found.values()],
                dashes="none",
                filled=True,
            )
        )
    names = ["\n".join(textwrap.fill(part, 11) for part in world.split(", ")) for world in worlds]
    between = tuple(place - 0.5 for place in range(1, len(worlds)))
    x = Axis(limits=(-0.5, len(worlds) - 0.5), ticks=dict(enumerate(names)), levels=between)
    y = Axis("mean reward: per segment, per tick for unknown switches")
    return curve_figure(
        [[Panel("", x, y, curves)]],
        (16.0, 6.5),
        "League: reward in every world, with 95 % intervals",
    )
