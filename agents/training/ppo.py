"""Training with Stable-Baselines3's PPO, or sb3-contrib's RecurrentPPO, into a run folder that can go on."""

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
from agents.evaluation.deciders import DeciderFamily, load_net, policy_decider, policy_family
from agents.learned.features import policy_keywords
from agents.learned.policy import PolicyDecider, beliefs_of, load_actor, save_actor
from agents.learned.policy_file import load_policy
from agents.learned.sequence import SequenceNet
from agents.training import run_folder
from agents.training.recipe import PPOSettings, schedule
from agents.training.run import Run, TrainingProgress
from agents.training.stopping_vec_env import StoppingVecEnv
from agents.training.vec_env import HybridTrackVecEnv
from hybrid_env.checks import ArgumentError, reject


class _MetricsFile(KVWriter):
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


class _Watch(BaseCallback):
    """Reports progress, measures and saves, between rollout and update."""

    def __init__(
        self, run: "PPORun", on_progress: Callable[[TrainingProgress], None] | None, interval: float
    ):
        super().__init__()
        self.run, self.on_progress, self.interval = run, on_progress, interval
        self.begun = time.monotonic() - run.seconds
        self.saved = time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # here the update that belongs to the steps so far has been made
        run = self.run
        run.seconds = time.monotonic() - self.begun
        if run.folder is not None:
            if run.done and run.curve.due(run.seconds):
                run.measure()
            if time.monotonic() - self.saved > self.interval:
                run.save()
                self.saved = time.monotonic()
        self.begun = time.monotonic() - run.seconds  # what was measured and saved is not training

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
    """One PPO or RecurrentPPO run; see `agents.runs.make_run` for the arguments.

    `steps` is rounded up to whole rollouts.

    Raises:
        ArgumentError: a bad world or recipe, or a folder with a damaged checkpoint.
    """

    def build(self) -> None:
        """Make model and tracks."""
        settings = self.recipe.settings
        assert isinstance(settings, PPOSettings)
        self.settings = settings
        kind = _model_class(self.recipe.algo)
        env, beliefs = self._tracks()
        self.segments = env.env.options.segments
        rate, falls = schedule(settings.learning_rate)
        try:
            self.model = kind(
                settings.policy, env, learning_rate=lambda left: rate * max(left, 0.0) if falls else rate,
                n_steps=settings.n_steps, batch_size=settings.batch_size, n_epochs=settings.n_epochs,
                gamma=settings.gamma, gae_lambda=settings.gae_lambda, ent_coef=settings.ent_coef,
                seed=self.seed, device="cpu",
                policy_kwargs=policy_keywords(settings.policy_kwargs, settings.observe),
            )  # fmt: skip
        except ArgumentError:
            raise
        except (TypeError, KeyError, ValueError, AttributeError, AssertionError) as error:
            keywords = dict(settings.policy_kwargs)
            raise reject("policy_kwargs", keywords, f"keywords of {settings.policy} ({error})") from None
        with torch.no_grad():
            self.model.policy.action_net.get_parameter("bias")[0] = settings.wait_bias
        if beliefs is not None:
            # saved with the policy; the optimizer, made before, does not train it
            self.model.policy.beliefs = beliefs

    def _tracks(self) -> tuple[HybridTrackVecEnv, SequenceNet | None]:
        settings = self.settings
        if settings.beliefs is None:
            return HybridTrackVecEnv(self.env_id, settings.n_envs, **self.options), None
        if self.resume:  # the folder has the network, wherever it came from
            assert self.folder is not None
            net = beliefs_of(load_actor(self.folder, *load_policy(self.folder)))
            assert net is not None
        else:
            net = load_net(settings.beliefs)
        return StoppingVecEnv(net, self.env_id, settings.n_envs, **self.options), net

    def start(self, done: int) -> None:
        """Go on from as many environment steps."""
        self.model.num_timesteps = done

    @property
    def network(self) -> nn.Module:
        """What is trained."""
        policy: nn.Module = self.model.policy
        return policy

    @property
    def optimizer(self) -> Optimizer:
        """What trains it."""
        optimizer: Optimizer = self.model.policy.optimizer
        return optimizer

    @property
    def done(self) -> int:
        """Environment steps made."""
        return int(self.model.num_timesteps)

    def track_seeds(self) -> list[int]:
        """Seeds of the tracks from here on; evaluations count from small ones."""
        first = seeds.TRAINING + 10**9 * self.seed + self.done
        return [first + track for track in range(self.settings.n_envs)]

    @property
    def decider(self) -> PolicyDecider:
        """The policy as it stands."""
        return policy_decider(self.model.policy, self.model.env.env.options)

    def family(self, name: str) -> DeciderFamily:
        """The policy as it stands, as a decider with a threshold."""
        return policy_family(name, self.decider)

    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train to the end, saving the run every so many seconds."""
        writers: list[KVWriter] = []
        if self.folder is not None:
            writers = [_MetricsFile(self.folder), TensorBoardOutputFormat(str(self.folder))]
        self.model.set_logger(Logger(None if self.folder is None else str(self.folder), writers))
        # torch's stream is global: set it here, not only where the weights were drawn. A resumed run goes on
        # with other streams than those used up, the same at every resumption.
        self.model.set_random_seed((self.seed + self.done) % 2**32)
        self.model.env.seed(self.track_seeds()[0])
        self.save_if_new()
        left = self.steps - self.done
        try:
            if left > 0:
                watch = _Watch(self, on_progress, save_every)
                self.model.learn(left, watch, reset_num_timesteps=False)
                self.seconds = time.monotonic() - watch.begun
        finally:
            self.model.logger.close()
        if self.folder is not None and left > 0:
            self.measure()
            self.save()

    def measure(self) -> None:
        """A point of the learning curve, if its episodes can be run by a decider."""
        if self.model.env.env.options.actions == "all":
            super().measure()

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the agent as it stands."""
        save_actor(folder, self.model.policy, card)
