"""Training of the sequence agent with a cross-entropy loss at every tick.

The network itself makes the decisions during training. The threshold on the error probability is drawn at
random after each declaration, and a fraction of the declarations is replaced by random hypotheses. The
anchors therefore include those after early, late and wrong decisions. Each rollout is one step of truncated
backpropagation through time.
"""

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily, sequence_family
from agents.learned.sequence import (
    SequenceNet,
    check_declares_hypotheses,
    error_probability_and_best,
    first_ticks,
    save_sequence,
)
from agents.training import run_folder
from agents.training.recipe import LARGEST_ALPHA, SequenceSettings, TrainingWorld, learning_rate_schedule
from agents.training.run import Run, TrainingProgress
from agents.training.track_state import check_tracks, track_arrays
from hybrid_env.observation import TICK_SCALE
from hybrid_env.registration import make_vector_env
from hybrid_env.vector_env import HybridTrackVectorEnv

MIN_LEARNING_RATE_FACTOR = 0.02  # lower bound of the linear decay
LOG_EVERY = 10  # updates
RECENT_STEPS = 200  # environment steps with decisions that the displayed means are taken over


class _Stream:
    """Parallel tracks of environments with the same number of hypotheses, and their hidden state.

    Attributes:
        hidden_state: (N, M, hidden) after the last update.
        alpha: (N,) error probability at which a track declares.
        radius_weight: (N,) weight of a wrong radius in that error probability.
        redraw: (N,) alpha and radius_weight are drawn again, because the track has just declared.
    """

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int, hidden: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.splits = np.cumsum(counts)[:-1]
        self.rows: list[NDArray[np.float32]] = []
        for env, count in zip(envs, counts, strict=True):
            self.rows.append(env.reset(seed=first_seed)[0])
            first_seed += count
        self.tracks = sum(counts)
        self.layout = envs[0].world.layout
        self.hidden_state = torch.zeros(self.tracks, self.layout.hypotheses, hidden)
        by_type = [env.options.correctness == "type" for env in envs]
        self.by_type = np.repeat(by_type, counts)
        self.alpha, self.radius_weight = np.zeros(self.tracks), np.ones(self.tracks)
        self.redraw = np.ones(self.tracks, np.bool_)

    def rollout(
        self, net: SequenceNet, settings: SequenceSettings
    ) -> tuple[Tensor, Tensor, list[tuple[float, float]]]:
        """Step all tracks T times with the current network.

        Returns:
            Observation rows (T, N, width), true modes (T, N), and mean reward and decision time of the
            decisions, one pair per step and environment with decisions.
        """
        hidden_state = self.hidden_state
        rows, modes, decisions = [], [], []
        for _ in range(settings.n_steps):
            self._draw_thresholds(settings)
            observation = np.concatenate(self.rows)
            rows.append(torch.from_numpy(observation))
            true_modes = np.concatenate([env.world.field("true_mode") for env in self.envs])
            modes.append(torch.from_numpy(true_modes))
            posterior, hidden_state = net.predict_posterior(observation, hidden_state)
            error_probability, best = error_probability_and_best(posterior, self.radius_weight)
            at_last_tick = self.layout.read(observation, "ticks") >= settings.last_tick - TICK_SCALE
            declares = (error_probability <= self.alpha) | at_last_tick
            replaced = self.generator.random(self.tracks) < settings.random_declarations
            random_mode = self.generator.integers(self.layout.hypotheses, size=self.tracks)
            actions = np.where(declares, np.where(replaced, random_mode, best) + 1, 0)
            self.redraw = declares
            for k, (env, part) in enumerate(zip(self.envs, np.split(actions, self.splits), strict=True)):
                self.rows[k], _, _, _, info = env.step(part)
                if "correct" in info:
                    decisions.append(_mean_reward_and_ticks(info, env.options.delay_cost))
        return torch.stack(rows), torch.stack(modes), decisions

    def loss(self, net: SequenceNet, rows: Tensor, modes: Tensor) -> Tensor:
        """Return the mean negative log-posterior of the true mode; stores the final hidden state, detached.

        Args:
            net: the network.
            rows: (T, N, width).
            modes: (T, N) true modes.
        """
        features = net.features(rows)
        reset = first_ticks(rows)[..., None, None]
        hidden_state, hidden_states = self.hidden_state, []
        for tick in range(len(rows)):
            hidden_state = net.next_hidden_state(features[tick], hidden_state * ~reset[tick])
            hidden_states.append(hidden_state)
        self.hidden_state = hidden_state.detach()
        log_posterior = net.log_posterior(rows, torch.stack(hidden_states))
        return nn.functional.nll_loss(log_posterior.flatten(0, 1), modes.flatten())

    def learn(
        self, net: SequenceNet, settings: SequenceSettings, weight: float
    ) -> tuple[list[Tensor], float, list[tuple[float, float]]]:
        """Return the gradient of the weighted loss of a rollout, the weighted loss, and the decisions."""
        rows, modes, decisions = self.rollout(net, settings)
        loss = self.loss(net, rows, modes)
        gradient = torch.autograd.grad(weight * loss, list(net.parameters()))
        return list(gradient), weight * float(loss.detach()), decisions

    def state_tensors(self) -> dict[str, Tensor]:
        """Return all tensors that determine the next rollout; writing into them changes the stream."""
        arrays = {"alpha": self.alpha, "radius_weight": self.radius_weight, "redraw": self.redraw}
        for k, env in enumerate(self.envs):
            arrays |= {f"{k}.{name}": array for name, array in track_arrays(env).items()}
            arrays[f"{k}.rows"] = self.rows[k]
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
        return tensors | {"hidden_state": self.hidden_state}

    def _draw_thresholds(self, settings: SequenceSettings) -> None:
        generator, new = self.generator, self.redraw
        count = int(new.sum())
        low, high = math.log(settings.smallest_alpha), math.log(LARGEST_ALPHA)
        self.alpha[new] = np.exp(generator.uniform(low, high, count))
        weight = generator.random(count) ** 2  # small weights are more frequent: only the type is rewarded
        self.radius_weight[new] = np.where(self.by_type[new], weight, 1.0)


def _mean_reward_and_ticks(info: dict[str, Any], delay_cost: float) -> tuple[float, float]:
    """Return mean reward and decision time of the decisions in one step."""
    decided: NDArray[np.bool_] = info["_correct"]
    ticks = info["ticks"][decided]
    outcome = np.where(info["correct"][decided], 1.0, -1.0)
    return float((outcome - delay_cost * ticks).mean()), float(ticks.mean())


class SequenceRun(Run):
    """A training run of the sequence agent; see `agents.training.runs.make_run` for the arguments.

    Raises:
        ArgumentError: an invalid environment, or a damaged checkpoint.
    """

    def build(self) -> None:
        """Create network, optimizer and environments."""
        assert isinstance(self.recipe.settings, SequenceSettings)
        self.settings = self.recipe.settings
        torch.manual_seed(self.seed)
        self.net = SequenceNet(self.settings.hidden)
        self.rate, self.decays = learning_rate_schedule(self.settings.learning_rate)
        self._optimizer = torch.optim.Adam(self.net.parameters(), lr=self.rate)
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._envs = [self._make(world) for world in self.settings.worlds]
        for world in (self.world, *(env.options for env in self._envs)):
            check_declares_hypotheses(world)
        self._num_timesteps = 0
        self._streams = self._group(self._envs)

    @property
    def num_timesteps(self) -> int:
        """Environment steps so far."""
        return self._num_timesteps

    @num_timesteps.setter
    def num_timesteps(self, steps: int) -> None:
        self._num_timesteps = steps

    @property
    def network(self) -> SequenceNet:
        """The sequence network."""
        return self.net

    @property
    def optimizer(self) -> torch.optim.Optimizer:
        """Its optimizer."""
        return self._optimizer

    def _group(self, envs: list[HybridTrackVectorEnv]) -> list[_Stream]:
        """Group environments with equal numbers of hypotheses."""
        groups: dict[int, list[HybridTrackVectorEnv]] = {}
        for env in envs:
            groups.setdefault(env.options.hypotheses, []).append(env)
        first = seeds.TRAINING + self.seed * 10**9
        return [
            _Stream(group, first + k * 10**6, self.settings.hidden) for k, group in enumerate(groups.values())
        ]

    def _make(self, world: TrainingWorld) -> HybridTrackVectorEnv:
        options = self.options | dict(world.options)
        return make_vector_env(world.env or self.env_id, world.n_envs, tick_info=False, **options)

    def track_tensors(self) -> dict[str, Tensor]:
        """See `Run.track_tensors`."""
        return {
            f"{k}.{name}": tensor
            for k, stream in enumerate(self._streams)
            for name, tensor in stream.state_tensors().items()
        }

    def values(self) -> dict[str, Any]:
        """See `Run.values`."""
        return {"generators": [stream.generator.bit_generator.state for stream in self._streams]}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Run.restore_values`."""
        for stream, state in zip(self._streams, values["generators"], strict=True):
            stream.generator.bit_generator.state = state
            if stream.generator.bit_generator.state != state:  # NumPy rounds fractions
                raise ValueError("the state of a generator is invalid")
        for env in self._envs:
            check_tracks(env)

    def learn(self, on_progress: Callable[[TrainingProgress], None] | None) -> None:
        """Train for the remaining steps; see `Run.learn`."""
        streams = self._streams
        tracks = sum(stream.tracks for stream in streams)
        parameters = list(self.net.parameters())
        recent: list[tuple[float, float]] = []
        # one thread per stream; the sum of the gradients does not depend on the order of completion
        with ThreadPoolExecutor(len(streams)) as pool:
            while self.num_timesteps < self.steps:
                self.between_updates()
                remaining = 1.0 - self.num_timesteps / self.steps
                factor = max(MIN_LEARNING_RATE_FACTOR, remaining) if self.decays else 1.0
                for group in self.optimizer.param_groups:
                    group["lr"] = self.rate * factor
                results = pool.map(
                    lambda stream: stream.learn(self.net, self.settings, stream.tracks / tracks), streams
                )
                gradients, losses, decisions = zip(*results, strict=True)
                for parameter, *parts in zip(parameters, *gradients, strict=True):
                    parameter.grad = torch.stack(parts).sum(0)
                for of_stream in decisions:
                    recent = (recent + of_stream)[-RECENT_STEPS:]
                nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
                self.optimizer.step()
                self.num_timesteps += self.settings.n_steps * tracks
                reward, ticks = np.mean(recent, axis=0) if recent else (math.nan, math.nan)
                if on_progress is not None:
                    progress = TrainingProgress(self.num_timesteps, self.steps, float(reward), float(ticks))
                    on_progress(progress)
                updates = self.num_timesteps // (self.settings.n_steps * tracks)
                if self.folder is not None and updates % LOG_EVERY == 0:
                    metrics = {"loss": sum(losses), "seconds": self.seconds}
                    run_folder.append_metrics(self.folder, self.num_timesteps, metrics)

    def family(self, name: str) -> DeciderFamily:
        """Return the current agent as a family of deciders for the environment of the run."""
        return sequence_family(name, self.net, self.world)

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the current agent."""
        save_sequence(folder, self.net, card)
