"""Training with PPO of Stable-Baselines3 or RecurrentPPO of sb3-contrib, as a resumable run."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat
from torch import nn
from torch.optim import Optimizer

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily, load_sequence_net, policy_decider, policy_family
from agents.learned.features import policy_kwargs_with_features
from agents.learned.policy import PolicyDecider, load_actor, save_actor, sequence_net_of
from agents.learned.policy_file import load_policy
from agents.learned.sequence import SequenceNet
from agents.training import run_folder
from agents.training.recipe import PPOSettings, learning_rate_schedule
from agents.training.run import Run, TrainingProgress
from agents.training.stopping_vec_env import StoppingVecEnv
from agents.training.vec_env import HybridTrackVecEnv
from hybrid_env.checks import ArgumentError, reject


class _MetricsWriter(KVWriter):
    """Logger output that appends to the metrics file of the run folder."""

    def __init__(self, folder: Path):
        self.folder = folder

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        plain = {key: value for key, value in key_values.items() if isinstance(value, (int, float, str))}
        plain |= {key: value.item() for key, value in key_values.items() if isinstance(value, np.generic)}
        run_folder.append_metrics(self.folder, step, plain)

    def close(self) -> None:
        pass


class _RunCallback(BaseCallback):
    """Reports progress after each rollout; evaluates and saves the agent after each update."""

    def __init__(
        self, run: "PPORun", on_progress: Callable[[TrainingProgress], None] | None, save_every: float
    ):
        super().__init__()
        self.run, self.on_progress, self.save_every = run, on_progress, save_every
        self.started = time.monotonic() - run.seconds
        self.last_save = time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # the update for all steps so far is complete here
        run = self.run
        run.seconds = time.monotonic() - self.started
        if run.folder is not None:
            if run.num_timesteps and run.curve.due(run.seconds):
                run.evaluate()
            if time.monotonic() - self.last_save > self.save_every:
                run.save()
                self.last_save = time.monotonic()
        self.started = time.monotonic() - run.seconds  # excludes the time for evaluating and saving

    def _on_rollout_end(self) -> None:
        reward = ticks = math.nan
        episodes = self.model.ep_info_buffer
        if episodes:
            reward = float(np.mean([episode["r"] for episode in episodes])) / self.run.segments
            ticks = float(np.mean([episode["l"] for episode in episodes])) / self.run.segments
            self.logger.record("segment/reward", reward)
            self.logger.record("segment/ticks", ticks)
        if self.on_progress is not None:
            self.on_progress(TrainingProgress(self.model.num_timesteps, self.run.steps, reward, ticks))


def _model_class(algo: str) -> Any:
    if algo == "ppo":
        return PPO
    try:
        from sb3_contrib import RecurrentPPO
    except ImportError:
        raise reject("recipe", algo, 'sb3-contrib: pip install "hybrid-track[recurrent]"') from None
    return RecurrentPPO


class PPORun(Run):
    """A PPO or RecurrentPPO run; see `agents.training.runs.make_run` for the arguments.

    `steps` is rounded up to a multiple of the rollout size.

    Raises:
        ArgumentError: an invalid environment or recipe, or a damaged checkpoint.
    """

    def build(self) -> None:
        """Create model and environments."""
        settings = self.recipe.settings
        assert isinstance(settings, PPOSettings)
        self.settings = settings
        kind = _model_class(self.recipe.algo)
        env, sequence_net = self._make_env()
        self.segments = env.env.options.segments
        rate, decays = learning_rate_schedule(settings.learning_rate)
        try:
            self.model = kind(
                settings.policy, env,
                learning_rate=lambda remaining: rate * max(remaining, 0.0) if decays else rate,
                n_steps=settings.n_steps, batch_size=settings.batch_size, n_epochs=settings.n_epochs,
                gamma=settings.gamma, gae_lambda=settings.gae_lambda, ent_coef=settings.ent_coef,
                seed=self.seed, device="cpu",
                policy_kwargs=policy_kwargs_with_features(settings.policy_kwargs, settings.observe),
            )  # fmt: skip
        except ArgumentError:
            raise
        except (TypeError, KeyError, ValueError, AttributeError, AssertionError) as error:
            keywords = dict(settings.policy_kwargs)
            raise reject(
                "policy_kwargs", keywords, f"keyword arguments of {settings.policy} ({error})"
            ) from None
        with torch.no_grad():
            self.model.policy.action_net.get_parameter("bias")[0] = settings.wait_bias
        if sequence_net is not None:
            # saved with the policy under this name; not trained, because the optimizer already exists
            self.model.policy.beliefs = sequence_net

    def _make_env(self) -> tuple[HybridTrackVecEnv, SequenceNet | None]:
        settings = self.settings
        if settings.sequence_agent is None:
            return HybridTrackVecEnv(self.env_id, settings.n_envs, **self.options), None
        if self.resume:  # the run folder contains the network
            assert self.folder is not None
            net = sequence_net_of(load_actor(self.folder, *load_policy(self.folder)))
            assert net is not None
        else:
            net = load_sequence_net(settings.sequence_agent)
        return StoppingVecEnv(net, self.env_id, settings.n_envs, **self.options), net

    def start_at(self, num_timesteps: int) -> None:
        """Set the number of environment steps already made."""
        self.model.num_timesteps = num_timesteps

    @property
    def network(self) -> nn.Module:
        """The policy, with actor and critic."""
        policy: nn.Module = self.model.policy
        return policy

    @property
    def optimizer(self) -> Optimizer:
        """Its optimizer."""
        optimizer: Optimizer = self.model.policy.optimizer
        return optimizer

    @property
    def num_timesteps(self) -> int:
        """Environment steps so far."""
        return int(self.model.num_timesteps)

    def track_seeds(self) -> list[int]:
        """Return the seeds of the tracks from the current step on, disjoint from those of evaluations."""
        first = seeds.TRAINING + 10**9 * self.seed + self.num_timesteps
        return [first + track for track in range(self.settings.n_envs)]

    @property
    def decider(self) -> PolicyDecider:
        """The current policy as a decider."""
        return policy_decider(self.model.policy, self.model.env.env.options)

    def family(self, name: str) -> DeciderFamily:
        """Return the current policy as a family of deciders."""
        return policy_family(name, self.decider)

    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train for the remaining steps; see `Run.train`."""
        writers: list[KVWriter] = []
        if self.folder is not None:
            writers = [_MetricsWriter(self.folder), TensorBoardOutputFormat(str(self.folder))]
        self.model.set_logger(Logger(None if self.folder is None else str(self.folder), writers))
        # PyTorch's random generator is global, so it is seeded again here. A resumed run uses new seeds that
        # depend only on the seed and the step.
        self.model.set_random_seed((self.seed + self.num_timesteps) % 2**32)
        self.model.env.seed(self.track_seeds()[0])
        self.save_if_new()
        remaining = self.steps - self.num_timesteps
        try:
            if remaining > 0:
                callback = _RunCallback(self, on_progress, save_every)
                self.model.learn(remaining, callback, reset_num_timesteps=False)
                self.seconds = time.monotonic() - callback.started
        finally:
            self.model.logger.close()
        if self.folder is not None and remaining > 0:
            self.evaluate()
            self.save()

    def evaluate(self) -> None:
        """Add a point of the learning curve, if the actions are declarations of hypotheses."""
        if self.model.env.env.options.actions == "all":
            super().evaluate()

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the current agent."""
        save_actor(folder, self.model.policy, card)
