"""Training with Stable-Baselines3's PPO into a run folder that can be resumed.

A run folder holds config.json, checkpoint.safetensors (weights, optimizer and progress in one file, so that
a killed run never mixes two of them), policy.safetensors with its card, metrics.jsonl and TensorBoard events.
"""

import json
import math
import os
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger, TensorBoardOutputFormat

from agents.policy import PolicyDecider, save_policy
from agents.vec_env import HybridTrackVecEnv
from hybrid_env.checks import check_between, check_integer, check_number, check_positive, reject

CONFIG = "config.json"
CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"


@dataclass(kw_only=True)
class PPOSettings:
    """Hyper-parameters of PPO; gamma is 1, because haste is priced by the delay cost already."""

    steps: int = 1_500_000
    """Environment steps, summed over tracks; about half a minute."""
    num_envs: int = 64
    """Tracks trained on at once."""
    rollout: int = 128
    """Steps of each track between updates."""
    batch: int = 2048
    """Samples of a gradient step."""
    epochs: int = 4
    """Passes over each rollout."""
    learning_rate: float = 6e-3
    """Adam's step size, annealed linearly to 0."""
    gae_lambda: float = 0.9
    """Of generalised advantage estimation."""
    entropy: float = 0.0
    """Coefficient of the entropy bonus."""
    hidden: tuple[int, ...] = (64, 64)
    """Units of the hidden layers of actor and critic."""
    wait_bias: float = 5.0
    """First bias of the logit of waiting; at 0 a fresh policy declares at once and never learns to wait."""

    def check(self) -> None:
        """Refuse nonsense in one line."""
        for name in ("steps", "num_envs", "rollout", "batch", "epochs"):
            check_integer(name.replace("_", "-"), getattr(self, name))
        check_positive("learning-rate", self.learning_rate)
        if self.gae_lambda != 1.0:
            check_between("gae-lambda", self.gae_lambda, 0.0, 1.0)
        check_positive("entropy", self.entropy, allow_zero=True)
        check_number("wait-bias", self.wait_bias)
        if not self.hidden:
            raise reject("hidden", self.hidden, "one or more layers")
        for units in self.hidden:
            check_integer("hidden", units)
        if self.batch > self.num_envs * self.rollout:
            raise reject("batch", self.batch, f"at most num-envs x rollout = {self.num_envs * self.rollout}")


@dataclass(frozen=True)
class Progress:
    """Where a training run stands.

    Attributes:
        steps, total: environment steps, done and wanted.
        seconds: since the start or the resumption.
        reward: mean of a segment in the last 100 episodes; NaN before the first has ended.
        ticks: mean decision time of a segment in the last 100 episodes, likewise.
    """

    steps: int
    total: int
    seconds: float
    reward: float
    ticks: float

    @property
    def note(self) -> str:
        """For a progress display."""
        return "" if math.isnan(self.reward) else f"reward {self.reward:+.3f}, {self.ticks:.1f} ticks"


class _MetricsFile(KVWriter):
    """Appends one JSON object a log call, so that a resumed run goes on where it stopped."""

    def __init__(self, path: Path):
        self.file = path.open("a", encoding="utf-8")

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        plain = {key: value for key, value in key_values.items() if isinstance(value, (int, float, str))}
        plain |= {key: value.item() for key, value in key_values.items() if isinstance(value, np.generic)}
        self.file.write(json.dumps({"step": step} | plain) + "\n")
        self.file.flush()

    def close(self) -> None:
        self.file.close()


class _Watch(BaseCallback):
    """Reports progress and saves, both at the end of a rollout."""

    def __init__(self, run: "TrainingRun", on_progress: Callable[[Progress], None] | None, interval: float):
        super().__init__()
        self.run, self.on_progress, self.interval = run, on_progress, interval
        self.started = self.saved = time.monotonic()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        # here the update that belongs to the steps so far has been made
        if self.run.folder is not None and time.monotonic() - self.saved > self.interval:
            self.run.save()
            self.saved = time.monotonic()

    def _on_rollout_end(self) -> None:
        reward = ticks = math.nan
        episodes = self.model.ep_info_buffer
        if episodes:
            reward = float(np.mean([episode["r"] for episode in episodes])) / self.run.segments
            ticks = float(np.mean([episode["l"] for episode in episodes])) / self.run.segments
            self.logger.record("segment/reward", reward)
            self.logger.record("segment/ticks", ticks)
        if self.on_progress is not None:
            seconds = time.monotonic() - self.started
            self.on_progress(
                Progress(self.model.num_timesteps, self.run.settings.steps, seconds, reward, ticks)
            )


class TrainingRun:
    """One PPO run.

    Args:
        env_id: registered id of the environment.
        options: of the world, over those of the id.
        settings: hyper-parameters.
        seed: of weights, tracks and mini-batches.
        folder: run folder; None keeps nothing.
    """

    def __init__(
        self,
        env_id: str,
        options: dict[str, Any],
        settings: PPOSettings,
        seed: int = 0,
        folder: Path | None = None,
    ):
        settings.check()
        self.env_id, self.options, self.settings = env_id, options, settings
        self.seed = check_integer("seed", seed, minimum=0)
        self.folder = folder
        torch.set_num_threads(1)  # small networks lose more to threads than they gain
        env = HybridTrackVecEnv(env_id, settings.num_envs, **options)
        self.segments = env.env.options.segments
        self.model = PPO(
            "MlpPolicy", env, learning_rate=lambda left: settings.learning_rate * max(left, 0.0),
            n_steps=settings.rollout, batch_size=settings.batch, n_epochs=settings.epochs, gamma=1.0,
            gae_lambda=settings.gae_lambda, ent_coef=settings.entropy, seed=self.seed, device="cpu",
            policy_kwargs={"net_arch": list(settings.hidden)},
        )  # fmt: skip
        with torch.no_grad():
            self.model.policy.action_net.get_parameter("bias")[0] = settings.wait_bias
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            self._write_config()

    @classmethod
    def resume(cls, folder: Path, steps: int | None = None) -> "TrainingRun":
        """Go on with a run from its last checkpoint, to its own number of steps or to another."""
        try:
            config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
            config["settings"]["hidden"] = tuple(config["settings"]["hidden"])
            settings = PPOSettings(**config["settings"])
            if steps is not None:
                settings.steps = steps
            run = cls(config["env"], config["options"], settings, config["seed"])
        except (OSError, json.JSONDecodeError, KeyError, TypeError) as error:
            raise reject("resume", str(folder), f"a run folder with a readable {CONFIG} ({error})") from None
        run.folder = folder
        run._load()
        run._write_config()
        return run

    @property
    def decider(self) -> PolicyDecider:
        """The policy as it stands."""
        return PolicyDecider(self.model.policy)

    def train(
        self, on_progress: Callable[[Progress], None] | None = None, save_every: float = 10.0
    ) -> PolicyDecider:
        """Train to the end, saving the run every so many seconds, and return the policy."""
        writers: list[KVWriter] = []
        if self.folder is not None:
            writers = [_MetricsFile(self.folder / METRICS), TensorBoardOutputFormat(str(self.folder))]
        self.model.set_logger(Logger(None if self.folder is None else str(self.folder), writers))
        # torch's stream is global: set it here, not only where the weights were drawn. A resumed run goes on
        # with other streams than those used up, the same at every resumption.
        self.model.set_random_seed(self.seed + self.model.num_timesteps)
        left = self.settings.steps - self.model.num_timesteps
        try:
            if left > 0:
                self.model.learn(left, _Watch(self, on_progress, save_every), reset_num_timesteps=False)
        finally:
            self.model.logger.close()
        if self.folder is not None:
            self.save()
        return self.decider

    def save(self) -> None:
        """Write checkpoint and policy."""
        assert self.folder is not None
        tensors = {f"policy.{name}": value for name, value in self.model.policy.state_dict().items()}
        for index, state in self.model.policy.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{index}.{name}": value for name, value in state.items()}
        part = self.folder / f"{CHECKPOINT}.part"
        save_file(tensors, part, metadata={"steps": str(self.model.num_timesteps)})
        os.replace(part, self.folder / CHECKPOINT)
        card = {
            "environment": self.env_id,
            "options": self.options,
            "algorithm": "PPO",
            "settings": asdict(self.settings),
            "seed": self.seed,
            "steps": self.model.num_timesteps,
            "versions": {
                name: version(name)
                for name in ("hybrid-track", "stable-baselines3", "torch", "numpy", "numba")
            }
            | {"python": platform.python_version()},
        }
        save_policy(self.folder, self.model.policy, card)

    def _load(self) -> None:
        assert self.folder is not None
        path = self.folder / CHECKPOINT
        try:
            with safe_open(path, framework="pt") as file:
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
                steps = int(file.metadata()["steps"])
            policy = {
                name.removeprefix("policy."): value
                for name, value in tensors.items()
                if name.startswith("policy.")
            }
            self.model.policy.load_state_dict(policy)
            state: dict[int, dict[str, torch.Tensor]] = {}
            for name, value in tensors.items():
                if name.startswith("optimizer."):
                    _, index, key = name.split(".")
                    state.setdefault(int(index), {})[key] = value
            groups = self.model.policy.optimizer.state_dict()["param_groups"]
            self.model.policy.optimizer.load_state_dict({"state": state, "param_groups": groups})
        except (OSError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
            reason = str(error).splitlines()[0]
            raise reject(
                "resume", str(self.folder), f"a run folder with a whole {CHECKPOINT} ({reason})"
            ) from None
        self.model.num_timesteps = steps

    def _write_config(self) -> None:
        assert self.folder is not None
        config = {
            "env": self.env_id, "options": self.options, "settings": asdict(self.settings), "seed": self.seed,
        }  # fmt: skip
        part = self.folder / f"{CONFIG}.part"
        part.write_text(json.dumps(config, indent=2) + "\n", encoding="utf-8")
        os.replace(part, self.folder / CONFIG)
