"""Parallel tracks on which the anchor agent decides, the samples that they give, and their buffer.

The threshold on the expected loss is drawn at random after each declaration, and a fraction of the declarations is
replaced by random hypotheses. The anchors therefore include those after early, late and wrong decisions.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.learned.anchor_decider import AnchorNetworks, TrackFilters, errors_and_best
from agents.learned.dimensionless import ratios, select, turns_per_tick
from agents.training.checkpoint import track_arrays
from agents.training.settings import LARGEST_ALPHA, AnchorSettings
from baselines.rules.anchor_prior import anchor_errors
from baselines.rules.sensed import sensed_of
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.vector_env import HybridTrackVectorEnv

TYPICAL_ALPHAS = 0.003, 0.1  # thresholds of segments whose losses are learned
DECLARATION = 7
"""Numbers that describe a declaration, the arguments of `anchor_net.regret_inputs`."""


class SampleBuffer:
    """Ring buffer of the last `size` samples of `width` numbers."""

    def __init__(self, size: int, width: int):
        self.rows = np.zeros((size, width), np.float32)
        self.count = 0  # samples added so far

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
    """What the tracks of a stream met, by tick and environment."""

    anchors: list[NDArray[np.floating]]  # (n, 22 + C + 4) inputs of the anchor network, and whitened errors
    declarations: list[NDArray[np.floating]]  # (n, 8) declarations and the loss of the segment after each
    decisions: list[tuple[float, float]]  # mean reward and decision time


class AnchorStream:
    """Parallel tracks of environments with the same number of hypotheses, and their filters.

    The environments reset in the same step, and have traces that are longer than the longest segment.
    """

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.starts = np.concatenate([[0], np.cumsum(counts)])
        self.tracks = int(self.starts[-1])
        firsts = [first_seed + int(start) for start in self.starts[:-1]]
        self.rows = [env.reset(seed=seed)[0] for env, seed in zip(envs, firsts, strict=True)]
        self.layout = envs[0].world.layout
        self.filters = TrackFilters([env.options for env in envs], counts)
        self.by_type = np.repeat([env.options.correctness == "type" for env in envs], counts)
        self.first = np.ones(self.tracks, np.bool_)  # row of an episode
        self.errors = np.zeros((self.tracks, 4))  # of the anchor in the heading frame, where a segment begins
        self.alpha = np.zeros(self.tracks)  # expected loss at which a track declares
        self.redraw = np.ones(self.tracks, np.bool_)  # alpha, because the track has just declared
        self.declaration = np.zeros((self.tracks, DECLARATION))  # the last one of the episode
        self.has_declaration = np.zeros(self.tracks, np.bool_)

    def rollout(self, net: AnchorNetworks, settings: AnchorSettings) -> Rollout:
        """Step all tracks `n_steps` times with the current networks."""
        rollout = Rollout([], [], [])
        for _ in range(settings.n_steps):
            low, high = math.log(settings.smallest_alpha), math.log(LARGEST_ALPHA)
            self.alpha[self.redraw] = np.exp(self.generator.uniform(low, high, int(self.redraw.sum())))
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
        scales = select(self.filters.scales, tracks)
        turn = turns_per_tick(self.layout, rows, scales)
        motion, process, *_ = ratios(self.layout, rows, scales)
        each = np.arange(len(tracks))
        ticks_left = info["decided_length"][decided] - info["ticks"][decided]
        columns = [
            turn[each, info["decided_mode"][decided]], turn[each, info["decided_true_mode"][decided]],
            motion, process, ticks_left, scales.follows_bank, scales.anchor_aware,
        ]  # fmt: skip
        return np.stack(columns, axis=-1)

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next rollout; writing into them changes the stream."""
        names = ("first", "errors", "alpha", "redraw", "declaration", "has_declaration")
        arrays = {name: getattr(self, name) for name in names} | self.filters.state_arrays()
        for k, env in enumerate(self.envs):
            arrays |= {f"{k}.{name}": array for name, array in track_arrays(env).items()}
            arrays[f"{k}.rows"] = self.rows[k]
        return arrays
