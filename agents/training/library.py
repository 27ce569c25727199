"""Training with algorithms of Stable-Baselines3 and sb3-contrib as resumable runs: PPO, A2C, DQN
and their kin.

The agent declares the mode of a segment, or states one at every tick where nobody announces the
switches.
"""

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import stable_baselines3
import torch
from annotated_types import Len
from gymnasium import spaces
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from torch import Tensor, nn
from torch.utils.tensorboard import SummaryWriter

from agents.evaluation.task import task_of
from agents.learned.policy import Actor, ObservationFeatures, actor_decider, read_actor
from agents.learned.policy_file import LAYOUTS, SavedPolicy, short_message, unreadable_policy
from agents.training import checkpoint, run_folder
from agents.training.algorithm import Algorithm, OnRound, TrainingProgress
from agents.training.library_settings import Layer, LibrarySettings
from agents.training.settings import learning_rate_schedule
from agents.training.vec_env import HybridTrackVecEnv
from baselines.rules import seeds
from baselines.rules.decider import Decider
from hybrid_env.checks import ArgumentError, check_integer, checked, reject
from hybrid_env.extras import explained
from hybrid_env.observation import Layout


def plain_values(logged: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers and texts among logged values, as plain values."""
    plain = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in logged.items()
    }
    return {name: value for name, value in plain.items() if isinstance(value, (int, float, str))}


def _without_tensorboard(hook: Callable[[Any], Any]) -> Callable[[Any], None]:
    """Return a hook of errors in threads that leaves out those of TensorBoard's thread: the next
    call of its writer raises them again.
    """

    def show(error: Any) -> None:
        if not type(error.thread).__module__.startswith("tensorboard."):
            hook(error)

    return show


threading.excepthook = _without_tensorboard(threading.excepthook)


class RunWriter(TensorBoardOutputFormat):
    """Logger output that appends to the metrics file of the run folder, and writes TensorBoard
    events; those that a killed run wrote after its last checkpoint are hidden.
    """

    def __init__(self, folder: Path, steps: int):
        self.folder = folder
        with run_folder.writing(folder):
            self.writer = SummaryWriter(str(folder), purge_step=steps + 1)
        self._is_closed = False

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Write the values of an update."""
        values = plain_values(key_values)
        # Counted from the last start.
        values.pop("time/iterations", None)
        run_folder.append_metrics(self.folder, step, values)
        with run_folder.writing(self.folder):
            super().write(key_values, key_excluded, step)

    def close(self) -> None:
        """Close the file."""
        # Every `write` flushes, so nothing is lost here.
        with suppress(OSError):
            super().close()


class _RunCallback(BaseCallback):
    """Reports progress after each rollout; evaluates and saves the agent after each update."""

    def __init__(self, run: "LibraryAlgorithm", on_progress: OnRound):
        super().__init__()
        self.run, self.on_progress = run, on_progress

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self.run.num_timesteps = self.model.num_timesteps
        # The update for all steps so far is complete.
        self.run.between_updates()

    def _on_rollout_end(self) -> None:
        reward, ticks = self.run.recent_means()
        if self.on_progress is not None:
            self.on_progress(
                TrainingProgress(self.model.num_timesteps, self.run.steps, reward, ticks)
            )


class LibraryAlgorithm(Algorithm):
    """Base class of the algorithms of Stable-Baselines3 and sb3-contrib, named as theirs.

    `steps` is rounded up to a multiple of the rollout size. Recipes whose initial policy waits are
    refused where a mode is stated at every tick.
    """

    Settings: ClassVar[type[LibrarySettings]]
    tasks = tuple(LAYOUTS)
    settings: LibrarySettings
    policy: ClassVar[str] = "MlpPolicy"
    """Class of the policy."""
    policy_types: ClassVar[Mapping[str, Any]] = {
        "net_arch": Annotated[tuple[Layer, ...], Len(1, 8)],
        "ortho_init": bool,
    }
    """Declared types of the keyword arguments of the policy."""

    @classmethod
    def settings_of(cls, entry: Mapping[str, Any]) -> LibrarySettings:
        """See `Algorithm.settings_of`; those of the policy too."""
        settings: LibrarySettings = super().settings_of(entry)
        if settings.policy != cls.policy:
            raise reject("policy", settings.policy, repr(cls.policy))
        cls.check_policy(settings.policy_kwargs)
        return settings

    @classmethod
    def check_policy(cls, given: Any) -> None:
        """Check names and types of the keyword arguments of the policy, and the size of its
        network.
        """
        known = cls.policy_types
        if not isinstance(given, Mapping) or not given.keys() <= known.keys():
            raise reject("policy_kwargs", given, f"a mapping of {', '.join(known)}")
        for name, value in given.items():
            checked(name, value, known[name])

    @classmethod
    def library_class(cls) -> Any:
        """Return the class of the algorithm; what Stable-Baselines3 lacks is in sb3-contrib."""
        library: Any = stable_baselines3
        if not hasattr(library, cls.__name__):
            with explained():
                import sb3_contrib as library
        return getattr(library, cls.__name__)

    @classmethod
    def load(cls, saved: SavedPolicy, options: Any) -> Decider:
        """Return the agent of weights and card, for the options of an environment."""
        try:
            types = saved.card.get("types")
            if types not in (None, [*options.type_names]):
                raise ValueError(f"its modes are of the types {', '.join(types)}")
            width = check_integer(
                "observation_width", saved.card["observation_width"], maximum=2000
            )
            cls.check_policy(saved.entry["policy_kwargs"])
            actor = cls.actor(saved.weights, saved.entry, width, LAYOUTS[saved.task])
            return actor_decider(actor, options)
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise unreadable_policy(saved.folder, error) from None

    @staticmethod
    def actor(
        weights: Mapping[str, Tensor], entry: Mapping[str, Any], width: int, layout: type[Layout]
    ) -> Actor:
        """Return the actor of weights and of the hyper-parameters of a recipe or card."""
        features = None
        if observe := tuple(entry.get("observe", ())):
            space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
            features = ObservationFeatures(space, observe, layout)
        quantiles = entry["policy_kwargs"].get("n_quantiles", 200)
        return read_actor(weights, features, width, quantiles=quantiles)

    def build(self) -> None:
        """Create model and environments; the initial policy waits if it can."""
        settings = self.settings
        kind = self.library_class()
        scale = getattr(settings, "reward_scale", 1.0)
        env = HybridTrackVecEnv(self.env_id, settings.n_envs, scale, **self.options)
        self.world = env.env.options
        self.switches = self.world.switches
        self.task = task_of(self.env_id, self.options)
        rate, decays = learning_rate_schedule(settings.learning_rate)
        keywords = dict(settings.policy_kwargs)
        if settings.observe:
            observed = {"observe": settings.observe, "layout": type(env.env.world.layout)}
            keywords["features_extractor_class"] = ObservationFeatures
            keywords["features_extractor_kwargs"] = observed
        self.model = kind(
            settings.policy,
            env,
            learning_rate=lambda remaining: rate * max(remaining, 0.0) if decays else rate,
            seed=self.seed,
            device="cpu",
            **settings.keywords,
            policy_kwargs=keywords,
        )
        if self.task.waits:
            self._prefer_waiting(settings.wait_bias)
        elif settings.wait_bias:
            allowed = "0 for an agent that states a mode at every tick, which cannot wait"
            raise reject("wait_bias", settings.wait_bias, allowed)
        # As at the start of `learn` of Stable-Baselines3, so that a checkpoint can be restored. The
        # seed is that of the first track.
        env.seed(seeds.TRAINING + 10**9 * self.seed)
        self.model._last_obs = env.reset()
        self.model._last_episode_starts = np.ones(settings.n_envs, np.bool_)
        self.model.ep_info_buffer = deque(maxlen=self.model._stats_window_size)
        self.model.ep_success_buffer = deque(maxlen=self.model._stats_window_size)
        self.network, self.optimizer = self.model.policy, self.model.policy.optimizer
        # Values of a checkpoint, until `learn` uses them.
        self._restored: dict[str, Any] | None = None

    @torch.no_grad()
    def _prefer_waiting(self, bias: float) -> None:
        policy = self.model.policy
        values = getattr(policy, "q_net", None) or getattr(policy, "quantile_net", None)
        *_, last = (
            layer
            for layer in (values or policy.action_net).modules()
            if isinstance(layer, nn.Linear)
        )
        # One row for each quantile.
        last.bias.view(-1, self.model.action_space.n)[:, 0] = bias
        if values is not None:
            target = getattr(policy, "q_net_target", None) or policy.quantile_net_target
            target.load_state_dict(values.state_dict())

    @property
    def buffer(self) -> ReplayBuffer | None:
        """The replay buffer; None for an algorithm without one."""
        return getattr(self.model, "replay_buffer", None)

    def agent(self, title: str) -> Decider:
        layout = self.model.env.env.world.layout
        actor = self.actor(
            self.network.state_dict(), vars(self.settings), layout.width, type(layout)
        )
        return actor_decider(actor, self.world).changed(title=title)

    def recent_means(self) -> tuple[float, float]:
        """Log the means of recent episodes, and return those of `TrainingProgress`."""
        episodes = self.model.ep_info_buffer
        if not episodes:
            return math.nan, math.nan
        reward, ticks = (
            float(np.mean([episode[key] for episode in episodes])) / self.task.length
            for key in ("r", "l")
        )
        self.model.logger.record(f"{self.task.unit}/reward", reward)
        if not self.task.waits:
            return reward, math.nan
        self.model.logger.record(f"{self.task.unit}/ticks", ticks)
        return reward, ticks

    def track_tensors(self) -> dict[str, Tensor]:
        model = self.model
        # Not public, but the save() of Stable-Baselines3 pickles, and does not save the tracks.
        arrays = {"observation": model._last_obs, "episode_start": model._last_episode_starts}
        arrays |= model.env.state_arrays()
        if self.buffer is not None:
            names = "observations", "next_observations", "actions", "rewards", "dones", "timeouts"
            arrays |= {f"buffer.{name}": getattr(self.buffer, name) for name in names}
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    @property
    def _counters(self) -> list[str]:
        names = "_n_updates", "_n_calls", "_episode_num", "exploration_rate"
        return [name for name in names if hasattr(self.model, name)]

    def values(self) -> dict[str, Any]:
        model = self.model
        values: dict[str, Any] = {
            "random": checkpoint.random_state(),
            "counters": plain_values({name: getattr(model, name) for name in self._counters}),
            "logged": plain_values(model.logger.name_to_value),
            "episodes": [[episode["r"], episode["l"]] for episode in model.ep_info_buffer],
        }
        if self.buffer is not None:
            values["buffer"] = [self.buffer.pos, self.buffer.full]
            values["actions"] = model.action_space.np_random.bit_generator.state
        return values

    def restore_values(self, values: dict[str, Any]) -> None:
        model = self.model
        world = model.env.env.world
        world.check_blocks(world.blocks, world.seeded)
        self._restored = values
        model.num_timesteps = self.num_timesteps
        for name in self._counters:
            setattr(model, name, values["counters"][name])
        for reward, ticks in values["episodes"]:
            model.ep_info_buffer.append({"r": reward, "l": ticks})
        if self.buffer is not None:
            self.buffer.pos, self.buffer.full = values["buffer"]

    def learn(self, on_progress: OnRound) -> None:
        model = self.model
        writers: list[KVWriter] = []
        if self.folder is not None:
            writers = [RunWriter(self.folder, self.num_timesteps)]
        model.set_logger(Logger(None if self.folder is None else str(self.folder), writers))
        # The generators are global, so they are set here and not when the run is created.
        if self._restored is not None:
            checkpoint.set_random_state(self._restored["random"])
            if self.buffer is not None:
                model.action_space.np_random.bit_generator.state = self._restored["actions"]
            # By the last update before the checkpoint, not written yet.
            for name, value in self._restored["logged"].items():
                # As Stable-Baselines3 does.
                excluded = "tensorboard" if name == "train/n_updates" else None
                model.logger.record(name, value, excluded)
        elif self.num_timesteps == 0:
            model.set_random_seed(self.seed)
        self._restored = None
        callback = _RunCallback(self, on_progress)
        # Rollouts between two lines of metrics; of DQN and QR-DQN episodes.
        interval = 1 if self.buffer is None else 500
        try:
            model.learn(
                self.steps - self.num_timesteps, callback, interval, reset_num_timesteps=False
            )
            self.num_timesteps = model.num_timesteps
        except ArgumentError:
            raise
        except ValueError as error:
            # Probabilities that are not finite.
            raise ArgumentError(f"the training has diverged: {short_message(error)}") from error
        finally:
            model.logger.close()

    def card(self) -> dict[str, Any]:
        """See `Algorithm.card`; with the width of the rows, and the types of the modes."""
        width = self.model.observation_space.shape[0]
        return super().card() | {"observation_width": width, "types": self.world.type_names}
