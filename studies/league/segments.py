"""Inputs, decider and training on whole segments, of an agent for announced switches.

A segment is a short stopping problem whose last reward is known at once. In training the thresholds
are drawn, and so are some declarations. A round of whole episodes is determined by its number, so
that a checkpoint between two rounds needs no tracks. A network sees a row once for each turn
hypothesis, from the side of this turn.
"""

import copy
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import torch
from annotated_types import Ge
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import NetworkAlgorithm, NetworkDecider, NetworkSettings, task_of, turn_views
from baselines import Decider, rollout
from hybrid_env import ArgumentError, HybridTrackVectorEnv, Layout, WorldOptions

Rows = NDArray[np.float32]
# Inputs of a row, for each turn hypothesis.
INPUTS = 33
SMALLEST = 1e-30


def row_inputs(rows: Rows) -> tuple[Rows, Rows]:
    """Return the inputs of each turn hypothesis (N, M - 1, 33), and the logarithm of the bank's
    posterior (N, M). Other modes take the places of straight motion, the first one, and of turns,
    which are not mirrored. The rows are (N, width).
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name).astype(np.float32) for name in layout.slices}
    ratio = read["log_ratio"]
    ticks = read["ticks"]
    posterior = np.exp(ratio)
    posterior /= posterior.sum(-1, keepdims=True)
    logs = np.log(np.maximum(posterior, np.exp(np.float32(-30.0))))
    of_hypotheses: list[Any] = [
        2.0 * posterior - 1.0,
        np.maximum(logs, -15.0) / 5.0,
        np.maximum(ratio, -6.0) / 2.0,
        0.5 * read["innovation_along"].clip(-6.0, 6.0),
        0.5 * read["innovation_across"].clip(-6.0, 6.0),
        read["log_variance"],
        read["previous"],
        10.0 * read["turn_angle"],
    ]
    across = 0.1 * read["displacement_across"]
    of_track = [
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        3.0 * np.tanh(across / 3.0),
        0.05 * read["displacement_along"],
        np.clip(across / (ticks / 5.0 + 0.1), -3.0, 3.0),
        0.5 * _log(read["anchor_xx"]),
        0.5 * _log(read["anchor_vv"]) + 2.0,
        read["anchor_xv"],
        0.5 * _log(read["speed"]),
    ]
    # A mirrored trajectory changes the sign of these columns: the lateral innovation and the
    # turn, and of the track the two of the lateral displacement.
    side = np.where(read["turn_angle"][:, 1:] < 0.0, np.float32(-1.0), np.float32(1.0))
    out = turn_views(np.stack(of_hypotheses, -1), logs, side, (4, 7), len(of_track))
    out[..., -len(of_track) :] = np.stack(of_track, -1)[:, None]
    for column in (2, 4):
        out[..., column - len(of_track)] *= side
    return np.clip(out, -5.0, 5.0), logs


def _log(values: Rows) -> Rows:
    return np.log(np.maximum(values, np.float32(SMALLEST)))


def zero_layer(inputs: int, outputs: int) -> nn.Linear:
    """Return a linear layer whose outputs are zero until it is trained."""
    layer = nn.Linear(inputs, outputs)
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


def turn_layers(inputs: int, hidden: int) -> nn.Sequential:
    """Return two layers of hidden units, and two outputs of each turn, for `with_straight`."""
    return nn.Sequential(
        nn.Linear(inputs, hidden),
        nn.SiLU(),
        nn.Linear(hidden, hidden),
        nn.SiLU(),
        zero_layer(hidden, 2),
    )


def with_straight(outputs: Tensor) -> Tensor:
    """Return a number of each hypothesis (..., M) from two of each turn (..., M - 1, 2).

    A turn has its first one, straight motion the mean of the second ones. They are enlarged, so
    that the outputs of a network learn faster than its other layers.
    """
    outputs = 3.0 * outputs
    return torch.cat([outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]], -1)


def places(lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the segment (n,) of each row, and its tick (n,) from 0, of S segments of `lengths`
    rows.
    """
    segment = torch.arange(len(lengths)).repeat_interleave(lengths)
    return segment, torch.arange(len(segment)) - (lengths.cumsum(0) - lengths)[segment]


class SegmentDecider(NetworkDecider):
    """Declares the likeliest hypothesis, or the best one of the likeliest type, once its error
    probability is at most alpha. The state is a tensor (N, ...).
    """

    network: ClassVar[Any]
    """Creates the network with a number of hidden units."""
    every_tick = True
    symbol = "alpha"
    thresholds = 0.6, 0.4, 0.25, 0.15, 0.1, 0.08, 0.05, 0.03, 0.02, 0.01, 3e-3, 3e-4, 1e-5
    default = 0.02
    bounds = 1e-300, 1.0

    def __init__(self, net: Any, world: WorldOptions, threshold: float | None = None):
        super().__init__(threshold)
        self.net, self.world, self.layout = net, world, Layout(world.hypotheses)

    def errors(self, posterior: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[Any]]:
        """Return the error probability of a declaration (N,), and its hypothesis (N,)."""
        groups = self.world.groups
        sums = (posterior[:, :, None] * (groups[:, None] == groups)).sum(1)
        right = groups == groups[sums.argmax(-1)][:, None]
        best = np.where(right, posterior, -np.inf).argmax(-1)
        return np.where(right, 0.0, posterior).sum(-1), best

    def decide(self, observation: Rows, state: Any, episode_start: Any) -> tuple[Any, Any]:
        """See `Decider.decide`. The state is that of `posterior`."""
        posterior, state = self.posterior(observation, state, episode_start)
        error, best = self.errors(posterior)
        return np.where(error <= self.threshold, best + 1, 0), state

    def evidence(
        self, observation: Rows, state: Any = None, episode_start: Any = None
    ) -> NDArray[np.float64]:
        """Return the posterior of each hypothesis, (N, M)."""
        return self.posterior(observation, copy.deepcopy(state), episode_start)[0]

    @abstractmethod
    def advance(self, rows: Rows, ticks: Tensor, state: Any) -> tuple[Tensor, Any]:
        """Return the posterior (N, M) in float64 and the state, after rows (N, width) at ticks
        (N,) from 1; without a state segments begin.
        """

    @torch.no_grad()
    def posterior(
        self, observation: Rows, state: Any, episode_start: Any
    ) -> tuple[NDArray[np.float64], Any]:
        rows = np.asarray(observation, np.float32)
        ticks = torch.from_numpy(self.layout.read(rows, "ticks").round().astype(np.int64))
        posterior, state = self.advance(rows, ticks.clamp(min=1), state)
        return posterior.numpy(), state

    def select_tracks(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        return state[torch.from_numpy(tracks)]


class Segments(NamedTuple):
    """S segments up to their declarations, as arrays, or as tensors for a loss."""

    # (S,) number of rows.
    lengths: Any
    # (S,) hypothesis.
    declared: Any
    # (S,) whether the reward of the declaration was positive.
    rewarded: Any


class Explorer(Decider):
    """An agent in training, which draws a threshold for each segment, and a share of its
    declarations.
    """

    def __init__(self, agent: SegmentDecider, generator: np.random.Generator, share: float = 0.05):
        self.agent, self.generator, self.share = agent, generator, share

    def decide(self, observation: Rows, state: Any, episode_start: Any) -> tuple[Any, Any]:
        """See `Decider.decide`. The state is that of the agent, and the thresholds (N,)."""
        tracks = len(observation)
        layout = self.agent.layout
        memory, alpha = state or (None, torch.zeros(tracks))
        posterior, memory = self.agent.posterior(observation, memory, episode_start)
        error, best = self.agent.errors(posterior)
        drawn = np.exp(self.generator.uniform(np.log(0.003), np.log(0.3), tracks))
        alpha = np.where(layout.read(observation, "ticks") < 1.5, drawn, alpha)
        replaced = self.generator.random(tracks) < self.share
        random = self.generator.integers(layout.hypotheses, size=tracks)
        declares = (error <= alpha) | (layout.read(observation, "ticks_left") < 0.5)
        actions = np.where(declares, np.where(replaced, random, best) + 1, 0)
        return actions, (memory, torch.from_numpy(alpha))

    def select_tracks(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        return tuple(self.agent.select_tracks(part, tracks) for part in state)

    def segments(self, env: HybridTrackVectorEnv, seed: int) -> tuple[Rows, Segments]:
        """Run one episode of every track; return its rows (n, width) and segments up to the
        declaration, one after the other.
        """
        unfinished = np.ones(env.num_envs, np.bool_)
        running = np.arange(env.num_envs)
        # What each tick and track tells: track, row; then action and reward.
        asked: list[Any] = []
        answers: list[Any] = []
        for now in rollout(env, self, seed, unfinished):
            if now.step:
                answers.append((now.actions[running], now.rewards[running]))
                unfinished &= ~now.terminated
            running = np.flatnonzero(unfinished)
            if not running.size:
                break
            asked.append((running, now.observation[running]))
        tracks, rows = map(np.concatenate, zip(*asked, strict=True))
        order = np.argsort(tracks, kind="stable")
        actions, rewards = (np.concatenate(part)[order] for part in zip(*answers, strict=True))
        last = np.flatnonzero(actions)
        rewarded = rewards[last] + env.options.delay_cost > 0.0
        lengths = np.diff(last, prepend=-1)
        return rows[order], Segments(lengths, actions[last] - 1, rewarded)


@dataclass(frozen=True, kw_only=True)
class SegmentSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on whole segments."""

    # Tracks of a round, one episode each.
    n_envs: Annotated[int, Ge(1)]
    # Segments of an update.
    batch_size: Annotated[int, Ge(1)]


class SegmentAlgorithm(NetworkAlgorithm):
    """Base class of the algorithms that train on the segments of whole episodes; it refuses
    environments in which hypotheses are not declared.
    """

    Settings = SegmentSettings
    smallest_factor = 0.01
    decider: ClassVar[type[SegmentDecider]]

    def make_env(self, **changes: Any) -> HybridTrackVectorEnv:
        """Return the environment of a round, which asks at every tick, with changed options."""
        options = vars(self.world) | {"decide_every": 1} | changes
        return HybridTrackVectorEnv(self.settings.n_envs, tick_info=False, **options)

    def prepare(self) -> None:
        task = task_of(self.env_id, self.options)
        self.world = task.options
        if not task.waits or self.world.actions != "all":
            raise ArgumentError(f"env={self.env_id}: expected one in which hypotheses are declared")
        self.env = self.make_env()

    def inputs(self, rows: Rows, lengths: NDArray[np.int64]) -> tuple[NDArray[Any], ...]:
        """Return the arrays (n, ...) that the loss needs of rows (n, width) of segments of some
        lengths.
        """
        return row_inputs(rows)

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        # Episodes of training begin at 10^12, 10^9 apart for each training seed.
        first = 10**12 + self.seed * 10**9 + self.rounds * self.settings.n_envs
        generator = np.random.default_rng(first)
        explorer = Explorer(self.decider(self.net, self.env.options), generator)
        rows, segments = explorer.segments(self.env, first)
        sizes = segments.lengths.tolist()
        parts = [
            torch.from_numpy(part).split(sizes) for part in self.inputs(rows, segments.lengths)
        ]
        tensors = [torch.from_numpy(part) for part in segments]
        losses = []
        self.set_learning_rate()
        order = torch.from_numpy(generator.permutation(len(sizes)))
        for chosen in order.split(self.settings.batch_size):
            inputs = [torch.cat([part[k] for k in chosen]) for part in parts]
            loss = self.loss(inputs, Segments(*(tensor[chosen] for tensor in tensors)))
            self.improve(loss, 1.0, self.net)
            losses.append(float(loss.detach()))
        ticks = float(segments.lengths.mean())
        reward = 2.0 * float(segments.rewarded.mean()) - 1.0 - self.world.delay_cost * ticks
        return len(rows), reward, ticks, {"loss": float(np.mean(losses))}

    @abstractmethod
    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the loss of S segments with n rows, one segment after the other, from the `inputs`
        of the rows (n, ...).
        """
