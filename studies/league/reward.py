"""An agent for announced switches that learns from the rewards of its declarations alone.

Of the environment the agent knows what its documentation says: the sign of the reward does not
depend on the tick of the declaration, and one hypothesis, or type, of a segment is rewarded. The
reward of a segment therefore teaches all its rows: a rewarded declaration names the hypothesis,
another one excludes it, and the probabilities of the network at the last row say how likely each of
the others is. Nothing else is read: neither the true mode nor an estimate.

In training the thresholds are drawn, and so are some declarations. A round of whole episodes is
determined by its number, so that a checkpoint between two rounds needs no tracks. The memory of the
network is a sum over the rows of the segment, as in Deep Sets (Zaheer et al. 2017): the tick is
among the inputs, so that the order of the rows is not lost, and a whole segment is processed at
once in training.
"""

import copy
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import torch
from annotated_types import Ge
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import NetworkAlgorithm, NetworkDecider, NetworkSettings, task_of
from baselines import Decider, rollout
from hybrid_env import ArgumentError, HybridTrackVectorEnv, Layout, WorldOptions
from studies.league.rows import INPUTS, Rows, row_inputs


class Segments(NamedTuple):
    """S segments up to their declarations, as arrays, or as tensors for a loss."""

    # (S,) number of rows.
    lengths: Any
    # (S,) hypothesis.
    declared: Any
    # (S,) whether the reward of the declaration was positive.
    rewarded: Any


class RewardNet(nn.Module):
    """Corrects the posterior of the bank, from the present row and a memory of the segment, with
    `hidden` units a layer.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.row = nn.Sequential(
            nn.Linear(INPUTS, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.Tanh()
        )
        self.layers = nn.Sequential(
            nn.Linear(INPUTS + hidden, hidden),
            nn.SiLU(),
            nn.Linear(hidden, hidden),
            nn.SiLU(),
            nn.Linear(hidden, 2),
        )
        # The two numbers of each turn are zero until they are trained.
        for parameter in self.layers[-1].parameters():
            nn.init.zeros_(parameter)
        self.scale = nn.Parameter(torch.ones(1))

    def features(self, inputs: Tensor) -> Tensor:
        """Return features (N, M - 1, hidden) of rows; the memory is their sum from the first row
        of the segment.
        """
        features: Tensor = 0.2 * self.row(inputs)
        return features

    def forward(self, inputs: Tensor, memory: Tensor, logs: Tensor) -> Tensor:
        """Return the log-probability that the reward of declaring a hypothesis is positive, (N, M).

        Inputs and logarithms are of `row_inputs`, the memory (N, M - 1, hidden) is the sum of
        `features` so far. A turn has its own first number, straight motion the mean of the second
        ones. They are enlarged, so that they learn faster than the other layers.
        """
        outputs = 3.0 * self.layers(torch.cat([inputs, memory], -1))
        changes = torch.cat([outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]], -1)
        return torch.log_softmax(self.scale * logs + changes, -1)

    def whole(self, inputs: Tensor, logs: Tensor, lengths: Tensor) -> Tensor:
        """Return the same (n, M) of all rows of segments of `lengths` (S,) rows."""
        features = self.features(inputs)
        sums = features.cumsum(0)
        before = (sums - features)[lengths.cumsum(0) - lengths]
        return self(inputs, sums - before.repeat_interleave(lengths, 0), logs)


class RewardDecider(NetworkDecider):
    """Declares the likeliest hypothesis, or the best one of the likeliest type, once the
    probability of a negative reward is at most alpha. The state is the memory of the network
    (N, M - 1, hidden).
    """

    network = RewardNet
    every_tick = True
    symbol = "alpha"
    thresholds = 0.6, 0.4, 0.25, 0.15, 0.1, 0.08, 0.05, 0.03, 0.02, 0.01, 3e-3, 3e-4, 1e-5
    default = 0.03
    bounds = 1e-300, 1.0

    def __init__(self, net: RewardNet, world: WorldOptions):
        super().__init__()
        self.net, self.world, self.layout = net, world, Layout(world.hypotheses)

    def errors(self, posterior: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[Any]]:
        """Return the error probability of a declaration (N,), and its hypothesis (N,)."""
        groups = self.world.groups
        sums = (posterior[:, :, None] * (groups[:, None] == groups)).sum(1)
        right = groups == groups[sums.argmax(-1)][:, None]
        best = np.where(right, posterior, -np.inf).argmax(-1)
        return np.where(right, 0.0, posterior).sum(-1), best

    def decide(self, observation: Rows, state: Any, episode_start: Any) -> tuple[Any, Any]:
        """See `Decider.decide`."""
        posterior, state = self.posterior(observation, state)
        error, best = self.errors(posterior)
        return np.where(error <= self.threshold, best + 1, 0), state

    def evidence(
        self, observation: Rows, state: Any = None, episode_start: Any = None
    ) -> NDArray[np.float64]:
        """Return the posterior of each hypothesis, (N, M)."""
        return self.posterior(observation, copy.deepcopy(state))[0]

    @torch.no_grad()
    def posterior(
        self, observation: Rows, state: Tensor | None
    ) -> tuple[NDArray[np.float64], Tensor]:
        """Return the posterior (N, M) and the memory after rows (N, width); without a state, and
        at first ticks, segments begin.
        """
        rows = np.asarray(observation, np.float32)
        inputs, logs = map(torch.from_numpy, row_inputs(rows))
        memory = self.net.features(inputs)
        if state is not None:
            later = torch.from_numpy(self.layout.read(rows, "ticks") > 1.5)
            memory = memory + torch.where(later[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp().numpy(), memory

    def select_tracks(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        return state[torch.from_numpy(tracks)]


class Explorer(Decider):
    """An agent in training, which draws a threshold for each segment, and a share of its
    declarations.
    """

    def __init__(self, agent: RewardDecider, generator: np.random.Generator, share: float = 0.05):
        self.agent, self.generator, self.share = agent, generator, share

    def decide(self, observation: Rows, state: Any, episode_start: Any) -> tuple[Any, Any]:
        """See `Decider.decide`. The state is that of the agent, and the thresholds (N,)."""
        tracks = len(observation)
        layout = self.agent.layout
        memory, alpha = state or (None, torch.zeros(tracks))
        posterior, memory = self.agent.posterior(observation, memory)
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
class RewardSettings(NetworkSettings):
    """Hyper-parameters of the agent of rewards."""

    # Tracks of a round, one episode each.
    n_envs: Annotated[int, Ge(1)]
    # Segments of an update.
    batch_size: Annotated[int, Ge(1)]


class Reward(NetworkAlgorithm):
    """A training run on rewards alone; it refuses environments in which hypotheses are not
    declared.
    """

    Settings = RewardSettings
    smallest_factor = 0.01
    decider = RewardDecider

    def prepare(self) -> None:
        task = task_of(self.env_id, self.options)
        self.world = task.options
        if not task.waits or self.world.actions != "all":
            raise ArgumentError(f"env={self.env_id}: expected one in which hypotheses are declared")
        asked = vars(self.world) | {"decide_every": 1}
        self.env = HybridTrackVectorEnv(self.settings.n_envs, tick_info=False, **asked)

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        # Episodes of training begin at 10^12, 10^9 apart for each training seed.
        first = 10**12 + self.seed * 10**9 + self.rounds * self.settings.n_envs
        generator = np.random.default_rng(first)
        explorer = Explorer(self.decider(self.network, self.env.options), generator)
        rows, segments = explorer.segments(self.env, first)
        sizes = segments.lengths.tolist()
        parts = [torch.from_numpy(part).split(sizes) for part in row_inputs(rows)]
        tensors = [torch.from_numpy(part) for part in segments]
        losses = []
        self.set_learning_rate()
        order = torch.from_numpy(generator.permutation(len(sizes)))
        for chosen in order.split(self.settings.batch_size):
            inputs = [torch.cat([part[k] for k in chosen]) for part in parts]
            loss = self.loss(inputs, Segments(*(tensor[chosen] for tensor in tensors)))
            self.improve(loss, 1.0, self.network)
            losses.append(float(loss.detach()))
        ticks = float(segments.lengths.mean())
        reward = 2.0 * float(segments.rewarded.mean()) - 1.0 - self.world.delay_cost * ticks
        return len(rows), reward, ticks, {"loss": float(np.mean(losses))}

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the mean cross-entropy of the rewarded hypothesis over the n rows of S segments,
        one segment after the other, from their `row_inputs` (n, ...).
        """
        lengths, declared, rewarded = segments
        logs = self.network.whole(*inputs, lengths)
        groups = torch.from_numpy(self.world.groups)
        with torch.no_grad():
            possible = (groups[declared][:, None] == groups) == rewarded[:, None]
            target = possible * logs[lengths.cumsum(0) - 1].exp().clamp(min=1e-9)
            target /= target.sum(-1, keepdim=True)
        return -(target.repeat_interleave(lengths, 0) * logs).sum(-1).mean()
