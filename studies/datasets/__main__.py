"""Command line of the study: `python -m studies.datasets`."""

import os
import re
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
import numpy as np
import tyro
from minari.data_collector import EpisodeBuffer

from agents import load, run_command
from baselines import rollout

# Seed of the first episode; no evaluation uses it or those that follow.
SEED = 5_000_000_000


def record(env_id: str, decider: Any, episodes: int) -> list[EpisodeBuffer]:
    """Return episodes of a decider, or of a function of the observations."""
    make: Any = gym.make_vec
    vectorized = {"vectorization_mode": "vector_entry_point", "tick_info": True}
    env = make(f"hybrid_env:{env_id}", episodes, **vectorized)
    ticks = []
    lengths = np.zeros(episodes, np.int64)
    for now in rollout(env, decider, SEED):
        ticks.append((now.observation, now.info["true_mode"], now.actions, now.rewards))
        lengths[now.terminated & (lengths == 0)] = now.step
        if lengths.all():
            break
    rows, modes, actions, rewards = map(np.array, zip(*ticks, strict=True))
    return [
        EpisodeBuffer(
            seed=SEED + track,
            observations=rows[: count + 1, track],
            # A tick has the action that led to it.
            actions=actions[1 : count + 1, track],
            rewards=rewards[1 : count + 1, track],
            terminations=np.arange(1, count + 1) == count,
            truncations=np.zeros(count, np.bool_),
            infos={"true_mode": modes[: count + 1, track]},
        )
        for track, count in enumerate(lengths.tolist())
    ]


def random_actions(env_id: str) -> Callable[[Any], Any]:
    """Return a function of the observations whose actions have the same probability."""
    generator = np.random.default_rng(0)
    space: Any = gym.make(f"hybrid_env:{env_id}").action_space
    return lambda rows: generator.integers(space.n, size=len(rows))


@dataclass(kw_only=True)
class Datasets:
    """Write episodes of deciders, one data set of Minari for each."""

    deciders: tyro.conf.Positional[tuple[str, ...]]
    """Deciders of the environment, with optional thresholds, or 'random'."""
    env: str = "HybridTrack-v0"
    """Registered id of the environment."""
    episodes: int = 200
    """Number of episodes of each, the same for all."""
    quick: bool = False
    """Only five episodes."""
    out: Path | None = None
    """Folder of the data sets; by default where Minari keeps its own."""

    def run(self) -> None:
        """Write the data sets and print a line for each."""
        if self.out is not None:
            os.environ["MINARI_DATASETS_PATH"] = str(self.out.resolve())
        count = 5 if self.quick else self.episodes
        for name in self.deciders:
            decider = random_actions(self.env) if name == "random" else load(name, self.env)
            identity = f"{self.env}/{re.sub(r'[^a-zA-Z0-9]+', '_', name)}-v0"
            episodes = record(self.env, decider, count)
            with warnings.catch_warnings():
                # Without an e-mail address and a link.
                warnings.simplefilter("ignore", UserWarning)
                data = minari.create_dataset_from_buffers(
                    identity,
                    episodes,
                    env=gym.make(f"hybrid_env:{self.env}"),
                    algorithm_name=name,
                    author="The HybridTrack authors",
                    description=f"{count} episodes of {name} in {self.env}",
                    requirements=[f"hybrid-track=={version('hybrid-track')}"],
                )
            mean = np.mean([np.sum(episode.rewards) for episode in episodes])
            size = f"{count} episodes, {data.total_steps:,} steps"
            print(f"{identity}: {size}, mean return {mean:.3f}")


if __name__ == "__main__":
    sys.exit(run_command(Datasets, "python -m studies.datasets"))
