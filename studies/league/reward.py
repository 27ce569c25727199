"""An agent that learns from the rewards of its declarations alone.

A segment is a short stopping problem whose last reward is known at once. Of the environment the
agent knows what its documentation says: the sign of the reward does not depend on the tick of the
declaration, and one hypothesis, or type, of a segment is rewarded. The reward of a segment
therefore teaches all its rows: a rewarded declaration names the hypothesis, another one excludes
it, and the probabilities of the network at the last row say how likely each of the others is.
Nothing else is read: neither the true mode nor an estimate. In training the thresholds are drawn,
and so are some declarations. A round of whole episodes is determined by its number, so that a
checkpoint between two rounds needs no tracks.

As `statement_net` the network sees a row once for each turn hypothesis, from the side of this
turn. Its memory is a sum over the rows of the segment, as in Deep Sets (Zaheer et al. 2017): the
tick is among the inputs, so that the order of the rows is not lost, and a whole segment is
processed at once in training.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.statement_net import (
    GAIN,
    LARGEST_INNOVATION,
    LOWEST_LOG,
    sides,
    turn_views,
    zero_layer,
)
from agents.training.algorithm import NetworkAlgorithm, Round
from agents.training.settings import LARGEST_ALPHA, LARGEST_COUNT, NetworkSettings
from baselines.rules import seeds
from baselines.rules.decider import Actions, Decider, Observations
from baselines.rules.msprt import mode_types, posterior_of
from baselines.rules.rollout import rollout
from hybrid_env.checks import BoolArray, FloatArray, IntArray, check_flag, reject
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.registration import environment_options, make_vector_env

HYPOTHESIS_INPUTS = 8
TRACK_INPUTS = 9
# Inputs of a hypothesis that change their sign in a mirrored trajectory.
ODD = 4, 7
ODD_OF_TRACK = 2, 4
INPUTS = 3 * HYPOTHESIS_INPUTS + TRACK_INPUTS
# Inputs are clipped to +-5.
LIMIT = 5.0
# Of the features of a row in the memory.
SHARE = 0.2
SMALLEST = 1e-30
INNOVATIONS = "innovation_along", "innovation_across"


def reward_inputs(
    rows: NDArray[np.float32],
    tau: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the inputs of each turn hypothesis (N, M - 1, 33), and the logarithm of the bank's
    posterior (N, M).

    The rows are (N, width), and a tick has the length tau [s].
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name).astype(np.float32) for name in layout.slices}
    ratio = read["log_ratio"]
    speed = np.maximum(read["speed"], SMALLEST)
    ticks = read["ticks"]
    posterior = np.exp(ratio)
    posterior /= posterior.sum(-1, keepdims=True)
    logs = np.log(np.maximum(posterior, np.exp(np.float32(-30.0))))
    innovations = [
        0.5 * read[name].clip(-LARGEST_INNOVATION, LARGEST_INNOVATION) for name in INNOVATIONS
    ]
    turn = 10.0 * read["curvature"] * (speed * np.float32(tau))[:, None]
    each: list[Any] = [
        2.0 * posterior - 1.0,
        np.maximum(logs, LOWEST_LOG) / 5.0,
        np.maximum(ratio, -6.0) / 2.0,
        *innovations,
        read["log_variance"],
        read["previous"],
        turn,
    ]
    out = turn_views(np.stack(each, -1), logs, ODD, TRACK_INPUTS)
    across = 0.1 * read["displacement_across"]
    of_track = [
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        3.0 * np.tanh(across / 3.0),
        0.05 * read["displacement_along"],
        np.clip(across / (ticks / 5.0 + 0.1), -3.0, 3.0),
        0.5 * _log(read["anchor_xx"]),
        0.5 * _log(read["anchor_vv"] * np.float32(tau * tau)) + 2.0,
        read["anchor_xv"] * np.float32(tau),
        0.5 * (_log(speed * np.float32(tau)) - 0.5 * read["log_noise"]),
    ]
    out[..., -TRACK_INPUTS:] = np.stack(of_track, -1)[:, None]
    for column in ODD_OF_TRACK:
        out[..., column - TRACK_INPUTS] *= sides(layout.hypotheses)[1:]
    return np.clip(out, -LIMIT, LIMIT), logs


def _log(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.log(np.maximum(values, np.float32(SMALLEST)))


def hidden_layers(inputs: int, hidden: int) -> nn.Sequential:
    """Return two layers of hidden units."""
    return nn.Sequential(nn.Linear(inputs, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU())


def with_straight(outputs: Tensor) -> Tensor:
    """Return a number of each hypothesis (..., M) from two of each turn (..., M - 1, 2).

    A turn has its first one, straight motion the mean of the second ones.
    """
    return torch.cat([outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]], -1)


class RewardNet(nn.Module):
    """Corrects the posterior of the bank, from the present row and a memory of the segment;
    `hidden` units a layer.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.row = nn.Sequential(
            nn.Linear(INPUTS, hidden),
            nn.SiLU(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
        )
        self.layers = hidden_layers(INPUTS + hidden, hidden)
        self.output = zero_layer(hidden, 2)
        self.scale = nn.Parameter(torch.ones(1))

    def features(self, inputs: Tensor) -> Tensor:
        """Return features (N, M - 1, hidden) of rows; the memory is their sum from the first row
        of the segment.
        """
        return SHARE * self.row(inputs)

    def forward(self, inputs: Tensor, memory: Tensor, logs: Tensor) -> Tensor:
        """Return the log-probability that the reward of declaring a hypothesis is positive, (N, M).

        Inputs and logarithms are of `reward_inputs`, the memory (N, M - 1, hidden) is the sum of
        `features` so far.
        """
        outputs = GAIN * self.output(self.layers(torch.cat([inputs, memory], -1)))
        return torch.log_softmax(self.scale * logs + with_straight(outputs), -1)


class RewardDecider(PosteriorDecider):
    """Declares the likeliest hypothesis once the probability of a negative reward is at most alpha.

    The state is the memory of the network (N, M - 1, hidden), which begins anew at every switch.
    """

    default = 0.03
    network: ClassVar[Any] = RewardNet
    label = "learned from rewards"

    @torch.no_grad()
    def posterior(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[FloatArray, Any]:
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        ticks = self.layout.read(rows, "ticks").round().astype(np.int64)
        found, state = self.advance(rows, torch.from_numpy(ticks).clamp(min=1), state)
        return found.numpy(), state

    def advance(self, rows: Observations, ticks: Tensor, state: Any) -> tuple[Tensor, Any]:
        """Return the posterior (N, M) in float64 and the state, after rows (N, width) at ticks
        (N,) from 1.
        """
        inputs, logs = map(torch.from_numpy, reward_inputs(rows, self.world.tau))
        memory = self.net.features(inputs)
        if state is not None:
            memory = memory + torch.where((ticks > 1)[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp(), memory

    def errors(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: Any,
    ) -> tuple[FloatArray, IntArray]:
        values = posterior_of(posterior, self.by_type)
        largest = values.max(-1, keepdims=True)
        return 1.0 - largest[:, 0], np.where(values == largest, posterior, -1.0).argmax(-1)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`; the state is one tensor (N, ...) or a named tuple of
        them.
        """
        if state is None:
            return None
        kept = torch.from_numpy(tracks)
        return (
            state[kept]
            if isinstance(state, Tensor)
            else type(state)(*(part[kept] for part in state))
        )


# Norm.
LARGEST_GRADIENT = 1.0
# Of the thresholds in training.
SMALLEST_ALPHA = 0.003
# Share of the declarations.
RANDOM_DECLARATIONS = 0.05
# Rows x turns of a round, whose inputs take half a gigabyte.
LARGEST_ROUND = 2**22


@dataclass(frozen=True, kw_only=True)
class SegmentSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on whole segments, such as MSPRT-TANDEM."""

    # Tracks of a round, one episode each.
    n_envs: int
    # Segments of an update.
    batch_size: int

    largest = NetworkSettings.largest | {"n_envs": LARGEST_COUNT, "batch_size": LARGEST_COUNT}


@dataclass(frozen=True, kw_only=True)
class RewardSettings(SegmentSettings):
    """Hyper-parameters of the agent that learns from rewards alone."""

    # The reward of a declaration teaches all rows of its segment, and not only the last one.
    every_row: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("every_row", self.every_row)


class Explorer(Decider):
    """An agent in training, which draws a threshold for each segment, and some of its
    declarations.
    """

    def __init__(self, agent: RewardDecider, generator: np.random.Generator):
        self.agent, self.generator = agent, generator
        self.layout = agent.layout

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state is the memory and the thresholds (N,)."""
        tracks = len(observation)
        memory, alpha = state or (None, np.zeros(tracks))
        posterior, memory = self.agent.posterior(observation, memory, episode_start)
        error, best = self.agent.errors(observation, posterior, memory)
        drawn = np.exp(
            self.generator.uniform(np.log(SMALLEST_ALPHA), np.log(LARGEST_ALPHA), tracks)
        )
        alpha = np.where(self.layout.read(observation, "ticks") < 1.5, drawn, alpha)
        replaced = self.generator.random(tracks) < RANDOM_DECLARATIONS
        mode = np.where(
            replaced,
            self.generator.integers(self.layout.hypotheses, size=tracks),
            best,
        )
        declares = (error <= alpha) | (self.layout.read(observation, "ticks_left") < 0.5)
        return np.where(declares, mode + 1, 0), (memory, alpha)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        return (
            None
            if state is None
            else (self.agent.select_tracks(state[0], tracks), state[1][tracks])
        )

    def segments(self, env: Any, seed: int) -> "Segments":
        """Run one episode of every track of a vector environment; return its segments up to the
        declaration.
        """
        running = np.arange(env.num_envs)
        unfinished = np.ones(env.num_envs, np.bool_)
        tracks = []
        rows = []
        actions = []
        rewards = []
        modes = []
        nothing = np.zeros(env.num_envs, np.int64)
        for now in rollout(env, self, seed, unfinished):
            if now.step:
                actions.append(now.actions[running])
                rewards.append(now.rewards[running])
                # Missing if nobody decided.
                modes.append(now.info.get("decided_true_mode", nothing)[running])
                unfinished &= ~now.terminated
            running = np.flatnonzero(unfinished)
            if not running.size:
                break
            tracks.append(running)
            rows.append(now.observation[running])
        order = np.argsort(np.concatenate(tracks), kind="stable")
        declared = np.concatenate(actions)[order] - 1
        last = np.flatnonzero(declared >= 0)
        rewarded = np.concatenate(rewards)[order][last] + self.agent.world.delay_cost > 0.0
        return Segments(
            np.concatenate(rows)[order],
            np.diff(last, prepend=-1),
            declared[last],
            rewarded,
            np.concatenate(modes)[order][last],
        )


class Segments(NamedTuple):
    """S segments up to their declarations."""

    # (n, width), one segment after the other.
    rows: Observations
    # (S,) number of rows.
    lengths: IntArray
    # (S,) hypothesis.
    declared: IntArray
    # (S,) whether the reward of the declaration was positive.
    rewarded: BoolArray
    # (S,) true mode, which an agent that learns from rewards alone does not read.
    modes: IntArray


class SegmentAlgorithm(NetworkAlgorithm):
    """Base class of the algorithms that train on the segments of whole episodes; it refuses
    environments in which hypotheses are not declared.
    """

    smallest_factor: ClassVar[float] = 0.01
    decider: ClassVar[type[RewardDecider]]
    inputs = staticmethod(reward_inputs)
    measure: ClassVar[str] = "cross_entropy"
    """Name of the loss in the metrics."""
    settings: Any
    """A `SegmentSettings`."""

    def build(self) -> None:
        """Create network, optimizer and environment."""
        if environment_options(self.env_id) is not WorldOptions:
            raise reject("env", self.env_id, "an environment in which hypotheses are declared")
        self.env = make_vector_env(
            self.env_id,
            self.settings.n_envs,
            tick_info=False,
            **self.options,
        )
        self.world: WorldOptions = self.env.options
        if self.world.actions != "all":
            raise reject(
                "actions",
                self.world.actions,
                "'all' for an agent that declares hypotheses",
            )
        rows = self.settings.n_envs * self.world.segments * self.world.longest_segment
        if rows * (self.world.hypotheses - 1) > LARGEST_ROUND:
            raise reject(
                "n_envs",
                self.settings.n_envs,
                f"n_envs x ticks x (M - 1) of at most {LARGEST_ROUND:,}",
            )
        torch.manual_seed(self.seed)
        self.net: Any = self.decider.network(self.settings.hidden)
        self.start(self.net, self.settings.learning_rate)
        modes = np.arange(self.world.hypotheses)
        kinds = mode_types(modes.size) if self.world.correctness == "type" else modes
        self._alike = torch.from_numpy((kinds[:, None] == kinds).astype(np.float32))

    def train_round(self) -> Round:
        first = seeds.TRAINING + self.seed * 10**9 + self.rounds * self.settings.n_envs
        generator = np.random.default_rng(first)
        found = Explorer(self.decider(self.net, self.world), generator).segments(self.env, first)
        lengths, labels = found.lengths, self.labels(found)
        inputs, logs = self.inputs(found.rows, self.world.tau)
        begins = lengths.cumsum() - lengths
        order = generator.permutation(lengths.size)
        losses = []
        self.set_learning_rate()
        for start in range(0, lengths.size, self.settings.batch_size):
            chosen = order[start : start + self.settings.batch_size]
            pairs = zip(begins[chosen], lengths[chosen], strict=True)
            some = np.concatenate([np.arange(n) + begin for begin, n in pairs])
            own = (label[some if len(label) == len(inputs) else chosen] for label in labels)
            parts = inputs[some], logs[some], lengths[chosen], *own
            loss = self.loss(*map(torch.from_numpy, parts))
            self.optimizer.zero_grad(set_to_none=False)
            loss.backward()
            nn.utils.clip_grad_norm_(self.net.parameters(), LARGEST_GRADIENT)
            self.optimizer.step()
            losses.append(float(loss.detach()))
        self.rounds += 1
        ticks = float(lengths.mean())
        reward = 2.0 * float(found.rewarded.mean()) - 1.0 - self.world.delay_cost * ticks
        return len(found.rows), reward, ticks, {self.measure: float(np.mean(losses))}

    @abstractmethod
    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """Return what the loss needs of each segment, arrays (S, ...), or of each row, (n, ...)."""

    @abstractmethod
    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the loss of S segments with n rows, one segment after the other.

        Args:
            inputs, logs: (n, ...) of the rows, from `inputs`.
            lengths: (S,) of the segments.
            labels: those of the segments or rows.
        """


class Reward(SegmentAlgorithm):
    """A training run on rewards alone."""

    Settings = RewardSettings
    decider = RewardDecider

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        return found.declared, found.rewarded

    def loss(
        self,
        inputs: Tensor,
        logs: Tensor,
        lengths: Tensor,
        *labels: Tensor,
    ) -> Tensor:
        """Return the mean cross-entropy of the rewarded hypothesis over the rows of S segments.

        The inputs (n, M - 1, 33) and logarithms (n, M) are of `reward_inputs`, all else (S,) of
        `Segments`.
        """
        declared, rewarded = labels
        segment = torch.arange(len(lengths)).repeat_interleave(lengths)
        ends = lengths.cumsum(0)
        features = self.net.features(inputs)
        sums = features.cumsum(0)
        before = (sums - features)[ends - lengths]
        logs = self.net(inputs, sums - before[segment], logs)
        with torch.no_grad():
            possible = torch.where(
                rewarded[:, None],
                self._alike[declared],
                1.0 - self._alike[declared],
            )
            target = possible * logs[ends - 1].exp().clamp(min=1e-9)
            target /= target.sum(-1, keepdim=True)
        if not self.settings.every_row:
            return -(target * logs[ends - 1]).sum(-1).mean()
        return -(target[segment] * logs).sum(-1).mean()
