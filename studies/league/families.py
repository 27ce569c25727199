"""Families of learned deciders in the league: one recipe, trained with several seeds.

The entry of a family has the mean rewards over its seeds. Its table has interquartile means with
stratified bootstrap intervals (Agarwal et al. 2021), the calibration of what it states, and its
cost.
"""

import copy
import json
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import gymnasium as gym
import joblib
import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray
from scipy import stats

from agents import find_algorithm, find_decider, load_recipe, train
from baselines import Estimate, rollout
from hybrid_env import ArgumentError
from studies.league.protocol import (
    QUICKEST,
    SEED,
    THREE,
    WORLDS,
    make_entry,
    pack,
    play,
    read_entry,
    scores_of,
    world_task,
)

# Environments of the trainings, and the worlds in which decisions are timed.
HOMES = {THREE: "R = 0.1", QUICKEST: "unknown, R = 0.1"}


def probe(name: str, world: str, threshold: float, tracks: int) -> tuple[float, float]:
    """Return the mean stated probability less the accuracy of declarations, and the time of a
    decision in µs.
    """
    # For small networks the overhead of threads exceeds the gain.
    torch.set_num_threads(1)
    task = world_task(world)
    env = gym.make_vec(
        task.env_id,
        tracks,
        vectorization_mode="vector_entry_point",
        max_episode_steps=-1,
        **task.given,
    )
    decider = find_decider(name, task.options).at(threshold)
    differences = [np.empty(0)]
    seconds = []
    stated = np.zeros(tracks)
    for now in rollout(env, decider, SEED + 10**6):
        # A posterior has the symbol alpha.
        if now.step and decider.symbol == "alpha":
            chosen = now.actions > 0
            right = now.rewards[chosen] + task.options.delay_cost > 0.0
            differences.append(stated[chosen] - right)
        if now.step == 200:
            break
        if decider.symbol == "alpha":
            stated = decider.evidence(now.seen, now.state, now.starts).max(-1)
        # A copy, because a state may change in place.
        state = copy.deepcopy(now.state)
        began = time.perf_counter()
        decider.predict(now.seen, state, now.starts)
        seconds.append(time.perf_counter() - began)
    calibration = np.concatenate(differences)
    return (
        float(calibration.mean()) if calibration.size else np.nan,
        1e6 * float(np.median(seconds)) / tracks,
    )


def find_recipe(name: str) -> tuple[str, str]:
    """Return the file of a recipe of this study, or the name of another one, and the environment in
    which it is trained; refuse one for no environment.
    """
    path = Path(__file__).parent / "recipes" / f"{name}.yml"
    file = str(path) if path.is_file() else name
    for env_id, world in HOMES.items():
        # Such as a recipe without an entry for this environment.
        with suppress(ArgumentError):
            if world_task(world).switches in find_algorithm(load_recipe(file, env_id).algo).tasks:
                return file, env_id
    raise ArgumentError(f"recipes={name}: expected recipes for one of {', '.join(HOMES)}")


def play_agent(
    file: str, env_id: str, number: int, steps: int | None, episodes: Mapping[str, int], out: Path
) -> tuple[Path, dict[str, Any]]:
    """Train an agent of a recipe in a run folder below `out`, or go on with it, and play it in the
    worlds of its environment; return the folder and the entry. The entry stays in the folder, and
    is read from there the next time.
    """
    name = load_recipe(file, env_id).name
    folder = out / "agents" / f"{name}-{steps or 'all'}-seed{number}"
    train(file, env_id, out=folder, seed=number, steps=steps, resume=True)
    path = folder / "league.json"
    if not path.is_file():
        worlds = {world: n for world, n in episodes.items() if WORLDS[world][0] == env_id}
        path.write_text(json.dumps(play(str(folder), worlds), indent=2), encoding="utf-8")
    return folder, read_entry(path)


def play_family(
    recipe: str,
    training_seeds: int,
    steps: int | None,
    episodes: Mapping[str, int],
    jobs: int,
    out: Path,
    tracks: int = 1024,
) -> dict[str, Any]:
    """Train a recipe with every seed and play all agents; return the entry of the family: rewards
    of episodes and thresholds are means over the agents. Decisions are timed with a number of
    tracks at a time.
    """
    file, env_id = find_recipe(recipe)
    home = HOMES[env_id]
    agents = joblib.Parallel(n_jobs=jobs)(
        joblib.delayed(play_agent)(file, env_id, number, steps, episodes, out)
        for number in range(training_seeds)
    )
    # One after the other, for the sake of times.
    costs = []
    for folder, entry in agents:
        card = json.loads((folder / "policy.json").read_text(encoding="utf-8"))
        threshold = entry["worlds"][home]["threshold"]
        costs.append((*probe(str(folder), home, threshold, tracks), card["seconds"]))
    means = [float(mean) if np.isfinite(mean) else None for mean in np.mean(costs, 0)]
    entries = [entry for _, entry in agents]
    worlds = {}
    for world in entries[0]["worlds"]:
        scores = [of_agent for entry in entries if (of_agent := scores_of(entry, world))]
        rewards = np.array([of_agent.of("reward", 0) for of_agent in scores])
        worlds[world] = {
            "threshold": float(np.mean([of_agent.thresholds for of_agent in scores])),
            "rewards": pack(rewards.mean(0)),
            "seeds": rewards.mean(1).tolist(),
        }
    title = load_recipe(file, env_id).name
    cost = dict(zip(("calibration", "microseconds", "seconds"), means, strict=True))
    return make_entry(title, title, entries[0]["kind"], worlds, cost)


def interquartile_mean(rewards: NDArray[np.float64], resamples: int = 2000) -> Estimate:
    """Return the interquartile mean of the rewards (S, W) of S training seeds in W worlds.

    The interval is that of a bootstrap that resamples the seeds of each world by themselves.
    """
    shape = resamples, *rewards.shape
    index = np.random.default_rng(0).integers(len(rewards), size=shape)
    resampled = np.take_along_axis(rewards[None], index, axis=1).reshape(resamples, -1)
    bounds = np.quantile(stats.trim_mean(resampled, 0.25, axis=1), (0.025, 0.975))
    return Estimate(float(stats.trim_mean(rewards, 0.25, axis=None)), *bounds.tolist())


def families_tables(entries: Sequence[Mapping[str, Any]]) -> dict[str, pd.DataFrame]:
    """Return a table for each environment in which families have been trained, by its id.

    all: interquartile mean of the reward over seeds and worlds. stated less right: mean stated
    probability of declarations less their accuracy.
    """
    tables = {}
    for env_id, home in HOMES.items():
        rows = []
        for entry in entries:
            worlds = entry["worlds"]
            if "seeds" not in worlds.get(home, {}):
                continue
            seeds = {world: worlds[world]["seeds"] for world in WORLDS if world in worlds}
            row = {"family": entry["title"]}
            for heading, part in ({"all": [*seeds.values()]} | seeds).items():
                mean = interquartile_mean(np.atleast_2d(part).T)
                row[heading] = f"{mean.value:.3f} ({mean.low:.3f}, {mean.high:.3f})"
            calibration, microseconds, seconds = entry["cost"].values()
            known = calibration is not None
            row["stated less right, %"] = f"{100.0 * calibration:+.1f}" if known else "-"
            row["decision, µs"] = f"{microseconds:.1f}"
            row["training, min"] = f"{seconds / 60.0:.1f}"
            rows.append(row)
        if rows:
            tables[env_id] = pd.DataFrame(rows).sort_values("all", ascending=False)
    return tables
