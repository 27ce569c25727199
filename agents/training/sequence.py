"""Training of the sequence agent: a classification loss at every tick of streamed segments.

Tracks are driven by the network itself, stopped at thresholds that are drawn anew after each declaration, and
now and then declare something else, so that anchors are those of eager and of patient deciders, wrong ones
included. Every rollout is one step of truncated backpropagation through time.
"""

import math
import time
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
    doubt_and_best,
    first_ticks,
    save_sequence,
)
from agents.training import run_folder
from agents.training.recipe import EAGEREST, SequenceSettings, TrainedWorld, schedule
from agents.training.run import Run, TrainingProgress
from hybrid_env.observation import TICK_SCALE
from hybrid_env.registration import make_vector_env
from hybrid_env.vector_env import HybridTrackVectorEnv

SLOWEST = 0.02  # share of the learning rate that is left at the end
LOG_EVERY = 1.0  # seconds


class _Stream:
    """Tracks of one or more worlds with one number of hypotheses, and what the network remembers of them."""

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int, hidden: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.cuts = np.cumsum(counts)[:-1]
        self.rows: list[NDArray[np.float32]] = []
        for env, count in zip(envs, counts, strict=True):
            self.rows.append(env.reset(seed=first_seed)[0])
            first_seed += count
        self.tracks = sum(counts)
        self.layout = envs[0].world.layout
        self.memory = torch.zeros(self.tracks, self.layout.hypotheses, hidden)
        by_type = [env.options.correctness == "type" for env in envs]
        self.by_type = np.repeat(by_type, counts)
        self.limit, self.radius = np.zeros(self.tracks), np.ones(self.tracks)
        self.fresh = np.ones(self.tracks, np.bool_)

    def rollout(
        self, net: SequenceNet, settings: SequenceSettings
    ) -> tuple[Tensor, Tensor, list[tuple[float, float]]]:
        """Rows (T, N, width), true modes (T, N), and reward and ticks of each decision on the way."""
        memory = self.memory
        rows, modes, decided = [], [], []
        for _ in range(settings.n_steps):
            self._draw_limits(settings)
            observation = np.concatenate(self.rows)
            rows.append(torch.from_numpy(observation))
            true = np.concatenate([env.world.field("true_mode") for env in self.envs])
            modes.append(torch.from_numpy(true))
            posterior, memory = net.believe(observation, memory)
            doubt, best = doubt_and_best(posterior, self.radius)
            late = self.layout.read(observation, "ticks") >= settings.latest - TICK_SCALE
            declares = (doubt <= self.limit) | late
            stray = self.generator.random(self.tracks) < settings.stray
            other = self.generator.integers(self.layout.hypotheses, size=self.tracks)
            actions = np.where(declares, np.where(stray, other, best) + 1, 0)
            self.fresh = declares
            for k, (env, part) in enumerate(zip(self.envs, np.split(actions, self.cuts), strict=True)):
                self.rows[k], _, _, _, info = env.step(part)
                if "correct" in info:
                    decided.append(_figures(info, env.options.delay_cost))
        return torch.stack(rows), torch.stack(modes), decided

    def loss(self, net: SequenceNet, rows: Tensor, modes: Tensor) -> Tensor:
        """Mean over ticks and tracks of the surprise at the true mode; keeps the memory behind them."""
        features = net.features(rows)
        keep = ~first_ticks(rows)[..., None, None]
        memory, memories = self.memory, []
        for tick in range(len(rows)):
            memory = net.remember(features[tick], memory * keep[tick])
            memories.append(memory)
        self.memory = memory.detach()
        scores = net.log_posterior(rows, torch.stack(memories))
        return nn.functional.nll_loss(scores.flatten(0, 1), modes.flatten())

    def learn(
        self, net: SequenceNet, settings: SequenceSettings, share: float
    ) -> tuple[list[Tensor], float, list[tuple[float, float]]]:
        """Gradient of its share of the loss, the loss, and the decisions of a rollout."""
        rows, modes, decided = self.rollout(net, settings)
        loss = self.loss(net, rows, modes)
        gradient = torch.autograd.grad(share * loss, list(net.parameters()))
        return list(gradient), share * float(loss.detach()), decided

    def _draw_limits(self, settings: SequenceSettings) -> None:
        generator = self.generator
        count = int(self.fresh.sum())
        low, high = math.log(settings.strictest), math.log(EAGEREST)
        self.limit[self.fresh] = np.exp(generator.uniform(low, high, count))
        weight = generator.random(count) ** 2  # nearer to what is rewarded, the type
        self.radius[self.fresh] = np.where(self.by_type[self.fresh], weight, 1.0)


def _figures(info: dict[str, Any], delay_cost: float) -> tuple[float, float]:
    """Mean reward and ticks of the decisions of a step."""
    decided: NDArray[np.bool_] = info["_correct"]
    ticks = info["ticks"][decided]
    right = np.where(info["correct"][decided], 1.0, -1.0)
    return float((right - delay_cost * ticks).mean()), float(ticks.mean())


class SequenceRun(Run):
    """One training of the sequence agent; see `agents.runs.make_run` for the arguments.

    Raises:
        ArgumentError: a bad world, or a folder with a damaged checkpoint.
    """

    def build(self) -> None:
        """Make network, optimizer and worlds."""
        assert isinstance(self.recipe.settings, SequenceSettings)
        self.settings = self.recipe.settings
        torch.manual_seed(self.seed)
        self.net = SequenceNet(self.settings.hidden)
        self.rate, self.falls = schedule(self.settings.learning_rate)
        self._optimizer = torch.optim.Adam(self.net.parameters(), lr=self.rate)
        self.world = make_vector_env(self.env_id, 1, **self.options).options
        self._envs = [self._make(world) for world in self.settings.worlds]
        for world in (self.world, *(env.options for env in self._envs)):
            check_declares_hypotheses(world)

    def start(self, done: int) -> None:
        """Go on from as many environment steps."""
        self._done = done
        self._streams = self._group(self._envs)

    @property
    def done(self) -> int:
        """Environment steps made."""
        return self._done

    @property
    def network(self) -> SequenceNet:
        """What is trained."""
        return self.net

    @property
    def optimizer(self) -> torch.optim.Optimizer:
        """What trains it."""
        return self._optimizer

    def _group(self, envs: list[HybridTrackVectorEnv]) -> list[_Stream]:
        """The tracks, those with as many hypotheses side by side; a resumed run has others."""
        groups: dict[int, list[HybridTrackVectorEnv]] = {}
        for env in envs:
            groups.setdefault(env.options.hypotheses, []).append(env)
        first = seeds.TRAINING + self.seed * 10**9 + self.done
        return [
            _Stream(group, first + k * 10**6, self.settings.hidden) for k, group in enumerate(groups.values())
        ]

    def _make(self, world: TrainedWorld) -> HybridTrackVectorEnv:
        options = self.options | dict(world.options)
        return make_vector_env(world.env or self.env_id, world.n_envs, tick_info=False, **options)

    def train(
        self, on_progress: Callable[[TrainingProgress], None] | None = None, save_every: float = 10.0
    ) -> None:
        """Train to the end, saving the run every so many seconds."""
        streams = self._streams
        tracks = sum(stream.tracks for stream in streams)
        parameters = list(self.net.parameters())
        self.save_if_new()
        recent: list[tuple[float, float]] = []
        begun = time.monotonic() - self.seconds
        saved = logged = time.monotonic()
        # one thread a stream: their arithmetic goes on side by side, and its sum does not depend on that
        with ThreadPoolExecutor(len(streams)) as pool:
            while self.done < self.steps:
                left = max(SLOWEST, 1.0 - self.done / self.steps) if self.falls else 1.0
                for group in self.optimizer.param_groups:
                    group["lr"] = self.rate * left
                found = pool.map(
                    lambda stream: stream.learn(self.net, self.settings, stream.tracks / tracks), streams
                )
                gradients, losses, decisions = zip(*found, strict=True)
                for parameter, *parts in zip(parameters, *gradients, strict=True):
                    parameter.grad = torch.stack(parts).sum(0)
                for decided in decisions:
                    recent = (recent + decided)[-200:]
                nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
                self.optimizer.step()
                self._done += self.settings.n_steps * tracks
                now = time.monotonic()
                self.seconds = now - begun
                reward, ticks = np.mean(recent, axis=0) if recent else (math.nan, math.nan)
                if on_progress is not None:
                    on_progress(TrainingProgress(self.done, self.steps, float(reward), float(ticks)))
                if self.folder is None:
                    continue
                if now - logged > LOG_EVERY:
                    figures = {"loss": sum(losses), "seconds": self.seconds}
                    run_folder.append_metrics(self.folder, self.done, figures)
                    logged = now
                over = self.done >= self.steps
                if over or self.curve.due(self.seconds):
                    self.measure()
                if over or now - saved > save_every:
                    self.save()
                    saved = now
                begun = time.monotonic() - self.seconds  # what was measured and saved is not training

    def family(self, name: str) -> DeciderFamily:
        """The agent as it stands, as a decider of the world that it is trained for."""
        return sequence_family(name, self.net, self.world)

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """Write weights and card of the agent as it stands."""
        save_sequence(folder, self.net, card)
