"""Families of learned deciders in the league: one recipe, trained with several seeds.

The entry of a family has the mean rewards over its seeds. Its table has interquartile means with
stratified bootstrap intervals (Agarwal et al. 2021), the calibration of what it states, and its
cost.
"""

import json
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pandas as pd
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy import stats

from agents import find_algorithm, find_family, load_recipe, train
from baselines import Decider, Estimate, rollout
from hybrid_env import ArgumentError
from studies.league.protocol import (
    QUICKEST,
    SEED,
    THREE,
    WORLDS,
    Protocol,
    collect,
    make_entry,
    pack,
    play_world,
    read_entry,
    scores_of,
    world_task,
)

RECIPES = Path(__file__).parent / "recipes"
# Environments of the trainings, and the worlds in which decisions are timed.
HOMES = {THREE: "R = 0.1", QUICKEST: "unknown, R = 0.1"}
PROBED_TRACKS, PROBED_TICKS = 1024, 200
PROBE_SEED = SEED + 10**6
RESAMPLES = 2000
REWARD_KEY = "evaluation/reward"


class Probe(Decider):
    """A decider that measures its time and what it states at its declarations."""

    def __init__(self, decider: Decider):
        self.decider, self.observes = decider, decider.observes
        self.observe = decider.observe  # type: ignore[method-assign]
        # Of every tick, for all tracks.
        self.seconds: list[float] = []
        # (N,) largest probability of the last tick; NaN where the decider states none.
        self.stated = np.zeros(0)

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Any, Any]:
        self.stated = np.full(len(observation), np.nan)
        # First, because a state may change in place. A posterior has the symbol alpha.
        if self.decider.symbol == "alpha":
            self.stated = self.decider.evidence(
                observation,
                state,
                episode_start,
            ).max(-1)
        began = time.perf_counter()
        answer = self.decider.predict(
            observation,
            state,
            episode_start,
        )
        self.seconds.append(time.perf_counter() - began)
        return answer


def probe(name: str, world: str, threshold: float, tracks: int) -> tuple[float, float]:
    """Return the mean stated probability less the accuracy of declarations, and the time of a
    decision in µs.
    """
    # For small networks the overhead of threads exceeds the gain.
    torch.set_num_threads(1)
    task = world_task(world)
    keywords: dict[str, Any] = {
        "vectorization_mode": "vector_entry_point",
        "max_episode_steps": -1,
        "tick_info": False,
        **task.given,
    }
    env = gym.make_vec(task.env_id, tracks, **keywords)
    decider = Probe(find_family(name, task.options).make(threshold))
    less = []
    for now in rollout(
        env,
        decider,
        PROBE_SEED,
    ):
        if now.step and task.waits:
            chosen = now.actions > 0
            right = now.rewards[chosen] + task.options.delay_cost > 0.0
            less.append(decider.stated[chosen] - right)
        if now.step == PROBED_TICKS:
            break
    calibration = float(np.concatenate(less).mean()) if less else float("nan")
    return calibration, 1e6 * float(np.median(decider.seconds)) / tracks


def recipe_file(name: str) -> str:
    """Return the file of a recipe of this study, or the name itself, as of a package's recipe."""
    path = RECIPES / f"{name}.yml"
    return str(path) if path.is_file() else name


def home_of(recipe: str) -> str:
    """Return the environment in which a recipe is trained; refuse one for no environment."""
    for env_id in HOMES:
        try:
            algorithm = find_algorithm(load_recipe(recipe_file(recipe), env_id).algo)
        except ArgumentError as error:
            # Such as a recipe without an entry for this environment.
            refusal = error
            continue
        if task_name(env_id) in algorithm.tasks:
            return env_id
        refusal = ArgumentError(f"{recipe}: expected a recipe for one of {', '.join(HOMES)}")
    raise refusal


def task_name(env_id: str) -> str:
    """Return what deciders of an environment decide."""
    return str(world_task(HOMES[env_id]).switches)


def train_agent(recipe: str, number: int, steps: int | None, out: Path) -> Path:
    """Train an agent of a recipe in a run folder below `out`, or go on with it; return the run
    folder.
    """
    env_id = home_of(recipe)
    file = recipe_file(recipe)
    name = load_recipe(file, env_id).name
    folder = out / "agents" / f"{name}-{steps or 'all'}-seed{number}"
    train(
        file,
        env_id,
        out=folder,
        seed=number,
        steps=steps,
        resume=True,
    )
    return folder


def play_agent(recipe: str, folder: Path, protocol: Protocol) -> dict[str, Any]:
    """Play a trained agent. Its entry stays in the run folder, and is read from there the next
    time.
    """
    env_id = home_of(recipe)
    path = folder / "league.json"
    if not path.is_file():
        episodes = protocol.episodes[env_id]
        worlds = protocol.some(env_id)
        entry = collect(
            str(folder),
            {
                world: play_world(
                    str(folder),
                    world,
                    episodes,
                )
                for world in worlds
            },
        )
        path.write_text(json.dumps(entry, indent=2), encoding="utf-8")
    return read_entry(path)


def play_family(
    recipe: str,
    training_seeds: int,
    steps: int | None,
    protocol: Protocol,
    out: Path,
    tracks: int = PROBED_TRACKS,
) -> tuple[dict[str, Any], list[Path]]:
    """Train a recipe with every seed and play all agents; return the entry of the family and the
    run folders. Decisions are timed with a number of tracks at a time.
    """
    trainings = [
        partial(
            train_agent,
            recipe,
            k,
            steps,
            out,
        )
        for k in range(training_seeds)
    ]
    folders = list(protocol.parallel(trainings))
    plays = [
        partial(
            play_agent,
            recipe,
            folder,
            protocol,
        )
        for folder in folders
    ]
    entries = list(protocol.parallel(plays))
    home = HOMES[home_of(recipe)]
    costs = []
    # One after the other, for the sake of times.
    for folder, entry in zip(
        folders,
        entries,
        strict=True,
    ):
        card = json.loads((folder / "policy.json").read_text(encoding="utf-8"))
        threshold = entry["worlds"][home]["threshold"]
        costs.append(
            (
                *probe(
                    str(folder),
                    home,
                    threshold,
                    tracks,
                ),
                card["seconds"],
            )
        )
    names = "calibration", "microseconds", "seconds"
    means = (float(mean) if np.isfinite(mean) else None for mean in np.mean(costs, 0))
    title = load_recipe(recipe_file(recipe), home_of(recipe)).name
    return merged(
        title,
        entries,
        dict(
            zip(
                names,
                means,
                strict=True,
            )
        ),
    ), folders


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
                value for agent in agents if (value := agent["metrics"][name]["value"]) is not None
            ]
            metrics[name] = {"value": float(np.mean(known)) if known else None}
        worlds[world] = {
            "threshold": float(np.mean([agent["threshold"] for agent in agents])),
            "metrics": metrics,
            "rewards": pack(rewards.mean(0)),
            "seeds": rewards.mean(1).tolist(),
        }
    return make_entry(
        title,
        title,
        entries[0]["kind"],
        worlds,
        cost,
    )


def interquartile_mean(rewards: NDArray[np.float64]) -> Estimate:
    """Return the interquartile mean of the rewards (S, W) of S training seeds in W worlds.

    The interval is that of a bootstrap that resamples the seeds of each world by themselves.
    """
    index = np.random.default_rng(0).integers(len(rewards), size=(RESAMPLES, *rewards.shape))
    resampled = np.take_along_axis(
        rewards[None],
        index,
        axis=1,
    ).reshape(RESAMPLES, -1)
    low, high = np.quantile(
        stats.trim_mean(
            resampled,
            0.25,
            axis=1,
        ),
        (0.025, 0.975),
    )
    return Estimate(
        float(
            stats.trim_mean(
                rewards,
                0.25,
                axis=None,
            )
        ),
        float(low),
        float(high),
    )


def families_tables(entries: Sequence[Mapping[str, Any]]) -> dict[str, pd.DataFrame]:
    """Return a table for each environment in which families have been trained, by its id.

    all: interquartile mean of the reward over seeds and worlds. stated less right: mean stated
    probability of declarations less their accuracy.
    """
    tables = {}
    for env_id, home in HOMES.items():
        rows = []
        for entry in entries:
            if "seeds" not in entry["worlds"].get(home, {}):
                continue
            worlds = [world for world in WORLDS if world in entry["worlds"]]
            seeds = np.array([entry["worlds"][world]["seeds"] for world in worlds]).T
            parts = {"all": seeds} | dict(
                zip(
                    worlds,
                    seeds.T[:, :, None],
                    strict=True,
                )
            )
            means = {name: interquartile_mean(part) for name, part in parts.items()}
            calibration, microseconds, seconds = entry["cost"].values()
            rows.append(
                {"family": entry["title"]}
                | {
                    name: f"{mean.value:.3f} ({mean.low:.3f}, {mean.high:.3f})"
                    for name, mean in means.items()
                }
                | {
                    "stated less right, %": "-"
                    if calibration is None
                    else f"{100.0 * calibration:+.1f}",
                    "decision, µs": f"{microseconds:.1f}",
                    "training, min": f"{seconds / 60.0:.1f}",
                }
            )
        if rows:
            tables[env_id] = pd.DataFrame(rows).sort_values("all", ascending=False)
    return tables


def training_figure(runs: Mapping[str, Sequence[Path]]) -> Figure:
    """Return a figure of the rewards during training, from the run folders of the agents of each
    recipe.
    """
    figure = Figure((14.0, 5.0), layout="constrained")
    for axes, env_id in zip(
        figure.subplots(1, len(HOMES)),
        HOMES,
        strict=True,
    ):
        for name, folders in runs.items():
            if home_of(name) != env_id:
                continue
            lines = [pd.read_json(folder / "metrics.jsonl", lines=True) for folder in folders]
            points = [table.dropna(subset=[REWARD_KEY]) for table in lines]
            count = min(map(len, points))
            rewards = np.array([table[REWARD_KEY][:count] for table in points])
            steps = points[0]["step"][:count] / 1e6
            axes.plot(
                steps,
                rewards.mean(0),
                marker=".",
                label=name,
            )
            axes.fill_between(
                steps,
                rewards.min(0),
                rewards.max(0),
                alpha=0.2,
            )
        axes.set_title(env_id.rpartition(":")[2])
        axes.set_xscale("log")
        axes.set_xlabel("environment steps, millions")
        axes.set_ylabel("mean reward, with the range of the seeds")
        if axes.lines:
            axes.legend()
    return figure
