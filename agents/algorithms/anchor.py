"""The anchor agent: likelihood of the anchor errors, and squared error of the next
losses.

The agent itself decides during training. The threshold on the expected loss is drawn at random
after each declaration, and a fraction of the declarations is replaced by random hypotheses. The
anchors therefore include those after early, late and wrong decisions. Besides fixed worlds there
are random ones, which are drawn anew regularly. After every rollout the networks are trained on
random samples of the last anchors and declarations.
"""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import torch
from annotated_types import Interval
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.anchor_decider import (
    AnchorDecider,
    AnchorNetworks,
    TrackFilters,
    errors_and_best,
)
from agents.learned.anchor_net import declaration_context, regret_inputs, select, turns_per_tick
from agents.training.algorithm import Round
from agents.training.checkpoint import check_tracks, track_arrays
from agents.training.settings import LARGEST_ALPHA, WorldsSettings
from agents.training.worlds import WorldsAlgorithm
from baselines.rules import seeds
from baselines.rules.anchor_prior import anchor_errors
from baselines.rules.measurements import sensed_of
from hybrid_env.checks import Count, Float32Array, IntArray, Share, check_integer
from hybrid_env.vector_env import HybridTrackVectorEnv

DECLARATION = 7
"""Numbers that describe a declaration, the arguments of `anchor_net.regret_inputs`."""


@dataclass(frozen=True, kw_only=True)
class AnchorSettings(WorldsSettings):
    """Hyper-parameters of the anchor agent.

    The threshold of a track on the error probability is drawn log-uniformly from `smallest_alpha`
    to 0.3 after each declaration. Anchors after a wrong decision are rare under a good policy;
    without random declarations, decisions from them take three times as long.
    """

    # Ticks between updates.
    n_steps: Count
    smallest_alpha: Annotated[float, Interval(gt=0.0, lt=LARGEST_ALPHA)]
    # At which every track declares; later ticks contribute little to learning.
    last_tick: Count
    # Probability that a declaration is replaced by a random hypothesis.
    random_declarations: Share
    # After which the random environments are drawn anew.
    updates_per_world: Count = 32
    # Last anchors, and last declarations, that samples are drawn from.
    buffer_size: Count = 50_000
    # Steps of the optimizer per update.
    batches: Count = 8
    # Samples of a step.
    batch_size: Count = 1024


class SampleBuffer:
    """Ring buffer of the last `size` samples of `width` numbers."""

    def __init__(self, size: int, width: int):
        self.rows = np.zeros((size, width), np.float32)
        # Samples added so far.
        self.count = 0

    def add(self, parts: list[NDArray[np.floating]]) -> None:
        """Add samples (n, width) of several parts in place of the oldest ones."""
        samples = np.concatenate([np.zeros((0, self.rows.shape[1])), *parts])[-len(self.rows) :]
        self.rows[(self.count + np.arange(len(samples))) % len(self.rows)] = samples
        self.count += len(samples)

    def draw(self, generator: np.random.Generator, size: int) -> Float32Array:
        """Return random samples (size, width), with replacement."""
        filled = min(self.count, len(self.rows))
        return self.rows[generator.integers(filled, size=size)]


class Rollout(NamedTuple):
    """What the tracks of a stream met, by tick and environment."""

    # (n, 22 + C + 4) inputs of the anchor network, and whitened errors.
    anchors: list[NDArray[np.floating]]
    # (n, 8) declarations and the loss of the segment after each.
    declarations: list[NDArray[np.floating]]
    # Mean reward and decision time.
    decisions: list[tuple[float, float]]


class AnchorStream:
    """Parallel tracks of environments with the same number of hypotheses, and their filters.

    The environments reset in the same step, and have traces that are longer than the longest
    segment.
    """

    def __init__(self, envs: list[HybridTrackVectorEnv], first_seed: int):
        self.envs = envs
        self.generator = np.random.default_rng(first_seed)
        counts = [env.num_envs for env in envs]
        self.starts = np.concatenate([[0], np.cumsum(counts)])
        self.tracks = int(self.starts[-1])
        self.rows = [
            env.reset(seed=first_seed + int(start))[0]
            for env, start in zip(envs, self.starts[:-1], strict=True)
        ]
        self.layout = envs[0].world.layout
        self.filters = TrackFilters([env.options for env in envs], counts)
        self.by_type = np.repeat([env.options.correctness == "type" for env in envs], counts)
        # Row of an episode.
        self.first = np.ones(self.tracks, np.bool_)
        # Of the anchor in the heading frame, where a segment begins.
        self.errors = np.zeros((self.tracks, 4))
        # Expected loss at which a track declares.
        self.alpha = np.zeros(self.tracks)
        # Alpha, because the track has just declared.
        self.redraw = np.ones(self.tracks, np.bool_)
        # The last one of the episode.
        self.declaration = np.zeros((self.tracks, DECLARATION))
        self.has_declaration = np.zeros(self.tracks, np.bool_)

    def rollout(self, net: AnchorNetworks, settings: AnchorSettings) -> Rollout:
        """Step all tracks `n_steps` times with the current networks."""
        rollout = Rollout([], [], [])
        for _ in range(settings.n_steps):
            low = math.log(settings.smallest_alpha)
            high = math.log(LARGEST_ALPHA)
            self.alpha[self.redraw] = np.exp(
                self.generator.uniform(low, high, int(self.redraw.sum()))
            )
            observation = np.concatenate(self.rows)
            sensed = [sensed_of(env.world) for env in self.envs]
            posterior = self.filters.advance(net.anchor, observation, self.first, sensed)
            if self.filters.anchor_samples is not None:
                inputs, factor, tracks = self.filters.anchor_samples
                white = np.linalg.solve(factor, self.errors[tracks][..., None])[..., 0]
                rollout.anchors.append(np.concatenate([inputs, white], axis=1))
            error, best = errors_and_best(
                net,
                observation,
                self.filters.scales,
                posterior,
                self.by_type,
                self.alpha,
            )
            at_last_tick = self.layout.read(observation, "ticks") >= settings.last_tick
            self.redraw = (error <= self.alpha) | at_last_tick
            replaced = self.generator.random(self.tracks) < settings.random_declarations
            random_mode = self.generator.integers(self.layout.hypotheses, size=self.tracks)
            actions = np.where(self.redraw, np.where(replaced, random_mode, best) + 1, 0)
            for k in range(len(self.envs)):
                self._step(k, actions, observation, rollout)
        return rollout

    def _step(
        self,
        k: int,
        actions: IntArray,
        observation: Float32Array,
        rollout: Rollout,
    ) -> None:
        """Step the tracks of environment k, and record the decisions."""
        env = self.envs[k]
        start = self.starts[k]
        stop = self.starts[k + 1]
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
        # Losses after unusual thresholds are not learned.
        typical = (self.alpha[tracks] > 0.003) & (self.alpha[tracks] < 0.1)
        known = typical & self.has_declaration[tracks]
        if known.any():
            pairs = np.concatenate([self.declaration[tracks], loss[:, None]], axis=1)
            rollout.declarations.append(pairs[known])
        rows, scales = observation[tracks], select(self.filters.scales, tracks)
        turn = turns_per_tick(self.layout, rows, scales)
        each = np.arange(len(tracks))
        motion, process, _, *of_world = declaration_context(self.layout, rows, scales)
        columns = [
            turn[each, info["decided_mode"][decided]],
            turn[each, info["decided_true_mode"][decided]],
            motion,
            process,
            info["decided_length"][decided] - ticks,
            *of_world,
        ]
        self.declaration[tracks] = np.stack(columns, axis=-1)
        self.has_declaration[tracks] = ~terminated[decided]
        switched = decided[~terminated[decided]]
        self.errors[start + switched] = anchor_errors(env, switched, truth[switched])

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next rollout; writing into them changes the
        stream.
        """
        names = ("first", "errors", "alpha", "redraw", "declaration", "has_declaration")
        arrays = {name: getattr(self, name) for name in names} | self.filters.state_arrays()
        for k, env in enumerate(self.envs):
            arrays |= {f"{k}.{name}": array for name, array in track_arrays(env).items()}
            arrays[f"{k}.rows"] = self.rows[k]
        return arrays


class Anchor(WorldsAlgorithm):
    """A training run of the anchor agent."""

    name = "anchor"
    Settings = AnchorSettings
    smallest_factor: ClassVar[float] = 0.02
    log_every: ClassVar[int] = 10
    decider = AnchorDecider
    settings: AnchorSettings

    def build(self) -> None:
        """Create networks, optimizer, environments and buffers."""
        super().build()
        self._generator = np.random.default_rng(seeds.TRAINING + self.seed)
        self._anchors = SampleBuffer(self.settings.buffer_size, self.net.anchor.inputs + 4)
        self._declarations = SampleBuffer(self.settings.buffer_size, DECLARATION + 1)
        self._generation = 0
        self._streams = self._draw_streams()
        self._round_steps = self.settings.n_steps * sum(stream.tracks for stream in self._streams)
        self._recent: list[tuple[float, float]] = []

    def set_steps(self, steps: int) -> None:
        """See `Algorithm.set_steps`; draws new random worlds when a new generation of them
        begins.
        """
        super().set_steps(steps)
        generation = steps // self._round_steps // self.settings.updates_per_world
        if self.settings.drawn_worlds and generation != self._generation:
            self._generation = generation
            self._streams = self._draw_streams()

    def _draw_streams(self) -> list[AnchorStream]:
        """Return tracks of the fixed worlds and of random ones, one stream for each number of
        hypotheses.
        """
        first = seeds.TRAINING + self.seed * 10**9 + self._generation * 10**5
        generator = np.random.default_rng(first)
        groups: dict[int, list[HybridTrackVectorEnv]] = {}
        for world, count in self.all_worlds(generator):
            # A segment decided at once, and the first tick of the next.
            rows = world.longest_segment + 1
            env = HybridTrackVectorEnv(count, AutoresetMode.SAME_STEP, False, rows, **vars(world))
            groups.setdefault(world.hypotheses, []).append(env)
        return [AnchorStream(group, first + k * 10**4) for k, group in enumerate(groups.values())]

    def track_tensors(self) -> dict[str, Tensor]:
        arrays = {"anchors": self._anchors.rows, "declarations": self._declarations.rows}
        for k, stream in enumerate(self._streams):
            arrays |= {f"{k}.{name}": array for name, array in stream.state_arrays().items()}
        return {name: torch.from_numpy(array) for name, array in arrays.items()}

    def values(self) -> dict[str, Any]:
        return super().values() | {
            "generators": [generator.bit_generator.state for generator in self._generators()],
            "counts": [self._anchors.count, self._declarations.count],
        }

    def restore_values(self, values: dict[str, Any]) -> None:
        super().restore_values(values)
        for generator, state in zip(self._generators(), values["generators"], strict=True):
            generator.bit_generator.state = state
        for buffer, count in zip(
            (self._anchors, self._declarations),
            values["counts"],
            strict=True,
        ):
            buffer.count = check_integer("count", count, minimum=0)
        for stream in self._streams:
            for env in stream.envs:
                check_tracks(env)

    def _generators(self) -> list[np.random.Generator]:
        return [self._generator, *(stream.generator for stream in self._streams)]

    def train_round(self) -> Round:
        # One thread per stream; the samples do not depend on the order of completion.
        with ThreadPoolExecutor(len(self._streams)) as pool:
            for rollout in pool.map(
                lambda stream: stream.rollout(self.net, self.settings),
                self._streams,
            ):
                self._anchors.add(rollout.anchors)
                self._declarations.add(rollout.declarations)
                # The displayed means are those of the last steps with decisions.
                self._recent = (self._recent + rollout.decisions)[-200:]
        self.set_learning_rate()
        totals = np.mean([self._update() for _ in range(self.settings.batches)], axis=0).tolist()
        losses = dict(zip(("anchor_loss", "regret_loss"), totals, strict=True))
        reward, ticks = np.mean(self._recent, axis=0) if self._recent else (math.nan, math.nan)
        return self._round_steps, float(reward), float(ticks), losses

    def _update(self) -> list[float]:
        """Make a step of the optimizer on random samples; return the losses of anchors and
        declarations, 0 without samples.
        """
        size, inputs = self.settings.batch_size, self.net.anchor.inputs
        losses = [torch.zeros((), requires_grad=True)] * 2
        if self._anchors.count:
            rows = torch.from_numpy(self._anchors.draw(self._generator, size))
            losses[0] = self.net.anchor.loss(rows[:, :inputs], rows[:, inputs:])
        if self._declarations.count:
            *values, targets = self._declarations.draw(self._generator, size).astype(np.float64).T
            losses[1] = self.net.regret.loss(
                *regret_inputs(*values), torch.from_numpy(targets).float()
            )
        self.improve(losses[0] + losses[1], 1.0, self.net.anchor, self.net.regret)
        return [float(loss.detach()) for loss in losses]
