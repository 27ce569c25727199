"""The agent, for which nothing is selected, beside rules that are tuned in each world."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from scipy.stats import norm

from agents import find_family, in_brackets, markdown_table, task_of
from baselines import Estimate, Scores
from studies.simulators.worlds import VEHICLES, World

# Thresholds are selected on paths from this seed on; reported ones have smaller seeds.
SELECTION = 1_000_000_000
# Process noise that is tried besides the nominal one: what rolls or brakes fits no model.
FACTORS = (1.0, 0.1, 10.0)
# At most, spread over those of the decider.
MOST_THRESHOLDS = 13
LEVEL = 0.05
# Reward by which the agent may be below the best rule and still not lose.
ALLOWED = 0.01
# Mean reward of a tick.
REWARD = task_of("HybridTrackQuickest-v0").statistic("reward")

Row = dict[str, Any]


def compare(world: World, names: Sequence[str], episodes: int, seed: int) -> Row:
    """Return the rewards in a world, as in JSON: of the first decider at its default threshold
    with the nominal and with the likeliest process noise, and of the best of the others.

    The gain is the reward with the likeliest noise less that of this rule on the same paths.
    """
    agent, *rules = names
    nominal = world.rewards(agent, episodes, seed)
    likeliest = world.rewards(
        agent,
        episodes,
        seed,
        likeliest=True,
    )
    tuned = [tuned_rewards(world, name, episodes, seed) for name in rules]
    best, setting = max(tuned, key=lambda pair: pair[0].estimate(REWARD).value)
    return {
        "world": world.name,
        "kind": world.kind,
        "agent": likeliest.name,
        "nominal": nominal.estimate(REWARD),
        "likeliest": likeliest.estimate(REWARD),
        "rules": {scores.name: scores.estimate(REWARD) for scores, _ in tuned},
        "best": best.name,
        "threshold": best.thresholds[0],
        "setting": setting,
        "gain": likeliest.difference(best, REWARD),
        "mismatch": world.mismatch(seed),
    }


def tuned_rewards(world: World, name: str, episodes: int, seed: int) -> tuple[Scores, Row]:
    """Return the rewards of a rule with the process noise and threshold that are best on as many
    other paths, and this noise.

    Rules that read rows also try those of the likeliest process noise.
    """
    options = world.options()
    family = find_family(name, options)
    thresholds = family.thresholds[:: -(-len(family.thresholds) // MOST_THRESHOLDS)]
    settings: list[Row] = [{"factor": factor} for factor in FACTORS]
    if family.make(family.default).observes == "rows":
        settings.append({"likeliest": True})
    best = (-np.inf, family.default, settings[0])
    for setting in settings:
        scores = world.rewards(
            name,
            episodes,
            SELECTION,
            **setting,
            thresholds=thresholds,
        )
        rewards = scores.values.mean(axis=0)[0]
        index = int(rewards.argmax())
        if rewards[index] > best[0]:
            best = rewards[index], thresholds[index], setting
    _, threshold, setting = best
    return world.rewards(
        name,
        episodes,
        seed,
        **setting,
        thresholds=(threshold,),
    ), setting


def counts(rows: Sequence[Row]) -> dict[str, int]:
    """Return in how many worlds the agent keeps up with the best tuned rule.

    kept: at most .01 below; above, below: the difference is not 0 by Holm's correction over all
    worlds.
    """
    gains = [row["gain"] for row in rows]
    sure = holm([p_value(gain) for gain in gains])
    signs = [np.sign(gain.value) * clear for gain, clear in zip(gains, sure, strict=True)]
    return {
        "worlds": len(gains),
        "kept": sum(gain.value >= -ALLOWED for gain in gains),
        "above": signs.count(1.0),
        "below": signs.count(-1.0),
    }


def p_value(gain: Estimate) -> float:
    """Return the two-sided p-value of a difference, from its interval as one of a normal
    distribution.
    """
    deviation = (gain.high - gain.low) / (2.0 * norm.ppf(1.0 - LEVEL / 2.0))
    return float(2.0 * norm.sf(abs(gain.value) / deviation)) if deviation > 0.0 else 1.0


def holm(values: Sequence[float]) -> list[bool]:
    """Return which of some p-values are significant at 5 % together. Holm 1979."""
    order = np.argsort(values)
    passed = np.sort(values) * np.arange(len(values), 0, -1) <= LEVEL
    significant = np.zeros(len(values), np.bool_)
    significant[order[: int(np.logical_and.accumulate(passed).sum())]] = True
    return significant.tolist()


def markdown(rows: Sequence[Row]) -> str:
    """Return a table of all worlds, and the counts as a sentence."""
    heads = ("world", "nominal noise", "likeliest", "best tuned rule", "gain", "mismatch")
    cells = []
    for row in rows:
        rewards = [f"{row[key].value:.3f}" for key in ("nominal", "likeliest")]
        best = f"{row['rules'][row['best']].value:.3f} ({row['best']})"
        gain = in_brackets(row["gain"], 3, sign="+")
        cells.append(
            (
                row["world"],
                *rewards,
                best,
                gain,
                f"{row['mismatch']:.2f}",
            )
        )
    number = counts(rows)
    return (
        f"{markdown_table(heads, cells)}\n{rows[0]['agent']} at its default threshold, with the"
        f" likeliest process noise, is at most {ALLOWED:g} below the best tuned rule in"
        f" {number['kept']} of {number['worlds']} worlds; above in {number['above']} and below in"
        f" {number['below']} by Holm's correction.\n"
    )


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the gain of the agent against the mismatch of the world, a panel for each simulator."""
    simulators = list(dict.fromkeys(VEHICLES[row["kind"]].simulator for row in rows))
    size = (4.5 * len(simulators) + 1.0, 4.5)
    canvas, (panels,) = plt.subplots(
        1,
        len(simulators),
        figsize=size,
        squeeze=False,
        layout="constrained",
    )
    for simulator, axes in zip(simulators, panels, strict=True):
        for kind in dict.fromkeys(row["kind"] for row in rows):
            here = [row for row in rows if row["kind"] == kind]
            if VEHICLES[kind].simulator != simulator:
                continue
            gains = [row["gain"] for row in here]
            values = np.array([gain.value for gain in gains])
            bars = [values - [gain.low for gain in gains], [gain.high for gain in gains] - values]
            axes.errorbar(
                [row["mismatch"] for row in here],
                values,
                bars,
                fmt="o",
                label=kind,
            )
        for level in (0.0, -ALLOWED):
            axes.axhline(
                level,
                color="0.75",
                linewidth=0.8,
                linestyle="--",
                zorder=0,
            )
        axes.axvline(
            1.0,
            color="0.75",
            linewidth=0.8,
            linestyle="--",
            zorder=0,
        )
        axes.set(title=simulator, xlabel="mean squared whitened innovation")
        axes.legend(frameon=False)
    panels[0].set_ylabel("reward less that of the best tuned rule")
    return canvas
