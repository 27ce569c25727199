"""The agent, for which nothing is selected, beside rules that are tuned in each world."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.stats import norm

from agents import find_decider, task_of
from baselines import Estimate, Scores
from studies.results import in_brackets, markdown_table
from studies.simulators.worlds import World

SELECTION = 1_000_000_000
"""Thresholds are selected on paths from this seed on; reported ones have smaller seeds."""
ALLOWED = 0.01
"""Reward by which the agent may be below the best rule and still not lose."""

Row = dict[str, Any]


def compare(world: World, names: Sequence[str], episodes: int, seed: int) -> Row:
    """Return the rewards in a world, as in JSON: of the first decider at its default threshold
    with the nominal and with the likeliest process noise, and of the best of the others.

    The gain is the reward with the likeliest noise less that of this rule on the same paths.
    """
    # Mean of a tick.
    reward = task_of("HybridTrackQuickest-v0").statistic("reward")
    agent, *rules = names
    likeliest = world.rewards(agent, episodes, seed, likeliest=True)
    tuned = [tuned_rewards(world, name, episodes, seed) for name in rules]
    best, setting = max(tuned, key=lambda pair: pair[0].estimate(reward).value)
    return {
        "world": world.name,
        "kind": world.kind,
        "agent": likeliest.name,
        "nominal": world.rewards(agent, episodes, seed).estimate(reward),
        "likeliest": likeliest.estimate(reward),
        "rules": {scores.name: scores.estimate(reward) for scores, _ in tuned},
        "best": best.name,
        "threshold": best.thresholds[0],
        "setting": setting,
        "gain": likeliest.difference(best, reward),
        "mismatch": world.mismatch(seed),
    }


def tuned_rewards(
    world: World,
    name: str,
    episodes: int,
    seed: int,
    factors: Sequence[float] = (1.0, 0.1, 10.0),
    most: int = 13,
) -> tuple[Scores, Row]:
    """Return the rewards of a rule with the process noise and threshold that are best on as many
    other paths, and this noise.

    Tried are the nominal process noise times factors, and for rules that read rows the likeliest
    one; and at most `most` thresholds, spread over those of the rule.
    """
    decider = find_decider(name, world.options())
    thresholds = decider.thresholds[:: -(-len(decider.thresholds) // most)]
    settings: list[Row] = [{"factor": factor} for factor in factors]
    if decider.observes == "rows":
        settings.append({"likeliest": True})
    rewards = np.concatenate(
        [
            world.rewards(name, episodes, SELECTION, **setting, thresholds=thresholds).values.mean(
                0
            )
            for setting in settings
        ]
    )
    row, column = np.unravel_index(rewards.argmax(), rewards.shape)
    setting = settings[row]
    chosen = (thresholds[column],)
    return world.rewards(name, episodes, seed, **setting, thresholds=chosen), setting


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return in how many worlds the agent keeps up with the best tuned rule.

    kept: at most .01 below; above, below: the difference is not 0 by Holm's correction over all
    worlds.
    """
    gains = np.array([row["gain"].value for row in rows])
    clear = holm([p_value(row["gain"]) for row in rows])
    return {
        "worlds": len(gains),
        "kept": int((gains >= -ALLOWED).sum()),
        "above": int((clear & (gains > 0.0)).sum()),
        "below": int((clear & (gains < 0.0)).sum()),
    }


def p_value(gain: Estimate) -> float:
    """Return the two-sided p-value of a difference, from its 95 % interval as one of a normal
    distribution.
    """
    deviation = (gain.high - gain.low) / (2.0 * norm.ppf(0.975))
    return float(2.0 * norm.sf(abs(gain.value) / deviation)) if deviation > 0.0 else 1.0


def holm(values: Sequence[float]) -> NDArray[np.bool_]:
    """Return which of some p-values are significant at 5 % together. Holm 1979."""
    order = np.argsort(values)
    passed = np.sort(values) * np.arange(len(values), 0, -1) <= 0.05
    significant = np.zeros(len(values), np.bool_)
    # Up to the first one that is not.
    significant[order] = np.minimum.accumulate(passed)
    return significant


def markdown(rows: Sequence[Row]) -> str:
    """Return a table of all worlds, and the counts as a sentence."""
    heads = ("world", "nominal noise", "likeliest", "best tuned rule", "gain", "mismatch")
    cells = [
        (
            row["world"],
            f"{row['nominal'].value:.3f}",
            f"{row['likeliest'].value:.3f}",
            f"{row['rules'][row['best']].value:.3f} ({row['best']})",
            in_brackets(row["gain"], 3, sign="+"),
            f"{row['mismatch']:.2f}",
        )
        for row in rows
    ]
    number = counts(rows)
    return (
        f"{markdown_table(heads, cells)}\n{rows[0]['agent']} at its default threshold, with the"
        f" likeliest process noise, is at most {ALLOWED:g} below the best tuned rule in"
        f" {number['kept']} of {number['worlds']} worlds; above in {number['above']} and below in"
        f" {number['below']} by Holm's correction.\n"
    )


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the gain of the agent against the mismatch of the world."""
    frame = pd.DataFrame(rows)
    frame = frame.join(pd.DataFrame(map(vars, frame.gain)))
    canvas, axes = plt.subplots(figsize=(9.0, 5.0), layout="constrained")
    for kind, part in frame.groupby("kind", sort=False):
        bars = part.value - part.low, part.high - part.value
        axes.errorbar(part.mismatch, part.value, bars, fmt="o", label=kind)
    for level in (0.0, -ALLOWED):
        axes.axhline(level, color="0.75", linestyle="--", zorder=0)
    axes.set(
        xscale="log",
        xlabel="mean squared whitened innovation",
        ylabel="reward less that of the best tuned rule",
    )
    axes.legend(frameon=False)
    return canvas
