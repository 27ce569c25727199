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

from agents import run_folder, seeds
from agents.deciders import DeciderFamily, policy_family
from agents.features import RowFeatures
from agents.learning_curve import LearningCurve
from agents.policy import PolicyDecider, save_actor
from agents.recipe import PPOSettings, Recipe, schedule
from agents.training import TrainingProgress
from agents.vec_env import HybridTrackVecEnv
from agents.writing import output_folder, write_json
from hybrid_env.checks import reject


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


class PPORun:
    """One PPO or RecurrentPPO run; see `agents.training.make_run` for the arguments.

    `steps` is rounded up to whole rollouts.

    Raises:
        ArgumentError: a bad world or recipe, or a folder with a damaged checkpoint.
    """

    def __init__(
        self,
        env_id: str,
        options: dict[str, Any],
        recipe: Recipe,
        seed: int,
        folder: Path | None,
        steps: int,
        resume: bool = False,
    ):
        settings = recipe.settings
        assert isinstance(settings, PPOSettings)
        self.env_id, self.options, self.recipe, self.settings = env_id, options, recipe, settings
        self.seed, self.folder, self.steps = seed, folder, steps
        self.seconds = 0.0
        torch.set_num_threads(1)  # small networks lose more to threads than they gain
        env = HybridTrackVecEnv(env_id, settings.n_envs, **options)
        self.segments = env.env.options.segments
        rate, falls = schedule(settings.learning_rate)
        extractor = {}
        if settings.observe:
            extractor = {
                "features_extractor_class": RowFeatures,
                "features_extractor_kwargs": {"observe": settings.observe},
            }
        try:
            self.model = _model_class(recipe.algo)(
                settings.policy, env, learning_rate=lambda left: rate * max(left, 0.0) if falls else rate,
                n_steps=settings.n_steps, batch_size=settings.batch_size, n_epochs=settings.n_epochs,
                gamma=settings.gamma, gae_lambda=settings.gae_lambda, ent_coef=settings.ent_coef,
                seed=seed, device="cpu", policy_kwargs=dict(settings.policy_kwargs) | extractor,
            )  # fmt: skip
        except (TypeError, KeyError) as error:
            raise reject(
                "policy_kwargs", dict(settings.policy_kwargs), f"keywords of the policy ({error})"
            ) from None
        except ValueError as error:
            raise reject("recipe", recipe.name, str(error)) from None
        with torch.no_grad():
            self.model.policy.action_net.get_parameter("bias")[0] = settings.wait_bias
        self.curve = LearningCurve(env_id, options)
        if folder is not None:
            if resume:
                policy = self.model.policy
                numbers = run_folder.load_checkpoint(folder, policy, policy.optimizer)
                self.model.num_timesteps, self.seconds = int(numbers["steps"]), numbers["seconds"]
                run_folder.drop_metrics_beyond(folder, self.done)
            output_folder("out", folder)
            config = {
                "env": env_id, "options": options, "recipe": recipe.as_json(), "steps": steps, "seed": seed,
            }  # fmt: skip
            write_json(folder / run_folder.CONFIG, config)

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
        return PolicyDecider(self.model.policy)

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
        if self.folder is not None and not (self.folder / run_folder.CHECKPOINT).exists():
            self.save()  # a run killed before its first interval can go on, too
        left = self.steps - self.done
        try:
            if left > 0:
                watch = _Watch(self, on_progress, save_every)
                self.model.learn(left, watch, reset_num_timesteps=False)
                self.seconds = time.monotonic() - watch.begun
        finally:
            self.model.logger.close()
        if self.folder is not None:
            self.measure()
            self.save()

    def measure(self) -> None:
        """A point of the learning curve, into the metrics."""
        if self.options.get("actions", "all") != "all":
            return  # its episodes cannot be run by a decider
        assert self.folder is not None
        point = self.curve.measure(self.family(""), self.seconds)
        run_folder.append_metrics(self.folder, self.done, point)

    def save(self) -> None:
        """Write checkpoint and policy."""
        assert self.folder is not None
        policy = self.model.policy
        numbers = {"steps": self.done, "seconds": self.seconds}
        run_folder.save_checkpoint(self.folder, policy.state_dict(), policy.optimizer, numbers)
        card = {
            "environment": self.env_id, "options": self.options, "recipe": self.recipe.as_json(),
            "seed": self.seed, "steps": self.done, "seconds": round(self.seconds, 1),
            "versions": run_folder.versions(),
        }  # fmt: skip
        save_actor(self.folder, policy, card | {"algo": self.recipe.algo})
