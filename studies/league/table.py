"""The tables and the picture of the league, from the files of deciders."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from baselines import Statistic
from studies.league.protocol import BANK, QUICKEST, THREE, WORLDS, read_entry, scores_of
from studies.results import draw_estimates, with_half

REWARD = Statistic(("reward",), lambda means: means)
Entry = Mapping[str, Any]


def shipped_entries() -> list[dict[str, Any]]:
    """Return the entries that come with the study."""
    return [read_entry(path) for path in sorted((Path(__file__).parent / "entries").glob("*.json"))]


def rewards_table(entries: Sequence[Entry], env_ids: Sequence[str]) -> pd.DataFrame:
    """Return a table of the mean rewards: deciders in rows, by kind and title, and the worlds of
    some environments in columns.
    """
    kinds = ("informed", "recurrent", "memoryless", "classical")
    ordered = sorted(entries, key=lambda entry: (kinds.index(entry["kind"]), entry["title"]))
    worlds = [world for world, (env_id, _) in WORLDS.items() if env_id in env_ids]
    rows = []
    for entry in ordered:
        played = [scores_of(entry, world) for world in worlds]
        if any(played):
            cells = [f"{each.curve(REWARD)[0]:.3f}" if each else "-" for each in played]
            rows.append((entry["title"], entry["kind"], *cells))
    return pd.DataFrame(rows, columns=["decider", "kind", *worlds])


def league_tables(entries: Sequence[Entry]) -> list[pd.DataFrame]:
    """Return two tables, of announced and of unknown switches."""
    return [rewards_table(entries, env_ids) for env_ids in ((THREE, BANK), (QUICKEST,))]


def world_table(entry: Entry, entries: Sequence[Entry]) -> pd.DataFrame:
    """Return a table of a decider in the worlds in which it played, with the paired difference to
    the best of the others that is not informed, and half widths of 95 % intervals.
    """
    others = [other for other in entries if other is not entry and other["kind"] != "informed"]
    rows = []
    for world in entry["worlds"]:
        mine = scores_of(entry, world)
        if mine is None:
            continue
        rivals = [scores for other in others if (scores := scores_of(other, world))]
        best = max(rivals, key=lambda scores: scores.curve(REWARD)[0], default=None)
        rows.append(
            {
                "world": world,
                "threshold": f"{mine.thresholds[0]:g}",
                "reward": with_half(mine.estimate(REWARD, 0)),
                "best other": best.name if best else "",
                "difference": with_half(mine.difference(best, REWARD), sign="+") if best else "",
            }
        )
    return pd.DataFrame(rows)


def league_figure(entries: Sequence[Entry]) -> Figure:
    """Return a figure of the rewards of all deciders in all worlds, with 95 % intervals."""
    figure = Figure((16.0, 6.5), layout="constrained")
    axes = figure.subplots()
    for index, entry in enumerate(entries):
        played = {
            place: scores.estimate(REWARD, 0)
            for place, world in enumerate(WORLDS)
            if (scores := scores_of(entry, world))
        }
        shift = 0.7 * index / len(entries) - 0.35
        draw_estimates(
            axes,
            np.array([*played]) + shift,
            [*played.values()],
            linestyle="none",
            color=f"C{index % 10}",
            marker="osD^v"[index // 10 % 5],
            label=f"{entry['title']} ({entry['kind']})",
        )
    names = [textwrap.fill(world, 11) for world in WORLDS]
    axes.set_xticks(range(len(names)), names)
    axes.grid(axis="x", alpha=0.3)
    axes.set_ylabel("mean reward: per segment, per tick for unknown switches")
    axes.set_title("League: reward in every world, with 95 % intervals")
    axes.legend(fontsize="small", ncols=2)
    return figure
