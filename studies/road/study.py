"""Selection of the banks of the environments whose objects move otherwise than told, and deciders
on the episodes of the report.

Thresholds, process noise and the bank are selected on episodes whose seeds begin at `SELECTION`.
Those of the report are smaller, and those of training larger.
"""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from joblib import delayed
from matplotlib.figure import Figure

from agents import Task, find_decider, sweep, task_of
from baselines import Estimate, Scores
from studies.results import draw_estimates, in_brackets, in_parallel, markdown_table

ROAD = "HybridTrackRoad-v0"
UNKNOWN = "HybridTrackQuickestRoad-v0"
"""The same with unknown switches."""
# First seeds of selection, and of training, see `baselines.rules.seeds`.
SELECTION = 1_000_000_000
TRAINING = 10**12
RADII = ((5.0,), (3.5, 7.0), (2.5, 5.0, 10.0), (2.5, 3.5, 5.0, 7.0, 10.0))
# [m^2/s^2]
PROCESS = (3e-3, 1e-2, 3e-2)
LIKELIHOODS = {
    ROAD: ("gaussian", "student_t 50", "student_t 4"),
    UNKNOWN: ("gaussian", "student_t 50", "student_t 8", "student_t 4"),
}
ALPHAS = (0.4, 0.3, 0.2, 0.15, 0.1, 0.05, 0.02, 5e-3)
"""Thresholds of error probabilities."""
RULES = {
    ROAD: ("at-once", "ate", "sprt", "msprt", "msprt-type", "propagated", "propagated-robust"),
    UNKNOWN: ("threshold", "steady", "beam", "beam-geometric", "cusum", "glr"),
}
WORLDS: dict[str, dict[str, Any]] = {
    "object at 1 m/s": {"speed": 1.0, "initial_error": (0.3, 1.0)},
    "object at 4 m/s": {"speed": 4.0, "initial_error": (0.3, 16.0)},
    "3 Q of the object": {"object_variance": (3e-4, 9e-2)},
    "3 R, a delay costs half": {"measurement_variance": 0.3, "delay_cost": 0.01},
    "5 % outliers, 20 % missed": {"noise": "outliers 0.05", "missed": 0.2},
}
"""Environments around that of the id, by what differs; no agent was trained in the last one."""
TOLD = {ROAD: ("msprt-type", "shipped"), UNKNOWN: ("steady", "shipped")}
"""The rule by which the bank is selected, and an agent, which are told the motion of the episode;
the best one of them is the reference.
"""
LEVELS = 10
"""Number of process variances of the object for which deciders are told it."""

# Environment, name, options and threshold of a decider.
Setting = tuple[str, str, dict[str, Any], float]


def thresholds_of(decider: Any) -> tuple[float, ...]:
    """Return the thresholds to select from: with unknown switches every other one of a decider;
    with announced ones agents, which learn when to stop, keep their own.
    """
    if decider.task == "unknown":
        return tuple(decider.thresholds[::2])
    return ALPHAS if decider.symbol == "alpha" else (decider.default,)


def selected(
    env: str, name: str, candidates: Sequence[dict[str, Any]], episodes: int
) -> list[tuple[float, Setting]]:
    """Return the reward of a decider with each of several options, at the best threshold of the
    episodes of selection.
    """
    found = []
    for options in candidates:
        task = task_of(env, options)
        decider = find_decider(name, task.options)
        scores = sweep(task, decider, episodes, SELECTION, thresholds=thresholds_of(decider))
        best = task.best(scores)
        reward = scores.curve(task.statistic("reward"))[best]
        found.append((float(reward), (env, name, options, scores.thresholds[best])))
    return found


def select_bank(env: str, episodes: int, jobs: int) -> list[dict[str, Any]]:
    """Return the reward of the first decider of `TOLD` on every bank, the best first."""
    radii = RADII if env == ROAD else [task_of(env).options.radii]
    banks = [
        {"radii": each, "process_variance": variance, "likelihood": law}
        for each, variance, law in itertools.product(radii, PROCESS, LIKELIHOODS[env])
    ]
    calls = [delayed(selected)(env, TOLD[env][0], [bank], episodes) for bank in banks]
    rows = [
        {**options, "threshold": threshold, "reward": reward}
        for [(reward, (*_, options, threshold))] in in_parallel(calls, jobs, "banks")
    ]
    return sorted(rows, key=lambda row: -row["reward"])


def evaluate(
    env: str,
    agents: Sequence[str],
    rules: Sequence[str],
    episodes: int,
    selection: int,
    jobs: int,
    changes: Mapping[str, Any] | None = None,
) -> list[dict[str, Any]]:
    """Return rows of rules and agents on the episodes of the report, in this order.

    Rules have the process noise and the threshold that earn most in selection, agents the bank of
    the id. With changed options of the id rows of the agents with selected process noise follow.
    Each row has the paired difference to the best rule.
    """
    banks = [{**(changes or {}), "process_variance": variance} for variance in PROCESS]
    calls = [delayed(selected)(env, name, banks, selection) for name in rules]
    for candidates in ([dict(changes or {})], banks)[: 1 if changes is None else 2]:
        calls += [delayed(selected)(env, name, candidates, selection) for name in agents]
    settings = [max(found)[1] for found in in_parallel(calls, jobs, "selection")]
    made = in_parallel([delayed(scores_of)(each, episodes) for each in settings], jobs, "report")
    goal = task_of(env).statistic("reward")
    best = max(made[: len(rules)], key=lambda scores: scores.curve(goal)[0])
    return [
        {
            "decider": Path(name).name,
            **options,
            "threshold": threshold,
            "reward": scores.estimate(goal, 0),
            "difference": scores.difference(best, goal, 0, 0),
        }
        for (_, name, options, threshold), scores in zip(settings, made, strict=True)
    ]


def scores_of(setting: Setting, episodes: int) -> Scores:
    """Return the scores of a decider on the first episodes of the report."""
    env, name, options, threshold = setting
    task = task_of(env, options)
    decider = find_decider(name, task.options)
    return sweep(task, decider, episodes, 0, thresholds=(threshold,))


def told_tasks(env: str) -> list[Task]:
    """Return tasks in which deciders are told the process noise, and with announced switches the
    radii and the velocity of the object: one for each of several process variances, which are drawn
    elsewhere.
    """
    options = task_of(env).options
    smallest, largest = options.object_variances
    shares = (np.arange(LEVELS) + 0.5) / LEVELS
    variances = (smallest * (largest / smallest) ** shares).tolist()
    known = {}
    if env == ROAD:
        known["radii"] = options.scheme.radii
        known["initial_error"] = task_of("HybridTrack-v0").options.initial_error
    return [
        task_of(env, {"object_variance": each, "process_variance": each, **known})
        for each in variances
    ]


def told(env: str, name: str, episodes: int, selection: int) -> Estimate:
    """Return the reward of a decider that is told the motion, at the threshold of selection."""
    tasks = told_tasks(env)
    deciders = [find_decider(name, task.options) for task in tasks]
    goal = tasks[0].statistic("reward")
    thresholds = thresholds_of(deciders[0])

    def each_scores(count: int, seed: int, tried: Sequence[float]) -> list[Scores]:
        each = -(-count // LEVELS)
        return [
            sweep(task, decider, each, seed + k * each, thresholds=tried)
            for k, (task, decider) in enumerate(zip(tasks, deciders, strict=True))
        ]

    curves = [scores.curve(goal) for scores in each_scores(selection, SELECTION, thresholds)]
    best = thresholds[int(np.mean(curves, axis=0).argmax())]
    parts = [scores.estimate(goal, 0) for scores in each_scores(episodes, 0, (best,))]
    value = float(np.mean([part.value for part in parts]))
    half = float(np.sqrt(np.sum([(part.high - part.low) ** 2 for part in parts]))) / 2 / LEVELS
    return Estimate(value, value - half, value + half)


def bank_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a table of banks, the best first."""
    heads = ["radii, m", "Q", "likelihood", "threshold", "reward in selection"]
    lines = [
        [
            " ".join(f"{radius:g}" for radius in row["radii"]),
            f"{row['process_variance']:g}",
            row["likelihood"],
            f"{row['threshold']:g}",
            f"{row['reward']:.3f}",
        ]
        for row in rows
    ]
    return markdown_table(heads, lines)


def markdown(rows: Sequence[dict[str, Any]]) -> str:
    """Return a table of deciders."""
    heads = ["decider", "Q", "threshold", "reward", "less the best rule"]
    lines = []
    for row in rows:
        settings = (
            f"{row[name]:g}" if name in row else "-" for name in ("process_variance", "threshold")
        )
        difference = in_brackets(row["difference"], 3, "+") if "difference" in row else "-"
        lines.append([row["decider"], *settings, in_brackets(row["reward"], 3), difference])
    return markdown_table(heads, lines)


def world_table(worlds: Mapping[str, Sequence[dict[str, Any]]], agents: Sequence[str]) -> str:
    """Return a table of environments: the best rule, and agents beside it."""
    names = [Path(name).name for name in agents]
    heads = ["environment", "best rule", "Q", "threshold", "reward"]
    heads += [*(f"{name} less the rule" for name in names), *(f"{name}, its Q" for name in names)]
    lines = []
    for world, rows in worlds.items():
        best = max(rows[: -2 * len(names)], key=lambda row: row["reward"].value)
        settings = (f"{best[name]:g}" for name in ("process_variance", "threshold"))
        differences = (in_brackets(row["difference"], 3, "+") for row in rows[-2 * len(names) :])
        reward = in_brackets(best["reward"], 3)
        lines.append([world, best["decider"], *settings, reward, *differences])
    return markdown_table(heads, lines)


def figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Draw the rewards of the deciders."""
    picture = Figure((6.4, 0.35 * len(rows) + 0.9), layout="constrained")
    axes = picture.subplots()
    places = np.arange(len(rows))[::-1]
    draw_estimates(axes, places, [row["reward"] for row in rows], horizontal=True, fmt="o")
    axes.set_yticks(places, [row["decider"] for row in rows])
    axes.set_xlabel("reward of a segment or tick, with its 95 % interval")
    axes.grid(axis="x", alpha=0.3)
    return picture
