"""Command line of the study: `python -m studies.datasets`."""

import os
import re
import sys
import warnings
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

# Seed of the first episode; no evaluation uses it or those that follow.
SEED = 5_000_000_000


def record(env_id: str, decider: Any, episodes: int) -> list[EpisodeBuffer]:
    """Return episodes of a decider; without one, each action has the same probability."""
    env: Any = gym.make_vec(
        f"hybrid_env:{env_id}",
        episodes,
        vectorization_mode="vector_entry_point",
        tick_info=True,
    )
    generator = np.random.default_rng(0)
    observation, info = env.reset(seed=SEED)
    ticks = [(observation, info["true_mode"])]
    steps = []
    state = None
    starts = np.ones(episodes, np.bool_)
    lengths = np.zeros(episodes, np.int64)
    while not lengths.all():
        if decider is None:
            actions = generator.integers(env.single_action_space.n, size=episodes)
        else:
            seen = observation if decider.observes == "rows" else decider.observe(env.world)
            actions, state = decider.predict(seen, state, starts)
        observation, rewards, starts, _, info = env.step(actions)
        ticks.append((observation, info["true_mode"]))
        steps.append((actions, rewards))
        lengths[starts & (lengths == 0)] = len(steps)
    rows, modes = map(np.array, zip(*ticks, strict=True))
    taken, earned = map(np.array, zip(*steps, strict=True))
    return [
        EpisodeBuffer(
            seed=SEED + track,
            observations=rows[: count + 1, track],
            actions=taken[:count, track],
            rewards=earned[:count, track],
            terminations=np.arange(1, count + 1) == count,
            truncations=np.zeros(count, np.bool_),
            infos={"true_mode": modes[: count + 1, track]},
        )
        for track, count in enumerate(lengths.tolist())
    ]


@dataclass(kw_only=True)
class Datasets:
    """Write episodes of deciders, one data set of Minari for each."""

    policies: tyro.conf.Positional[tuple[str, ...]]
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
        deciders = {
            name: None if name == "random" else load(name, self.env) for name in self.policies
        }
        count = 5 if self.quick else self.episodes
        for name, decider in deciders.items():
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
