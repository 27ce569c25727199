"""The command `hybridtrack dataset`: episodes of deciders for offline learning."""

import contextlib
import os
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from agents.evaluation.registry import find_decider, for_actions
from agents.evaluation.task import Task
from agents.evaluation.tasks import task_of
from agents.interface.help_texts import shown_default
from agents.interface.output_files import atomic_folder, check_space
from agents.interface.world_arguments import TrustArguments, WorldArguments
from baselines.rules import seeds
from baselines.rules.rollout import rollout
from hybrid_env.checks import check_integer, reject
from hybrid_env.registration import make_track_vector_env

# By this variable Minari finds its data sets.
ROOT = "MINARI_DATASETS_PATH"
# They are in memory until they are written, some 50 kB each.
MOST_EPISODES = 10_000
# HDF5 stores seeds of 64 bits.
LARGEST_SEED = 2**63 - 1 - MOST_EPISODES
# In HDF5, beside the arrays.
BYTES_OF_AN_EPISODE, BYTES_OF_A_DATA_SET = 24_576, 262_144
RANDOM = "random"


def random_policy(actions: int) -> Callable[[Any], NDArray[np.int64]]:
    """Return a decider that chooses each of a number of actions with the same probability."""
    generator = np.random.default_rng(0)
    return lambda rows: generator.integers(actions, size=len(rows))


@dataclass(kw_only=True)
class Dataset(WorldArguments, TrustArguments):
    """Write episodes of deciders, one data set of Minari for each."""

    policies: tuple[str, ...] = ()
    """Rules, 'shipped', run folders, policies of other libraries or rules of your own, with
    optional thresholds, or 'random'. Announced switches: {announced}. Unknown switches: {unknown}.
    """
    episodes: int = 200
    """Number of episodes of each, the same for all."""
    seed: int = seeds.DATASET
    """Seed of the first episode; later episodes use consecutive seeds."""
    out: Annotated[Path | None, shown_default("where Minari keeps its data sets")] = None
    """Folder of the data sets, which Minari finds there by the variable MINARI_DATASETS_PATH."""

    def run(self) -> None:
        """Write the data sets and print one line for each."""
        from minari.storage.datasets_root_dir import get_dataset_path

        check_integer("episodes", self.episodes, maximum=MOST_EPISODES)
        check_integer("seed", self.seed, minimum=0, maximum=LARGEST_SEED)
        task = task_of(*self.world_of(""))
        folder = self.out or get_dataset_path()
        names = {
            f"{task.title}/{re.sub(r'[^a-zA-Z0-9]+', '_', name)}-v0": name for name in self.policies
        }
        if not names or len(names) < len(self.policies):
            raise reject(
                "policies",
                self.policies,
                "one or more names that differ in letters or numbers",
            )
        found: list[tuple[str, str, dict[str, Any], Any]] = []
        for identity, name in names.items():
            if (folder / identity).exists():
                raise reject("out", str(folder), f"a folder without the data set {identity}")
            if name == RANDOM:
                found.append((identity, name, {}, random_policy(task.options.action_count)))
            else:
                family, threshold = find_decider(name, task.options)
                options = task.options_with(family.options)
                title = f"{family.name} at {threshold:g}"
                found.append(
                    (identity, title, family.options, for_actions(family.make(threshold), options))
                )
        # Minari writes to no relative path.
        with atomic_folder("out", folder) as part, _minari_root(part.resolve()):
            for identity, title, changes, decider in found:
                print(
                    self._write(
                        part,
                        task,
                        identity,
                        title,
                        {**task.given, **changes},
                        decider,
                    )
                )
        print(f"Data {folder}")

    def _write(
        self,
        part: Path,
        task: Task,
        identity: str,
        title: str,
        options: dict[str, Any],
        decider: Any,
    ) -> str:
        """Write one data set into a folder; return its line."""
        import minari
        from minari.data_collector import EpisodeBuffer

        episodes = record(task.env_id, options, decider, self.episodes, self.seed)
        returns = np.array([episode["rewards"].sum() for episode in episodes])
        # h5py ends the process where there is none.
        check_space(part, stored_bytes(episodes))
        about = f"{self.episodes} episodes of {title} in {task.title}"
        with warnings.catch_warnings():
            # Without an e-mail address and a link.
            warnings.simplefilter("ignore", UserWarning)
            written = minari.create_dataset_from_buffers(
                identity,
                [EpisodeBuffer(**episode) for episode in episodes],
                env=gym.make(task.env_id, **options),
                algorithm_name=title,
                author="The HybridTrack authors",
                description=about,
                requirements=[f"hybrid-track=={version('hybrid-track')}"],
            )
        size = f"{self.episodes} episodes, {written.total_steps:,} steps"
        return f"{identity}: {size}, mean return {returns.mean():.3f}"


@contextlib.contextmanager
def _minari_root(folder: Path) -> Iterator[None]:
    """Let Minari write to a folder while the block runs."""
    before = os.environ.get(ROOT)
    os.environ[ROOT] = str(folder)
    try:
        yield
    finally:
        os.environ.pop(ROOT, None)
        if before is not None:
            os.environ[ROOT] = before


def stored_bytes(episodes: Sequence[Mapping[str, Any]]) -> int:
    """Return an upper bound of the bytes in which Minari stores episodes, see `record`."""
    arrays = sum(
        value.nbytes
        for episode in episodes
        for value in episode.values()
        if isinstance(value, np.ndarray)
    )
    modes = sum(episode["infos"]["true_mode"].nbytes for episode in episodes)
    return int(arrays + modes) + BYTES_OF_AN_EPISODE * len(episodes) + BYTES_OF_A_DATA_SET


def record(
    env_id: str,
    options: dict[str, Any],
    decider: Any,
    episodes: int,
    seed: int,
) -> list[dict[str, Any]]:
    """Return E episodes of a decider, each as the fields of Minari's `EpisodeBuffer`.

    Observations have the shape (T + 1, width), the true mode in `infos` (T + 1,), all else (T,).
    """
    env = make_track_vector_env(env_id, episodes, tick_info=False, **options)
    unfinished = np.ones(episodes, np.bool_)
    steps = np.zeros(episodes, np.int64)
    ticks: list[tuple[NDArray[Any], ...]] = []
    for now in rollout(env, decider, seed, unfinished):
        ticks.append(
            (now.observation, env.world.field("true_mode").copy(), now.actions, now.rewards)
        )
        unfinished &= ~now.terminated
        if not unfinished.any():
            break
        steps += unfinished
    rows, modes, actions, rewards = map(np.array, zip(*ticks, strict=True))
    return [
        {
            "seed": seed + i,
            "observations": rows[: count + 1, i],
            "actions": actions[1 : count + 1, i],
            "rewards": rewards[1 : count + 1, i],
            "terminations": np.arange(1, count + 1) == count,
            "truncations": np.zeros(count, np.bool_),
            "infos": {"true_mode": modes[: count + 1, i]},
        }
        for i, count in enumerate(steps.tolist())
    ]
