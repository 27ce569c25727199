"""The tables and the picture of the league, from the files of deciders."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from baselines import Estimate, Statistic
from studies.league.protocol import BANK, KINDS, QUICKEST, THREE, WORLDS, read_entry, scores_of

ENTRIES = Path(__file__).parent / "entries"
REWARD = Statistic(("reward",), lambda means: means)
Entry = Mapping[str, Any]


def shipped_entries() -> list[dict[str, Any]]:
    """Return the entries that come with the study."""
    return [read_entry(path) for path in sorted(ENTRIES.glob("*.json"))]


def reward(entry: Entry, world: str) -> Estimate | None:
    """Return the mean reward of a decider in a world with its interval; None where it did not
    play.
    """
    scores = scores_of(entry, world)
    return None if scores is None else scores.estimate(REWARD, 0)


def ordered(entries: Sequence[Entry]) -> list[Entry]:
    """Return entries by kind and title."""
    return sorted(entries, key=lambda entry: (KINDS.index(entry["kind"]), entry["title"]))


def rewards_table(entries: Sequence[Entry], env_ids: Sequence[str]) -> pd.DataFrame:
    """Return a table of the mean rewards: deciders in rows, worlds of some environments in
    columns.
    """
    worlds = [world for world, (env_id, _) in WORLDS.items() if env_id in env_ids]
    rows = []
    for entry in ordered(entries):
        values = [reward(entry, world) for world in worlds]
        if any(values):
            cells = ["-" if value is None else f"{value.value:.3f}" for value in values]
            rows.append((entry["title"], entry["kind"], *cells))
    return pd.DataFrame(rows, columns=["decider", "kind", *worlds])


def league_tables(entries: Sequence[Entry]) -> list[pd.DataFrame]:
    """Return two tables, of announced and of unknown switches."""
    return [rewards_table(entries, env_ids) for env_ids in ((THREE, BANK), (QUICKEST,))]


def best_of_rest(entries: Sequence[Entry], mine: Entry, world: str) -> Entry | None:
    """Return the entry with the largest reward in a world among the others that are not
    informed.
    """
    rewards = [
        (value.value, entry["title"], entry)
        for entry in entries
        if entry is not mine
        and entry["kind"] != "informed"
        and (value := reward(entry, world)) is not None
    ]
    return max(rewards, key=lambda row: row[:2])[2] if rewards else None


def world_table(entry: Entry, entries: Sequence[Entry]) -> pd.DataFrame:
    """Return a table of a decider in every world, with the paired difference to the best of the
    others that is not informed, and half widths of 95 % intervals.
    """
    rows = []
    for world in entry["worlds"]:
        mine = scores_of(entry, world)
        cells = ["-", "-", "", ""]
        if mine is not None:
            cells[:2] = f"{mine.thresholds[0]:g}", bounds(mine.estimate(REWARD, 0))
            best = best_of_rest(
                entries,
                entry,
                world,
            )
            theirs = None if best is None else scores_of(best, world)
            if theirs is not None:
                cells[2:] = theirs.name, bounds(mine.difference(theirs, REWARD), "+")
        rows.append((world, *cells))
    heads = ["world", "threshold", "reward", "best other", "difference"]
    return pd.DataFrame(rows, columns=heads)


def bounds(estimate: Estimate, sign: str = "") -> str:
    """Return an estimate with half the width of its interval."""
    return f"{estimate.value:{sign}.3f} ±{(estimate.high - estimate.low) / 2:.3f}"


def league_figure(entries: Sequence[Entry]) -> Figure:
    """Return a figure of the rewards of all deciders in all worlds, with 95 % intervals."""
    figure = Figure((16.0, 6.5), layout="constrained")
    axes = figure.subplots()
    shift = 0.7 / max(1, len(entries) - 1)
    for index, entry in enumerate(entries):
        values = {
            place: value
            for place, world in enumerate(WORLDS)
            if (value := reward(entry, world)) is not None
        }
        middle = np.array([value.value for value in values.values()])
        ends = np.array([(value.low, value.high) for value in values.values()]).T
        axes.errorbar(
            [place + index * shift - 0.35 for place in values],
            middle,
            np.abs(ends - middle),
            linestyle="none",
            color=f"C{index % 10}",
            marker="osD^v"[index // 10 % 5],
            label=f"{entry['title']} ({entry['kind']})",
        )
    names = ["\n".join(textwrap.fill(part, 11) for part in world.split(", ")) for world in WORLDS]
    axes.set_xticks(range(len(names)), names)
    axes.set_xlim(-0.5, len(names) - 0.5)
    for place in range(1, len(names)):
        axes.axvline(
            place - 0.5,
            color="lightgray",
            linewidth=0.8,
        )
    axes.set_ylabel("mean reward: per segment, per tick for unknown switches")
    axes.set_title("League: reward in every world, with 95 % intervals")
    axes.legend(fontsize="small", ncols=2)
    return figure
