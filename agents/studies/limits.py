"""What limits a decision: rules with more and more information, on every filter bank and noise
level.
"""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from agents.evaluation.announced import AnnouncedTask, calibration_rows
from agents.evaluation.cells import in_brackets, markdown_table
from agents.evaluation.registry import find_family
from agents.evaluation.task import Task, gather, sweep
from agents.evaluation.tasks import BANK, QUICKEST, THREE, task_of
from agents.evaluation.unknown import UnknownTask
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_styles
from agents.interface.parallel import Call
from baselines.rules import seeds
from baselines.rules.beam import BeamDecider
from baselines.rules.beam_smoother import BeamSmoother
from baselines.rules.decider import DeciderFamily
from baselines.rules.msprt import GapDecider
from baselines.rules.rollout import record_statements
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.scores import Scores, at_level, mean
from baselines.scoring.statements import STATISTICS, Statements
from hybrid_env.quickest_options import QuickestOptions

# R [m^2].
NOISE_LEVELS = (0.01, 0.1, 1.0)
BANKS = ("published", "anchor_aware", "oracle")
RULES = {THREE: ("ate", "msprt", "bayes"), BANK: ("ate", "msprt-type", "msprt", "bayes")}
AWARE: dict[str, Any] = {"bank": "anchor_aware"}
STEPS: dict[str, tuple[str, dict[str, Any]]] = {
    "ATE on the published bank": ("ate", {}),
    "MSPRT: every hypothesis is compared with every other": ("msprt", {}),
    "the filters start from the covariance of the estimate": ("msprt-kept", {}),
    "the distribution of the anchor error is fitted in simulation": ("calibrated", {}),
    "MSPRT on the anchor-aware bank, which reads the full covariance": ("msprt-aware", AWARE),
    "all filters run on, and the next anchor is merged": (
        "msprt-aware",
        AWARE | {"follow": "bank"},
    ),
    "the anchor is exact (oracle, not available in practice)": ("msprt", {"bank": "oracle"}),
}
"""Decider and changed options of each step for announced switches, in the order of their
information.
"""

LAWS = ("25 + geometric 50", "uniform 50-100")
# Ticks.
LAGS = (5, 10, 20, 40)
# In a batch, which needs about 100 MB.
SMOOTHED_TRACKS = 500
IMM, THRESHOLD = "IMM, the most probable mode", "IMM, tuned threshold"
GEOMETRIC, BEAM = "beam, geometric law of durations", "beam, true law of durations"
LATER = {lag: f"with the measurements of {lag} later ticks (off line)" for lag in LAGS}

CALIBRATION_BANKS: dict[str, dict[str, Any]] = {
    "anchor-aware": {"bank": "anchor_aware"},
    "published, P kept": {"bank": "published", "reset_covariance": False},
    "published": {"bank": "published"},
    "oracle": {"bank": "oracle"},
}
CALIBRATION_EPISODES = 10_000
GAP_THRESHOLD = math.log(99.0)
REWARD = mean("reward")
TIMES = {
    f"time_{100 * level:.0f}": at_level("accuracy", level, mean("ticks")) for level in (0.95, 0.98)
}
"""Mean decision times at two accuracies, by their keys in JSON."""


Row = dict[str, Any]
"""A row of a table, as in JSON: place, noise level R [m^2], step or rule, threshold, and figures
as `Estimate`.
"""


def calls(
    env_id: str,
    episodes: int,
    seed: int,
    further: Sequence[Any] = (),
) -> dict[str, dict[str, Call]]:
    """Return the calls of a study by its parts; every call returns a list of rows.

    Without an environment, both with announced switches are evaluated, `further` deciders on every
    bank. A third as many other episodes, at least 50, serve to select thresholds, those with the
    largest mean reward.
    """
    call = functools.partial
    if env_id == QUICKEST:
        laws = product(LAWS, NOISE_LEVELS)
        return {
            "steps": {
                f"{law}, R = {R:g}": call(unknown_steps, law, R, episodes, seed) for law, R in laws
            }
        }
    parts: dict[str, dict[str, Call]] = {
        "steps": {},
        "rules": {},
        "calibration": {},
        "golubkov2018": {},
    }
    for env, noise in product(RULES, NOISE_LEVELS):
        title = f"{env.rpartition(':')[2]}, R = {noise:g}"
        parts["steps"][f"{title}, steps"] = call(announced_steps, env, noise, episodes, seed)
        for bank, rule in product(BANKS, (*RULES[env], *further)):
            parts["rules"][f"{title}, {bank}, {rule}"] = call(
                rule_on_bank,
                env,
                noise,
                bank,
                rule,
                episodes,
                seed,
            )
    for bank, noise in product(CALIBRATION_BANKS, NOISE_LEVELS):
        parts["calibration"][f"calibration, {bank}, R = {noise:g}"] = call(
            bank_calibration,
            bank,
            noise,
            seed,
        )
    for bank, noise in product(BANKS[:2], NOISE_LEVELS):
        name = f"scheme of 2018, {bank}, R = {noise:g}"
        parts["golubkov2018"][name] = call(type_accuracy_golubkov2018, bank, noise, episodes, seed)
    return parts


def best_threshold(task: Task, family: DeciderFamily, episodes: int) -> int:
    """Return the index of the threshold with the best reward on a third as many other episodes."""
    return task.best(sweep(task, family, max(episodes // 3, 50), seeds.SELECTION))


def _reward(scores: Scores, task: Task, before: Scores | None) -> Row:
    """Return threshold and reward of scores at one threshold, and the gain of reward over the
    step before.
    """
    gain = None if before is None else scores.difference(before, task.statistic(task.goal))
    return {
        "threshold": scores.thresholds[0],
        "reward": scores.estimate(REWARD),
        "gain": gain,
    }


def announced_steps(env_id: str, noise: float, episodes: int, seed: int) -> list[Row]:
    """Evaluate every step for announced switches at a noise level."""
    rows = []
    before = None
    for step, (name, changes) in STEPS.items():
        task = task_of(env_id, {"measurement_variance": noise, **changes})
        by_type = name == "msprt" and task.options.correctness == "type"
        family = find_family("msprt-type" if by_type else name, task.options)
        threshold = family.thresholds[best_threshold(task, family, episodes)]
        scores = sweep(task, family, episodes, seed, thresholds=(threshold,))
        rows.append(
            {
                "env_id": env_id,
                "noise": noise,
                "step": step,
            }
            | _reward(scores, task, before)
        )
        before = scores
    return rows


def rule_on_bank(
    env_id: str,
    noise: float,
    bank: str,
    rule: str,
    episodes: int,
    seed: int,
) -> list[Row]:
    """Evaluate a rule on a bank at a noise level, at all thresholds."""
    task = task_of(env_id, {"measurement_variance": noise, "bank": bank})
    family = find_family(rule, task.options)
    best = best_threshold(task, family, episodes)
    curve = sweep(task, family, episodes, seed)
    row: Row = {
        "env_id": env_id,
        "noise": noise,
        "bank": bank,
        "rule": family.name,
    }
    row |= {name: curve.estimate(time) for name, time in TIMES.items()}
    return [row | {"reward": curve.at(best).estimate(REWARD), "threshold": family.thresholds[best]}]


def bank_calibration(bank: str, noise: float, seed: int) -> list[Row]:
    """Return the calibration of a bank at a noise level on HybridTrackPublished-v0."""
    options = {"measurement_variance": noise, **CALIBRATION_BANKS[bank]}
    rows = calibration_rows(CALIBRATION_EPISODES, seed, options)
    return [
        {
            "bank": bank,
            "noise": noise,
            **row,
        }
        for row in rows
    ]


def type_accuracy_golubkov2018(bank: str, noise: float, episodes: int, seed: int) -> list[Row]:
    """Return the gap rule at ln 99 on the scheme of Golubkov 2018, where ATE is right in 72-80
    %.
    """
    options = {
        "scheme": "golubkov2018",
        "heading": math.pi / 2,
        "initial_error": 0,
    }
    task = AnnouncedTask(BANK, options | {"measurement_variance": noise, "bank": bank})
    scores = sweep(
        task,
        GapDecider.family(task.options),
        episodes,
        seed,
        thresholds=(GAP_THRESHOLD,),
    )
    accuracy = scores.estimate(mean("type_accuracy", share=True))
    ticks = float(scores.curve(mean("ticks"))[0])
    return [
        {
            "bank": bank,
            "noise": noise,
            "accuracy": accuracy,
            "ticks": ticks,
        }
    ]


def unknown_steps(law: str, noise: float, tracks: int, seed: int) -> list[Row]:
    """Evaluate every step for unknown switches for a law and a noise level, on the same tracks."""
    task = UnknownTask(QUICKEST, {"durations": law, "measurement_variance": noise})
    selection = _curves(task, max(tracks // 3, 50), seeds.SELECTION)
    rows = []
    before = None
    for step, curve in _curves(task, tracks, seed).items():
        scores = curve.at(task.best(selection[step]))
        row = {
            "law": law,
            "noise": noise,
            "step": step,
        } | _reward(scores, task, before)
        for key, name in (
            ("delay", "full_delay"),
            ("wrong_changes", "wrong_changes"),
        ):
            row[key] = scores.estimate(STATISTICS[name])
        rows.append(row | {"most_probable_right": curve.at(0).estimate(STATISTICS["right"])})
        before = scores
    return rows


def _curves(task: UnknownTask, tracks: int, seed: int) -> dict[str, Scores]:
    """Return the scores of all steps; the first threshold of each is 0."""
    imm, geometric = (
        sweep(task, find_family(name, task.options), tracks, seed)
        for name in ("threshold", "beam-geometric")
    )
    smoothed = smoothed_scores(task, tracks, seed, (0, *LAGS))
    curves = {
        IMM: imm.at(0),
        THRESHOLD: imm,
        GEOMETRIC: geometric,
        BEAM: smoothed[0],
    }
    return curves | {LATER[lag]: smoothed[lag] for lag in LAGS}


def smoothed_scores(
    task: UnknownTask,
    tracks: int,
    seed: int,
    lags: Sequence[int],
) -> dict[int, Scores]:
    """Return the scores of the threshold rule on the posterior at later ticks, by lag; 0 is the
    beam itself.
    """
    options: QuickestOptions = task.options
    family = BeamDecider.family(options)
    parts: dict[int, list[Any]] = {lag: [[] for _ in family.thresholds] for lag in lags}
    for first in range(0, tracks, SMOOTHED_TRACKS):
        smoother = BeamSmoother(family.make(family.default), lags)
        count = min(SMOOTHED_TRACKS, tracks - first)
        true_modes, _ = record_statements(smoother, count, seed + first, **vars(options))
        for lag in lags:
            with np.errstate(divide="ignore"):
                log_probability = np.log(smoother.posterior(lag))
            for found, threshold in zip(parts[lag], family.thresholds, strict=True):
                stated = ThresholdDecider(threshold).statements(log_probability)
                found.append(task.measured(Statements(true_modes, stated)))
    names = {lag: f"{family.name}, {lag} ticks later" if lag else family.name for lag in lags}
    named = {lag: replace(family, name=name) for lag, name in names.items()}
    return {lag: gather(task, named[lag], family.thresholds, found) for lag, found in parts.items()}


def markdown(parts: Mapping[str, Sequence[Row]]) -> str:
    """Return all tables of a study, see `calls`; of the steps one for each environment or law."""
    gain = "Mean reward {}; in brackets the gain over the row before, with its 95 % interval."
    if "rules" not in parts:
        # That of the IMM.
        right = [row for row in parts["steps"] if row["step"] != THRESHOLD]
        tables: list[tuple[str, Sequence[Row], Callable[[Row], str]]] = [
            (gain.format("of a tick at the tuned threshold"), parts["steps"], _gain_cell),
            (
                (
                    "Mean delay of a switch in ticks (one that is not detected counts until the end"
                    " of its segment) / wrong changes of the statement per 1,000 ticks, at the same"
                    " thresholds."
                ),
                parts["steps"],
                _delay_cell,
            ),
            (
                (
                    "Share of ticks at which the most probable mode is the true one, %, without a"
                    " threshold."
                ),
                right,
                lambda row: in_brackets(row["most_probable_right"], 1, 100.0),
            ),
        ]
        return _sections("HybridTrackQuickest-v0, durations {}", "law", ["step"], tables)
    times = (
        "Mean decision time in ticks at 95 % / at 98 % accuracy; mean reward per segment at the"
        " best threshold."
    )
    steps = (gain.format("per segment"), parts["steps"], _gain_cell)
    rules = (times, parts["rules"], _times_cell)
    calibration = (
        "### Calibration of the banks: accuracy / mean posterior of the most probable hypothesis,"
        " %\n\nHybridTrackPublished-v0, no decisions; in brackets the largest calibration error"
        " (mean posterior minus accuracy in a bin of the posterior).\n\n"
    )
    cells: dict[tuple[str, str], list[str]] = {}
    for one in parts["calibration"]:
        worst = "-" if one["worst"] is None else f"{100 * one['worst']:+.1f}"
        cell = f"{100 * one['right']:.1f} / {100 * one['stated']:.1f} ({worst})"
        cells.setdefault((one["bank"], f"{one['noise']:g}"), []).append(cell)
    ticks = dict.fromkeys(f"after {one['ticks']} ticks" for one in parts["calibration"])
    calibration += markdown_table(
        ("bank", "R", *ticks),
        [(*key, *texts) for key, texts in cells.items()],
    )
    accuracy = [
        (
            _name(row["bank"]),
            f"{row['noise']:g}",
            in_brackets(row["accuracy"], 1, 100.0),
            f"{row['ticks']:.1f}",
        )
        for row in parts["golubkov2018"]
    ]
    scheme = "### The gap rule at ln 99 on the scheme of Golubkov 2018\n\n"
    scheme += markdown_table(("bank", "R", "type accuracy, %", "mean ticks"), accuracy)
    bound = _sections("From ATE to the bound on {}", "env_id", ["step"], [steps])
    return "\n".join(
        [bound, _sections("{}", "env_id", ["bank", "rule"], [rules]), calibration, scheme]
    )


def _sections(
    title: str,
    place: str,
    names: Sequence[str],
    tables: Sequence[tuple[str, Sequence[Row], Callable[[Row], str]]],
) -> str:
    """Return a section for each place, with tables of cells of rows below their text; noise
    levels are in columns.
    """
    heads = [*names, *(f"R = {noise:g}" for noise in NOISE_LEVELS)]
    parts = []
    for where in dict.fromkeys(row[place] for row in tables[0][1]):
        parts.append(f"### {title.format(where.rpartition(':')[2])}\n")
        for text, rows, cell in tables:
            lines: dict[tuple[str, ...], list[str]] = {}
            for row in sorted(rows, key=lambda row: NOISE_LEVELS.index(row["noise"])):
                if row[place] == where:
                    key = tuple(_name(row[name]) if name == "bank" else row[name] for name in names)
                    lines.setdefault(key, []).append(cell(row))
            parts += [
                f"{text}\n",
                markdown_table(heads, [(*name, *cells) for name, cells in lines.items()]),
            ]
    return "\n".join(parts)


def _name(bank: str) -> str:
    return bank.replace("_", "-")


def _gain_cell(row: Row) -> str:
    reward = f"{row['reward'].value:.3f}"
    gain = row["gain"]
    return reward if gain is None else f"{reward} ({in_brackets(gain, 3, sign='+')})"


def _delay_cell(row: Row) -> str:
    delay = row["delay"].value
    wrong = row["wrong_changes"].value
    return f"{f'{delay:.1f}' if np.isfinite(delay) else '-'} / {wrong:.2f}"


def _times_cell(row: Row) -> str:
    return (
        f"{' / '.join(in_brackets(row[time], 1) for time in TIMES)};"
        f" {in_brackets(row['reward'], 3)}"
    )


# Of a figure [in].
WIDTH = 13.0
# Labels, which are the names of the deciders in other figures.
NAMES = {
    IMM: "IMM",
    THRESHOLD: "IMM threshold",
    GEOMETRIC: "beam, geometric",
    BEAM: "beam",
}


def figure(parts: Mapping[str, Sequence[Row]]) -> Figure:
    """Return the figure of a study, see `calls`."""
    return decision_times(parts["rules"]) if "rules" in parts else later_ticks(parts["steps"])


def decision_times(rows: Sequence[Row]) -> Figure:
    """Mean decision time at 98 % accuracy over the noise, one row per environment, one column
    per bank.

    Rules that do not reach 98 % at a noise level are above the line at the top. Coinciding lines
    remain visible, as the last is dashed and markers become smaller.
    """
    levels = {noise: f"{noise:g}" for noise in NOISE_LEVELS}
    noise = Axis(
        "measurement variance R, m²",
        (0.7 * NOISE_LEVELS[0], 1.5 * NOISE_LEVELS[-1]),
        levels,
        log=True,
    )
    styles = decider_styles(dict.fromkeys(row["rule"] for row in rows))
    grid = []
    for place in dict.fromkeys(row["env_id"] for row in rows):
        here = [row for row in rows if row["env_id"] == place]
        times = {(row["bank"], row["rule"], row["noise"]): row["time_98"].value for row in here}
        top = 5.0 * float(np.ceil(max(filter(np.isfinite, times.values()), default=10.0) / 5.0))
        ticks = {tick: f"{tick:g}" for tick in np.arange(0, top + 1, 10).tolist()} | {
            1.09 * top: "not reached"
        }
        time = Axis(
            "mean decision time\nat 98 % accuracy, ticks",
            (0.0, 1.15 * top),
            ticks,
            levels=(1.03 * top,),
        )
        rules = list(dict.fromkeys(rule for _, rule, _ in times))
        panels = []
        for bank in BANKS:
            curves = []
            for index, rule in enumerate(rules):
                own = {
                    level: min(one, 1.09 * top)
                    for (*key, level), one in times.items()
                    if key == [bank, rule]
                }
                style: dict[str, Any] = {
                    "size": 8.5 - 1.3 * index,
                    "dashes": "--" if rule == rules[-1] else "-",
                }
                curves.append(
                    Curve(
                        rule,
                        styles[rule],
                        [*own],
                        [*own.values()],
                        filled=True,
                        width=1.8,
                        **style,
                    )
                )
            title = f"{place.rpartition(':')[2]}, {_name(bank)} bank"
            panels.append(Panel(title, noise, time, curves))
        grid.append(panels)
    return curve_figure(grid, (WIDTH, 3.9 * len(grid)), sharex=True, sharey="row")


def later_ticks(rows: Sequence[Row]) -> Figure:
    """Mean reward of a tick against the later ticks known, one row per law, one column per noise
    level.

    The curve of the beam that knows the law begins with its reward on line. The other lines are the
    rules below it, dotted without a threshold. Bars are 95 % confidence intervals.
    """
    grid = []
    styles = decider_styles(NAMES.values())
    lags = [0, *LATER]
    for law in LAWS:
        panels = []
        for noise in NOISE_LEVELS:
            steps = {
                row["step"]: row["reward"]
                for row in rows
                if (row["law"], row["noise"]) == (law, noise)
            }
            known = [steps[step] for step in (BEAM, *LATER.values())]
            curves = [
                Curve(
                    NAMES[BEAM],
                    styles[NAMES[BEAM]],
                    lags,
                    known,
                    size=5.0,
                    filled=True,
                    width=1.5,
                )
            ]
            for step in (GEOMETRIC, THRESHOLD, IMM):
                # The same bank.
                style = styles[NAMES[THRESHOLD if step == IMM else step]]
                ends = [lags[0], lags[-1]]
                reward = [steps[step].value] * 2
                curves.append(
                    Curve(
                        NAMES[step],
                        style,
                        ends,
                        reward,
                        size=0.0,
                        dashes=":" if step == IMM else "--",
                    )
                )
            title = f"durations {law}, R = {noise:g} m²"
            panels.append(
                Panel(title, Axis("later ticks known"), Axis("mean reward of a tick"), curves)
            )
        grid.append(panels)
    return curve_figure(grid, (WIDTH, 3.7 * len(LAWS)), sharex=True, sharey=True)
