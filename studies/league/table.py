"""The tables and the picture of the league, from the files of deciders."""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from baselines import Estimate, Statistic
from studies.league.protocol import BANK, QUICKEST, THREE, WORLDS, read_entry, scores_of

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


def rewards_table(entries: Sequence[Entry], env_ids: Sequence[str]) -> pd.DataFrame:
    """Return a table of the mean rewards: deciders in rows, by kind and title, and the worlds of
    some environments in columns.
    """
    kinds = ("informed", "recurrent", "memoryless", "classical")
    ordered = sorted(
        entries,
        key=lambda entry: (kinds.index(entry["kind"]), entry["title"]),
    )
    worlds = [world for world, (env_id, _) in WORLDS.items() if env_id in env_ids]
    rows = []
    for entry in ordered:
        values = [reward(entry, world) for world in worlds]
        if any(values):
            cells = ["-" if value is None else f"{value.value:.3f}" for value in values]
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
        rivals = [scores for other in others if (scores := scores_of(other, world)) is not None]
        best = max(rivals, key=lambda scores: scores.curve(REWARD)[0], default=None)
        rows.append(
            {
                "world": world,
                "threshold": f"{mine.thresholds[0]:g}",
                "reward": bounds(mine.estimate(REWARD, 0)),
                "best other": "" if best is None else best.name,
                "difference": "" if best is None else bounds(mine.difference(best, REWARD), "+"),
            }
        )
    return pd.DataFrame(rows)


def bounds(estimate: Estimate, sign: str = "") -> str:
    """Return an estimate with half the width of its interval."""
    return f"{estimate.value:{sign}.3f} ±{(estimate.high - estimate.low) / 2:.3f}"


def league_figure(entries: Sequence[Entry]) -> Figure:
    """Return a figure of the rewards of all deciders in all worlds, with 95 % intervals."""
    figure = Figure((16.0, 6.5), layout="constrained")
    axes = figure.subplots()
    shift = 0.7 / max(1, len(entries) - 1)
    for index, entry in enumerate(entries):
        values = [reward(entry, world) or Estimate(*[np.nan] * 3) for world in WORLDS]
        middle, low, high = np.array([(value.value, value.low, value.high) for value in values]).T
        axes.errorbar(
            np.arange(len(WORLDS)) + index * shift - 0.35,
            middle,
            (middle - low, high - middle),
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
