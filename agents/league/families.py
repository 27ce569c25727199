"""Families of learned deciders in the league: one recipe, trained with several seeds.

The entry of a family has the mean rewards over its seeds. Its table has interquartile means with
stratified bootstrap intervals (Agarwal et al. 2021), the calibration of what it states, and its
cost.
"""

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from rich.progress import Progress

from agents.algorithms import find_algorithm
from agents.evaluation.registry import find_family
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import decider_styles
from agents.interface.input_files import read_json
from agents.interface.output_files import write_json
from agents.interface.parallel import Workers
from agents.interface.world_arguments import CARD
from agents.league.protocol import (
    GROUPS,
    QUICKEST,
    SEED,
    THREE,
    make_entry,
    pack,
    play,
    read_entry,
    scores_of,
    world_task,
)
from agents.learned.posterior_decider import PosteriorDecider
from agents.studies.comparison import train_agent
from agents.studies.continuation import Continuation, Plan
from agents.training.learning_curve import REWARD_KEY, learning_points
from agents.training.recipe import load_recipe
from agents.training.run_folder import read_metrics
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Actions, Decider
from baselines.rules.own import as_decider
from baselines.rules.rollout import rollout
from baselines.scoring.estimates import RESAMPLES, Estimate
from hybrid_env.checks import ArgumentError, FloatArray, reject
from hybrid_env.registration import make_track_vector_env

HOMES = {ANNOUNCED: (THREE, "R = 0.1"), UNKNOWN: (QUICKEST, "unknown, R = 0.1")}
"""Environment of the training, and its world, by task."""
CAPTION = (
    "all: interquartile mean of the reward over seeds and worlds, with a 95 % stratified bootstrap"
    " interval. stated less right: mean stated probability of declarations less their accuracy. A"
    " decision is timed with 1,024 tracks at a time."
)
PROBED_TRACKS, PROBED_TICKS = 1024, 200
PROBE_SEED = SEED + 10**6


class Probe(Decider):
    """A decider that measures its time and what it states at its declarations."""

    def __init__(self, decider: Decider):
        self.decider, self.observes = decider, decider.observes
        self.observe = decider.observe  # type: ignore[method-assign]
        # Of every tick, for all tracks.
        self.seconds: list[float] = []
        # (N,) largest probability of the last tick; NaN where the decider states none.
        self.stated = np.zeros(0)

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Actions, Any]:
        self.stated = np.full(len(observation), np.nan)
        # First, because a state may change in place.
        if isinstance(self.decider, PosteriorDecider):
            self.stated = self.decider.evidence(observation, state, episode_start).max(-1)
        began = time.perf_counter()
        found = self.decider.predict(observation, state, episode_start)
        self.seconds.append(time.perf_counter() - began)
        return found


def probe(name: str, world: str, threshold: float) -> tuple[float, float]:
    """Return the mean stated probability less the accuracy of declarations, and the time of a
    decision in µs.
    """
    # For small networks the overhead of threads exceeds the gain.
    torch.set_num_threads(1)
    task = world_task(world)
    env = make_track_vector_env(task.env_id, PROBED_TRACKS, tick_info=False, **task.given)
    decider = Probe(as_decider(find_family(name, task.options).make(threshold)))
    less = []
    for now in rollout(env, decider, PROBE_SEED):
        if now.step and task.waits:
            chosen = now.actions > 0
            less.append(
                decider.stated[chosen] - (now.rewards[chosen] + task.options.delay_cost > 0.0)
            )
        if now.step == PROBED_TICKS:
            break
    calibration = float(np.concatenate(less).mean()) if less else float("nan")
    return calibration, 1e6 * float(np.median(decider.seconds)) / PROBED_TRACKS


def home_of(recipe: str) -> tuple[str, str]:
    """Return the environment in which a recipe is trained, and its world; refuse one for no
    environment.
    """
    errors = []
    for task, home in HOMES.items():
        try:
            if task in find_algorithm(load_recipe(recipe, home[0]).algo).tasks:
                return home
        except ArgumentError as error:
            # Such as a recipe without an entry for this environment.
            errors.append(error)
    if errors:
        raise errors[0]
    raise reject(
        "deciders",
        recipe,
        "a recipe for HybridTrackPublished-v0 or HybridTrackQuickest-v0",
    )


def title_of(name: str) -> str:
    """Return the title of a decider or of a recipe; the name itself if it decides in no
    environment of the league.
    """
    if name.endswith(".yml"):
        return str(load_recipe(name, home_of(name)[0]).name)
    for _, world in HOMES.values():
        try:
            return find_family(name, world_task(world).options).name
        except ArgumentError:
            # It is for the other environment.
            pass
    return name


def train(recipe: str, number: int, steps: int | None, out: Path) -> Path:
    """Train an agent of a recipe in a run folder below `out`, or go on with it; return the run
    folder.
    """
    env_id, world = home_of(recipe)
    plan = Plan(world_task(world), (), (recipe,), 1, 0, 1, steps)
    continuation = Continuation(plan.settings, out)
    _, folder = train_agent(
        load_recipe(recipe, env_id),
        plan,
        number,
        Progress(disable=True),
        continuation,
    )
    assert folder is not None
    return folder


def play_agent(folder: Path, worlds: Sequence[str]) -> dict[str, Any]:
    """Play a trained agent in some worlds. Its entry stays in the run folder, and is read from
    there the next time.
    """
    path = folder / "league.json"
    if not path.is_file():
        write_json(path, play(str(folder), Workers(), lambda world: None, worlds))
    return read_entry(path)


def play_family(
    recipe: str,
    training_seeds: int,
    steps: int | None,
    workers: Workers,
    out: Path,
    on_done: Callable[[int], None],
) -> tuple[dict[str, Any], list[Path]]:
    """Train a recipe with every seed and play all agents; return the entry of the family and the
    run folders.

    `on_done` is called with the training seed after each training and after each agent that has
    played.
    """
    trainings = {
        number: functools.partial(train, recipe, number, steps, out)
        for number in range(training_seeds)
    }
    folders = dict(workers.results(trainings, on_done))
    env_id, home = home_of(recipe)
    worlds = GROUPS[env_id]
    plays = {
        number: functools.partial(play_agent, folder, worlds) for number, folder in folders.items()
    }
    entries = [entry for _, entry in workers.results(plays, on_done)]
    costs = []
    # One after the other, for the sake of times.
    for folder, entry in zip(folders.values(), entries, strict=True):
        found = probe(str(folder), home, entry["worlds"][home]["threshold"])
        costs.append((*found, read_json(folder / CARD)["seconds"]))
    names = "calibration", "microseconds", "seconds"
    means = (float(mean) if np.isfinite(mean) else None for mean in np.mean(costs, 0))
    cost = dict(zip(names, means, strict=True))
    return merged(load_recipe(recipe, env_id).name, entries, cost), list(folders.values())


def merged(title: str, entries: Sequence[dict[str, Any]], cost: dict[str, Any]) -> dict[str, Any]:
    """Return the entry of a family: rewards of episodes, metrics and thresholds are means over
    the agents.
    """
    worlds = {}
    for world in entries[0]["worlds"]:
        agents = [entry["worlds"][world] for entry in entries]
        rewards = np.array(
            [scores.of("reward", 0) for entry in entries if (scores := scores_of(entry, world))]
        )
        metrics = {}
        for name in agents[0]["metrics"]:
            known = [
                value for one in agents if (value := one["metrics"][name]["value"]) is not None
            ]
            metrics[name] = {"value": float(np.mean(known)) if known else None}
        worlds[world] = {
            "threshold": float(np.mean([one["threshold"] for one in agents])),
            "metrics": metrics,
            "rewards": pack(rewards.mean(0)),
            "seeds": rewards.mean(1).tolist(),
        }
    return make_entry(title, title, entries[0]["kind"], worlds, cost)


def interquartile_mean(rewards: FloatArray) -> Estimate:
    """Return the interquartile mean of the rewards (S, W) of S training seeds in W worlds.

    The interval is that of a bootstrap that resamples the seeds of each world by themselves.
    """
    from scipy import stats

    index = np.random.default_rng(0).integers(len(rewards), size=(RESAMPLES, *rewards.shape))
    found = np.take_along_axis(rewards[None], index, axis=1).reshape(RESAMPLES, -1)
    low, high = np.quantile(stats.trim_mean(found, 0.25, axis=1), (0.025, 0.975))
    return Estimate(float(stats.trim_mean(rewards, 0.25, axis=None)), float(low), float(high))


def families_tables(
    entries: Sequence[dict[str, Any]],
) -> dict[str, tuple[list[str], list[tuple[str, ...]]]]:
    """Return heads and rows of a table for each environment in which families have been trained,
    by its id.
    """
    tables = {}
    for env_id, home in HOMES.values():
        worlds = GROUPS[env_id]
        rows: list[tuple[str, ...]] = []
        for entry in entries:
            if "seeds" not in entry["worlds"].get(home, {}):
                continue
            seeds = np.array([entry["worlds"][world]["seeds"] for world in worlds]).T
            found = [interquartile_mean(part) for part in (seeds, *seeds.T[:, :, None])]
            cells = [f"{one.value:.3f} ({one.low:.3f}, {one.high:.3f})" for one in found]
            calibration, microseconds, seconds = entry["cost"].values()
            stated = "-" if calibration is None else f"{100.0 * calibration:+.1f}"
            rows.append(
                (entry["title"], *cells, stated, f"{microseconds:.1f}", f"{seconds / 60.0:.1f}")
            )
        if rows:
            heads = [
                "family",
                "all",
                *worlds,
                "stated less right, %",
                "decision, µs",
                "training, min",
            ]
            tables[env_id] = heads, sorted(rows, key=lambda row: row[1], reverse=True)
    return tables


def training_figure(runs: Mapping[str, Sequence[Path]]) -> Figure:
    """Return a figure of the rewards during training, from the run folders of the agents of each
    recipe.
    """
    styles = decider_styles(runs)
    panels = []
    for task, (env_id, _) in HOMES.items():
        curves = []
        for name, folders in runs.items():
            points = [learning_points(read_metrics(folder)) for folder in folders]
            count = min(map(len, points))
            if home_of(name)[0] == env_id and count:
                rewards = np.array([[row[REWARD_KEY] for row in rows[:count]] for rows in points])
                steps = [row["step"] / 1e6 for row in points[0][:count]]
                bounds = np.array([rewards.min(0), rewards.max(0)])
                curves.append(Curve(name, styles[name], steps, rewards.mean(0), bounds, size=3.0))
        if curves:
            unit = "tick" if task == UNKNOWN else "segment"
            x = Axis("environment steps, millions", log=True)
            y = Axis(f"mean reward per {unit}")
            panels.append(Panel(env_id.rpartition(":")[2], x, y, curves))
    title = "Reward in training: mean and range of the seeds"
    return curve_figure([panels], (2.0 + 6.0 * len(panels), 5.0), title)
