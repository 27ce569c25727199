"""Training with Stable-Baselines3's PPO into a run folder that can be resumed.

A run folder holds config.json, checkpoint.safetensors (weights, optimizer and progress in one file, so that
a killed run never mixes two of them), policy.safetensors with its card, metrics.jsonl and TensorBoard events.
"""

import json
import math
import platform
import time
from collections.abc import Callable
from contextlib import suppress
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

from agents import seeds
from agents.policy import PolicyDecider, save_policy
from agents.ppo_settings import STEPS, PPOSettings
from agents.vec_env import HybridTrackVecEnv
from agents.writing import output_folder, whole_file, write_json
from hybrid_env.checks import check_integer, reject

CONFIG = "config.json"
CHECKPOINT = "checkpoint.safetensors"
METRICS = "metrics.jsonl"


@dataclass(frozen=True)
class TrainingProgress:
    """Where a training run stands.

    Attributes:
        steps, total: environment steps, done and wanted.
        reward: mean of a segment in the last 100 episodes; NaN before the first has ended.
        ticks: mean decision time of a segment in the last 100 episodes, likewise.
    """

    steps: int
    total: int
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

    def __init__(
        self, run: "TrainingRun", on_progress: Callable[[TrainingProgress], None] | None, interval: float
    ):
        super().__init__()
        self.run, self.on_progress, self.interval = run, on_progress, interval
        self.saved = time.monotonic()

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
            self.on_progress(TrainingProgress(self.model.num_timesteps, self.run.steps, reward, ticks))


class TrainingRun:
    """One PPO run.

    Args:
        env_id: registered id of the environment.
        options: of the world, over those of the id.
        settings: hyper-parameters; None takes the defaults.
        seed: of weights, tracks and mini-batches, below 2^31.
        folder: run folder, made if it is not there; None keeps nothing.
        steps: environment steps, summed over tracks; rounded up to whole rollouts.
    """

    def __init__(
        self,
        env_id: str,
        options: dict[str, Any],
        settings: PPOSettings | None = None,
        seed: int = 0,
        folder: Path | None = None,
        steps: int = STEPS,
    ):
        settings = PPOSettings() if settings is None else settings
        settings.check()
        self.steps = check_integer("steps", steps)
        self.env_id, self.options, self.settings = env_id, options, settings
        self.seed = check_integer("seed", seed, minimum=0)
        if self.seed >= 2**31:
            raise reject("seed", seed, "an integer below 2^31")
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
            output_folder("out", folder)
            self._write_config()

    @classmethod
    def resume(cls, folder: Path, steps: int | None = None) -> "TrainingRun":
        """Go on with a run from its last checkpoint, to its own number of steps or to another."""
        try:
            config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
            config["settings"]["hidden"] = tuple(config["settings"]["hidden"])
            settings = PPOSettings(**config["settings"])
            run = cls(
                config["env"], config["options"], settings, config["seed"],
                steps=config["steps"] if steps is None else steps,
            )  # fmt: skip
        except (OSError, json.JSONDecodeError, KeyError, TypeError) as error:
            raise reject("resume", str(folder), f"a run folder with a readable {CONFIG} ({error})") from None
        run.folder = folder
        run._load()
        run._write_config()
        return run

    def track_seeds(self) -> list[int]:
        """Seeds of the tracks from here on; evaluations count from small ones."""
        first = seeds.TRAINING + 10**9 * self.seed + self.model.num_timesteps
        return [first + track for track in range(self.settings.num_envs)]

    @property
    def decider(self) -> PolicyDecider:
        """The policy as it stands."""
        return PolicyDecider(self.model.policy)

    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> PolicyDecider:
        """Train to the end, saving the run every so many seconds, and return the policy."""
        writers: list[KVWriter] = []
        if self.folder is not None:
            writers = [_MetricsFile(self.folder / METRICS), TensorBoardOutputFormat(str(self.folder))]
        self.model.set_logger(Logger(None if self.folder is None else str(self.folder), writers))
        # torch's stream is global: set it here, not only where the weights were drawn. A resumed run goes on
        # with other streams than those used up, the same at every resumption.
        done = self.model.num_timesteps
        self.model.set_random_seed((self.seed + done) % 2**32)
        self.model.env.seed(self.track_seeds()[0])  # type: ignore[union-attr]
        if self.folder is not None and not (self.folder / CHECKPOINT).exists():
            self.save()  # a run killed before its first interval can go on, too
        left = self.steps - done
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
        with whole_file(self.folder / CHECKPOINT) as part:
            save_file(tensors, part, metadata={"steps": str(self.model.num_timesteps)})
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
        self._drop_metrics_beyond(steps)

    def _drop_metrics_beyond(self, steps: int) -> None:
        """Forget what was logged after the checkpoint: it will be logged again."""
        assert self.folder is not None
        path = self.folder / METRICS
        if path.is_file():
            with suppress(ValueError), whole_file(path) as part:  # a line cut off by the kill is the last
                kept = [line for line in path.read_text(encoding="utf-8").splitlines() if line.endswith("}")]
                kept = [line for line in kept if json.loads(line)["step"] <= steps]
                part.write_text("".join(line + "\n" for line in kept), encoding="utf-8")

    def _write_config(self) -> None:
        assert self.folder is not None
        config = {
            "env": self.env_id, "options": self.options, "settings": asdict(self.settings),
            "steps": self.steps, "seed": self.seed,
        }  # fmt: skip
        write_json(self.folder / CONFIG, config)
