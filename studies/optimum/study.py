"""Rules and the shipped agent beside the exact posterior, on the same tracks."""

from collections.abc import Sequence
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from joblib import delayed
from matplotlib.figure import Figure

from agents import find_decider, task_of
from baselines import Estimate, Scores, Statistic, ThresholdDecider, record_in, rollout
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions
from studies.arrays import FloatArray, IntArray
from studies.optimum.enumeration import history_posteriors, path_posteriors
from studies.results import draw_estimates, in_parallel, markdown_table, with_half

# Thresholds are selected on tracks from this seed on; reported ones have smaller seeds.
SELECTION = 1_000_000_000
QUICKEST = "HybridTrackQuickest-v0"
# The start is known to all, so that none knows more than another.
KNOWN_START = {"initial_error": 0.0, "heading": 0.0}
COSTS = (0.0, QuickestOptions.change_cost)
EXACT, BOUND, AGENT = "exact posterior", "upper bound", "shipped"
# Deciders that state a mode by its probability; names of `find_decider`.
RULES = {"IMM": "threshold", "beam": "beam"}


# Tracks of which the exact posterior can be computed.
WORLDS: dict[str, dict[str, Any]] = {
    "12 ticks without process noise": {
        "ticks": 12,
        "tau": 0.5,
        "durations": "geometric 6",
        "start": "random",
        "process_variance": 0.0,
    },
    "the first 65 ticks of the environment": {"ticks": 65},
}
# A row of a table, as in JSON: world, noise level R [m^2], figure, decider, and values.
Row = dict[str, Any]


class Recorded(NamedTuple):
    """What was true on N tracks, and what several posteriors say."""

    # (T, N)
    true_modes: IntArray
    # (N, T, 2)
    measurements: FloatArray
    # (T, N, M) logarithms of the probabilities of the modes, by the name of the posterior.
    logs: dict[str, FloatArray]


def environment(options: QuickestOptions, tracks: int) -> HybridTrackQuickestVectorEnv:
    """Return N tracks of one episode each."""
    return HybridTrackQuickestVectorEnv(
        tracks, autoreset_mode="Disabled", tick_info=False, **vars(options)
    )


def record(options: QuickestOptions, tracks: int, seed: int) -> Recorded:
    """Return the true modes and the posteriors of IMM, beam and all histories."""
    env = environment(options, tracks)
    imm, beam = (find_decider(name, options) for name in RULES.values())
    modes, points, read, kept = [], [], [], []
    for now in rollout(env, beam, seed):
        modes.append(env.world.field("true_mode").copy())
        points.append(env.world.field("measurement").copy())
        read.append(imm.evidence(now.observation))
        kept.append(beam.evidence(now.seen, now.state, now.starts))
        if len(modes) == options.ticks:
            break
    true_modes = np.array(modes)
    measurements = np.stack(points, axis=1)
    logs = {name: np.log(values) for name, values in zip(RULES, (read, kept), strict=True)}
    exact = exact_posteriors(options, measurements, true_modes[0])
    return Recorded(true_modes, measurements, {EXACT: exact, **logs})


def exact_posteriors(
    options: QuickestOptions, measurements: FloatArray, first: IntArray, nodes: int = 7
) -> FloatArray:
    """Return the logarithms of the posteriors of the modes, (T, N, M), from measurements (N, T,
    2); the first modes (N,) are used where the bank knows them as well.
    """
    if options.process_variance == 0.0:
        return path_posteriors(options, measurements).swapaxes(0, 1)
    known = options.start == "known"
    posteriors = [
        history_posteriors(options, of_track, mode if known else None, nodes)
        for of_track, mode in zip(measurements, first.tolist(), strict=True)
    ]
    return np.stack(posteriors, axis=1)


def reward(cost: float) -> Statistic:
    """Return the mean reward of a tick at a cost of a change to a wrong mode."""
    return Statistic(("right", "wrong_changes"), lambda right, changes: right - cost * changes)


def scores_of(
    name: str, thresholds: Sequence[float], statements: Sequence[IntArray], recorded: Recorded
) -> Scores:
    """Return the scores of statements (T, N) at every threshold.

    Shares of right ticks and of wrong changes are expected values, given the measurements, by the
    exact posterior: they vary less than what is counted. The share that is counted is kept, too.
    """
    probability = np.exp(recorded.logs[EXACT])
    values = []
    for stated in statements:
        right = np.take_along_axis(probability, stated[..., None], axis=-1)[..., 0]
        changed = np.diff(stated, axis=0, prepend=stated[:1]) != 0
        columns = right, changed * (1.0 - right), stated == recorded.true_modes
        values.append(np.stack([column.mean(0) for column in columns], axis=1))
    return Scores(
        name,
        "threshold",
        tuple(thresholds),
        ("right", "wrong_changes", "counted"),
        np.stack(values, axis=-1),
    )


def all_scores(
    options: QuickestOptions, tracks: int, seed: int
) -> tuple[Recorded, dict[str, Scores]]:
    """Return what was recorded, and the scores of all deciders at all their thresholds."""
    recorded = record(options, tracks, seed)
    scores = {}
    for name, logs in recorded.logs.items():
        rule = ThresholdDecider.create(options)
        stated = [rule.at(threshold).statements(logs) for threshold in rule.thresholds]
        scores[name] = scores_of(name, rule.thresholds, stated, recorded)
    agent = find_decider(AGENT, options)
    made = record_in(partial(environment, options, tracks), agent, seed, agent.thresholds)
    stated = [statements.stated_modes for statements in made]
    scores[AGENT] = scores_of(AGENT, agent.thresholds, stated, recorded)
    return recorded, scores


def bound_scores(logs: FloatArray, cost: float) -> Scores:
    """Return the expected reward of the best statements for somebody who knows the exact posteriors
    of all ticks in advance, (T, N, M), but not the modes: no decider can expect more.

    The cost of the changes is subtracted already, so that no wrong changes are counted.
    """
    right = np.exp(logs)
    # Reward of the best statements so far that end with a mode.
    best = right[0]
    for now in right[1:]:
        changed = best.max(-1, keepdims=True) - cost * (1.0 - now)
        best = now + np.maximum(best, changed)
    values = np.zeros((len(best), 2, 1))
    values[:, 0, 0] = best.max(-1) / len(right)
    return Scores(BOUND, "", (0.0,), ("right", "wrong_changes"), values)


def mean(column: str) -> Statistic:
    """Return the mean of a value over tracks."""
    return Statistic((column,), lambda means: means)


def divergence(exact: FloatArray, logs: FloatArray) -> Estimate:
    """Return the mean divergence of a posterior from the exact one [nats per tick], from their
    logarithms (T, N, M).
    """
    probability = np.exp(exact)
    possible = probability > 0.0
    difference = np.where(possible, exact, 0.0) - np.where(possible, logs, 0.0)
    values = (probability * difference).sum(-1).mean(0)
    scores = Scores("", "", (0.0,), ("divergence",), values[:, None, None])
    return scores.estimate(mean("divergence"))


def checks(recorded: Recorded, options: QuickestOptions, tracks: int = 10) -> list[Row]:
    """Return the divergence of the approximate posteriors from the exact one, and with process
    noise that of the exact one, on some tracks, from one with more nodes.
    """
    exact = recorded.logs[EXACT]
    compared = {name: divergence(exact, recorded.logs[name]) for name in RULES}
    if options.process_variance > 0.0:
        finer = exact_posteriors(
            options, recorded.measurements[:tracks], recorded.true_modes[0, :tracks], nodes=15
        )
        compared["7 nodes, from 15"] = divergence(finer, exact[:, :tracks])
    return [
        {"figure": "divergence", "decider": name, "value": value}
        for name, value in compared.items()
    ]


def evaluate(world: str, noise: float, tracks: int) -> list[Row]:
    """Return rows of all deciders in a world at a noise level.

    Every threshold is the one with the largest mean reward on a third as many other tracks.
    """
    given = KNOWN_START | WORLDS[world] | {"measurement_variance": noise}
    options = task_of(QUICKEST, given).options
    _, chosen = all_scores(options, max(tracks // 3, 20), SELECTION)
    recorded, scores = all_scores(options, tracks, 0)
    place = {"world": world, "noise": noise}
    rows = []
    for cost in COSTS:
        earned = reward(cost)
        selected = {name: int(part.curve(earned).argmax()) for name, part in chosen.items()}
        # Without a cost the most probable mode is the best statement.
        selected[EXACT] = selected[EXACT] if cost else 0
        compared = {name: part.at(selected[name]) for name, part in scores.items()}
        if cost:
            compared |= {BOUND: bound_scores(recorded.logs[EXACT], cost)}
        exact = compared[EXACT]
        for name, here in compared.items():
            row = {
                "figure": f"reward, cost {cost:g}",
                "decider": name,
                "threshold": here.thresholds[0],
                "value": here.estimate(earned),
                "gain": None if here is exact else here.difference(exact, earned),
            }
            rows.append(place | row)
    counted = {
        "figure": "right ticks, counted",
        "decider": EXACT,
        "value": scores[EXACT].estimate(mean("counted"), 0),
    }
    rows += [place | row for row in (counted, *checks(recorded, options))]
    return rows


def evaluate_all(quick: bool, jobs: int) -> list[Row]:
    """Return the rows of all worlds and noise levels, or of few tracks of the first one at one
    level.
    """
    places = [(next(iter(WORLDS)), 0.1)] if quick else product(WORLDS, (0.01, 0.1, 1.0))
    calls = [delayed(evaluate)(*place, 20 if quick else 150) for place in places]
    return [row for rows in in_parallel(calls, jobs, "worlds") for row in rows]


def markdown(rows: Sequence[Row]) -> str:
    """Return a table for each world."""
    frame = pd.DataFrame(rows)
    head = ["figure", "decider", *(f"R = {noise:g}" for noise in frame.noise.unique())]
    text = []
    for world, here in frame.groupby("world", sort=False):
        lines = []
        for names, of_decider in here.groupby(["figure", "decider"], sort=False):
            lines.append([*names, *(cell(row) for row in of_decider.to_dict("records"))])
        text += [f"### {world}\n", markdown_table(head, lines)]
    return "\n".join(text)


def cell(row: Row) -> str:
    """Return a value with half its interval, and the difference to the exact posterior."""
    value, gain = row["value"], row["gain"]
    if isinstance(gain, Estimate):
        return f"{value.value:.3f} ({with_half(gain, 4, '+')})"
    if row["figure"] == "divergence":
        return f"{value.value:.2g} ± {0.5 * (value.high - value.low):.1g}"
    return with_half(value)


def figure(rows: Sequence[Row]) -> Figure:
    """Draw how far the deciders are from the optimum without a cost of changes."""
    frame = pd.DataFrame(rows)
    frame = frame[(frame.figure == f"reward, cost {COSTS[0]:g}") & (frame.decider != EXACT)]
    panels = list(frame.groupby("world", sort=False))
    canvas = Figure(figsize=(4.0 * len(panels) + 2.0, 3.6), layout="constrained")
    every = canvas.subplots(1, len(panels), squeeze=False)[0]
    for (world, of_world), axes in zip(panels, every, strict=True):
        axes.axhline(0.0, color="black", linewidth=1.0, label="optimum")
        noises = of_world.noise.unique()
        for k, (name, curve) in enumerate(of_world.groupby("decider", sort=False)):
            draw_estimates(
                axes,
                # Beside each other.
                np.arange(len(noises)) + 0.05 * (k - 1),
                curve.gain,
                marker="o",
                capsize=3.0,
                label=name,
            )
        axes.set(title=world, xlabel="measurement variance R [m²]")
        axes.set_xticks(range(len(noises)), [f"{noise:g}" for noise in noises])
    every[0].set_ylabel("share of right ticks, less the optimum")
    handles, labels = every[-1].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside right upper", frameon=False)
    return canvas
