"""Training of the sequence agent: a classification loss at every tick of streamed segments.

Tracks are driven by the network itself, stopped at thresholds that are drawn anew for each segment, so that
anchors are those of eager and of patient deciders, wrong ones included. Every rollout is one step of
truncated backpropagation through time.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import seeds
from agents.evaluation import make_vector_env
from agents.sequence import SequenceNet, first_ticks, save_sequence
from agents.training import TrainingProgress
from agents.writing import output_folder
from hybrid_env.checks import check_integer, check_positive, reject
from hybrid_env.observation import TICK_SCALE, Layout

SAVE_EVERY = 20.0  # seconds


@dataclass(frozen=True)
class SequenceSettings:
    """Hyper-parameters of the sequence agent."""

    tracks: int = 192
    """Tracks, split evenly over the worlds."""
    rollout: int = 64
    """Ticks between updates."""
    hidden: int = 40
    """Width of the memory of a hypothesis."""
    learning_rate: float = 5e-3
    """Step size at the start; it falls to a fiftieth in a straight line."""
    strictest: float = 1e-4
    """Smallest doubt at which a track may stop; the largest is 0.3, drawn evenly in the logarithm."""
    latest: int = 45
    """Tick at which every track stops: later ones teach little."""

    def __post_init__(self) -> None:
        for name in ("tracks", "rollout", "hidden", "latest"):
            check_integer(name, getattr(self, name))
        check_positive("learning_rate", self.learning_rate)
        if not 0.0 < self.strictest < 0.3:
            raise reject("strictest", self.strictest, "a number between 0 and 0.3")


class _Stream:
    """The tracks of one world and what the network remembers of them."""

    def __init__(self, env_id: str, options: Mapping[str, Any], tracks: int, seed: int, hidden: int):
        self.env = make_vector_env(env_id, tracks, tick_info=False, **options)
        self.rows, _ = self.env.reset(seed=seed)
        self.layout: Layout = self.env.world.layout
        self.memory = torch.zeros(tracks, self.layout.hypotheses, hidden)
        self.limit = np.zeros(tracks)
        self.fresh = np.ones(tracks, np.bool_)

    @torch.no_grad()
    def rollout(
        self, net: SequenceNet, settings: SequenceSettings, generator: np.random.Generator
    ) -> tuple[Tensor, Tensor, Tensor, list[dict[str, Any]]]:
        """Rows (T, N, width), true modes (T, N), the memory before them, and the decisions on the way."""
        rows, modes, decisions = [], [], []
        before, memory = self.memory, self.memory
        for _ in range(settings.rollout):
            count = int(self.fresh.sum())
            self.limit[self.fresh] = generator.uniform(math.log(settings.strictest), math.log(0.3), count)
            row = torch.from_numpy(self.rows)
            rows.append(row)
            modes.append(torch.from_numpy(self.env.world.field("true_mode")))
            memory = net.remember(net.features(row), memory * ~first_ticks(row)[:, None, None])
            posterior = net.log_posterior(row, memory).exp().numpy()
            best = posterior.argmax(-1)
            doubt = np.log(np.maximum(1.0 - posterior.max(-1), 1e-12))
            late = self.layout.read(self.rows, "ticks") >= settings.latest - TICK_SCALE
            actions = np.where((doubt <= self.limit) | late, best + 1, 0)
            self.rows, _, _, _, info = self.env.step(actions)
            self.fresh = actions > 0
            if "correct" in info:
                decisions.append(info)
        self.memory = memory
        return torch.stack(rows), torch.stack(modes), before, decisions

    def loss(self, net: SequenceNet, rows: Tensor, modes: Tensor, memory: Tensor) -> Tensor:
        """Mean over ticks and tracks of the surprise at the true mode."""
        features = net.features(rows)
        keep = ~first_ticks(rows)[..., None, None]
        memories = []
        for tick in range(len(rows)):
            memory = net.remember(features[tick], memory * keep[tick])
            memories.append(memory)
        scores = net.log_posterior(rows, torch.stack(memories))
        self.memory = memory.detach()
        return nn.functional.nll_loss(scores.flatten(0, 1), modes.flatten())


def train_sequence(
    env_id: str,
    worlds: Sequence[Mapping[str, Any]],
    steps: int,
    seed: int = 0,
    settings: SequenceSettings | None = None,
    folder: Path | None = None,
    on_progress: Callable[[TrainingProgress], None] | None = None,
) -> SequenceNet:
    """Train a network on one or more worlds of an id.

    Args:
        worlds: options of each world, over those of the id.
        steps: environment steps, summed over tracks.
        seed: of weights, tracks and thresholds; the same seed gives the same weights.
        folder: where weights and card are kept, every `SAVE_EVERY` seconds and at the end.
    """
    settings = settings or SequenceSettings()
    check_integer("steps", steps)
    check_integer("seed", seed, minimum=0)
    if not worlds or settings.tracks < len(worlds):
        raise reject("tracks", settings.tracks, f"at least one track for each of {len(worlds)} worlds")
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    generator = np.random.default_rng(seed)
    net = SequenceNet(settings.hidden)
    share = settings.tracks // len(worlds)
    first = seeds.TRAINING + seed * 10**9
    streams = [
        _Stream(env_id, options, share, first + index * share, settings.hidden)
        for index, options in enumerate(worlds)
    ]
    if folder is not None:
        output_folder("out", folder)
    card = {
        "environment": env_id, "options": dict(worlds[0]), "worlds": [dict(world) for world in worlds],
        "settings": asdict(settings), "steps": steps, "seed": seed,
        "versions": {name: version(name) for name in ("hybrid-track", "torch", "numpy", "numba")},
    }  # fmt: skip
    optimizer = torch.optim.Adam(net.parameters(), lr=settings.learning_rate)
    done, saved = 0, time.monotonic()
    recent: list[tuple[float, float]] = []
    while done < steps:
        for group in optimizer.param_groups:
            group["lr"] = settings.learning_rate * max(0.02, 1.0 - done / steps)
        losses = []
        for stream in streams:
            rows, modes, memory, decisions = stream.rollout(net, settings, generator)
            losses.append(stream.loss(net, rows, modes, memory))
            recent = (recent + [_figures(info, stream) for info in decisions])[-200:]
        optimizer.zero_grad()
        torch.stack(losses).mean().backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        done += share * len(streams) * settings.rollout
        if on_progress is not None:
            reward, ticks = np.mean(recent, axis=0) if recent else (math.nan, math.nan)
            on_progress(TrainingProgress(done, steps, float(reward), float(ticks)))
        if folder is not None and time.monotonic() - saved > SAVE_EVERY:
            save_sequence(folder, net, card | {"trained": done})
            saved = time.monotonic()
    if folder is not None:
        save_sequence(folder, net, card | {"trained": done})
    return net.eval()


def _figures(info: dict[str, Any], stream: _Stream) -> tuple[float, float]:
    """Mean reward and ticks of the decisions of a step."""
    decided: NDArray[np.bool_] = info["_correct"]
    ticks = info["ticks"][decided]
    right = np.where(info["correct"][decided], 1.0, -1.0)
    return float((right - stream.env.options.delay_cost * ticks).mean()), float(ticks.mean())
