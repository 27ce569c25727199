"""Parallel tracks on which the anchor agent decides, the samples that they give, and their buffer."""

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.anchor_decider import AnchorNetworks, errors_and_best
from agents.learned.dimensionless import ratios, turns_per_tick
from agents.learned.track_filters import TrackFilters
from agents.training.checkpoint import track_arrays
from agents.training.settings import LARGEST_ALPHA, AnchorSettings
from baselines.rules.anchor_prior import anchor_errors
from baselines.rules.measurements import sensed_of
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.vector_env import HybridTrackVectorEnv

TYPICAL_ALPHAS = 0.003, 0.1  # thresholds of segments whose losses are learned
DECLARATION = 7
"""Numbers that describe a declaration, the arguments of `anchor_net.regret_inputs`."""


class SampleBuffer:
    """Ring buffer of samples.

    Args:
        size: number of samples that are kept.
        width: numbers of a sample.

    Attributes:
        rows: (size, width) float32.
        count: number of samples added so far.
    """

    def __init__(self, size: int, width: int):
        self.rows = np.zeros((size, width), np.float32)
        self.count = 0

    def add(self, parts: list[NDArray[np.floating]]) -> None:
        """Add samples (n, width) of several parts in place of the oldest ones."""
        samples = np.concatenate([np.zeros((0, self.rows.shape[1])), *parts])[-len(self.rows) :]
        self.rows[(self.count + np.arange(len(samples))) % len(self.rows)] = samples
        self.count += len(samples)

    def draw(self, generator: np.random.Generator, size: int) -> NDArray[np.float32]:
        """Return random samples (size, width), with replacement."""
        filled = min(self.count, len(self.rows))
        return self.rows[generator.integers(filled, size=size)]


class Rollout(NamedTuple):
    """What the tracks of a stream met.

    Attributes:
        anchors: (n, 22 + C + 4) inputs of the anchor network and whitened errors, of each tick.
        declarations: (n, 8) declarations and the loss of the segment after each.
        decisions: mean reward and decision time, one item per tick and environment with decisions.
    """

    anchors: list[NDArray[np.floating]]
    declarations: list[NDArray[np.floating]]
    decisions: list[tuple[float, float]]


class AnchorStream:
    """Parallel tracks of environments with the same number of hypotheses, and their filters.

    Args:
        envs: with resets in the same step, and traces that are longer than the longest segment.
        first_seed: of the tracks.

    Attributes:
        tracks: number of tracks N.
        first: (N,) first row of an episode.
        errors: (N, 4) error of the anchor in the heading frame, of the tracks that begin a segment.
        alpha: (N,) expected loss at which a track declares.
        redraw: (N,) alpha is drawn again, because the track has just declared.
        declaration: (N, 7) the last declaration of the episode.
        has_declaration: (N,) there is one.
    """

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.starts = np.concatenate([[0], np.cumsum(counts)])
        self.tracks = int(self.starts[-1])
        self.rows = [
            env.reset(seed=first_seed + int(start))[0] for env, start in zip(envs, self.starts[:-1], strict=True)
        ]
        self.layout = envs[0].world.layout
        self.filters = TrackFilters([env.options for env in envs], counts)
        self.by_type = np.repeat([env.options.correctness == "type" for env in envs], counts)
        self.first = np.ones(self.tracks, np.bool_)
        self.errors = np.zeros((self.tracks, 4))
        self.alpha = np.zeros(self.tracks)
        self.redraw = np.ones(self.tracks, np.bool_)
        self.declaration = np.zeros((self.tracks, DECLARATION))
        self.has_declaration = np.zeros(self.tracks, np.bool_)

    def rollout(self, net: AnchorNetworks, settings: AnchorSettings) -> Rollout:
        """Step all tracks `n_steps` times with the current networks."""
        rollout = Rollout([], [], [])
        for _ in range(settings.n_steps):
            self._draw_thresholds(settings)
            observation = np.concatenate(self.rows)
            sensed = [sensed_of(env.world) for env in self.envs]
            posterior = self.filters.advance(net.anchor, observation, self.first, sensed)
            if self.filters.anchor_samples is not None:
                inputs, factor, tracks = self.filters.anchor_samples
                white = np.linalg.solve(factor, self.errors[tracks][..., None])[..., 0]
                rollout.anchors.append(np.concatenate([inputs, white], axis=1))
            error, best = errors_and_best(net, observation, self.filters.scales, posterior, self.by_type, self.alpha)
            at_last_tick = self.layout.read(observation, "ticks") >= settings.last_tick
            self.redraw = (error <= self.alpha) | at_last_tick
            replaced = self.generator.random(self.tracks) < settings.random_declarations
            random_mode = self.generator.integers(self.layout.hypotheses, size=self.tracks)
            actions = np.where(self.redraw, np.where(replaced, random_mode, best) + 1, 0)
            for k in range(len(self.envs)):
                self._step(k, actions, observation, rollout)
        return rollout

    def _step(self, k: int, actions: IntArray, observation: NDArray[np.float32], rollout: Rollout) -> None:
        """Step the tracks of environment k, and record the decisions."""
        env, start, stop = self.envs[k], self.starts[k], self.starts[k + 1]
        truth = env.world.field("truth")
        self.rows[k], _, terminated, _, info = env.step(actions[start:stop])
        self.first[start:stop] = terminated
        if "correct" not in info:
            return
        decided = np.flatnonzero(info["_correct"])
        ticks = info["ticks"][decided]
        loss = np.where(info["correct"][decided], 0.0, 2.0) + env.options.delay_cost * ticks
        rollout.decisions.append((1.0 - float(loss.mean()), float(ticks.mean())))
        tracks = start + decided
        low, high = TYPICAL_ALPHAS
        typical = (low < self.alpha[tracks]) & (self.alpha[tracks] < high)
        known = typical & self.has_declaration[tracks]
        if known.any():
            pairs = np.concatenate([self.declaration[tracks], loss[:, None]], axis=1)
            rollout.declarations.append(pairs[known])
        self.declaration[tracks] = self._describe(tracks, observation[tracks], info, decided)
        self.has_declaration[tracks] = ~terminated[decided]
        switched = decided[~terminated[decided]]
        self.errors[start + switched] = anchor_errors(env, switched, truth[switched])

    def _describe(
        self, tracks: IntArray, rows: NDArray[np.float32], info: dict[str, Any], decided: IntArray
    ) -> FloatArray:
        """Return the declarations of tracks, (n, 7)."""
        scales = self.filters.scales.select(tracks)
        turn = turns_per_tick(self.layout, rows, scales)
        motion, process, *_ = ratios(self.layout, rows, scales)
        each = np.arange(len(tracks))
        ticks_left = info["decided_length"][decided] - info["ticks"][decided]
        columns = [
            turn[each, info["decided_mode"][decided]], turn[each, info["decided_true_mode"][decided]],
            motion, process, ticks_left, scales.follows_bank, scales.anchor_aware,
        ]  # fmt: skip
        return np.stack(columns, axis=-1)

    def state_tensors(self) -> dict[str, Tensor]:
        """Return all tensors that determine the next rollout; writing into them changes the stream."""
        arrays: dict[str, NDArray[Any]] = {
            "first": self.first, "errors": self.errors, "alpha": self.alpha, "redraw": self.redraw,
            "declaration": self.declaration, "has_declaration": self.has_declaration,
        }  # fmt: skip
        arrays |= self.filters.state_arrays()
        for k, env in enumerate(self.envs):
            arrays |= {f"{k}.{name}": array for name, array in track_arrays(env).items()}
            arrays[f"{k}.rows"] = self.rows[k]
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def _draw_thresholds(self, settings: AnchorSettings) -> None:
        new = self.redraw
        low, high = math.log(settings.smallest_alpha), math.log(LARGEST_ALPHA)
        self.alpha[new] = np.exp(self.generator.uniform(low, high, int(new.sum())))
