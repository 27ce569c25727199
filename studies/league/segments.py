"""What the rivals for announced switches share: inputs, decider, and training on whole segments.

A segment is a short stopping problem whose last reward is known at once. In training the thresholds
are drawn, and so are some declarations. A round of whole episodes is determined by its number, so
that a checkpoint between two rounds needs no tracks. A network sees a row once for each turn
hypothesis, from the side of this turn.
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import torch
from annotated_types import Ge
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import NetworkAlgorithm, NetworkSettings, PosteriorDecider, task_of, turn_views
from baselines import Decider, rollout
from hybrid_env import ArgumentError, HybridTrackVectorEnv, Layout, WorldOptions

Rows = NDArray[np.float32]
INPUTS = 33
# Of the outputs of a network, so that they learn faster than its other layers.
GAIN = 3.0
SMALLEST = 1e-30


def sides(hypotheses: int) -> NDArray[np.float32]:
    """Return 0 for straight motion, 1 for left and -1 for right turns, (M,)."""
    turns = hypotheses // 2
    return np.repeat(
        np.array(
            [
                0,
                1,
                -1,
            ],
            np.float32,
        ),
        [
            1,
            turns,
            turns,
        ],
    )


def kinds(world: WorldOptions) -> NDArray[Any]:
    """Return numbers (M,) that are equal where declaring either hypothesis is rewarded alike."""
    by_type = world.correctness == "type"
    return sides(world.hypotheses) if by_type else np.arange(world.hypotheses)


def row_inputs(rows: Rows, tau: float) -> tuple[Rows, Rows]:
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
    of_hypotheses: list[Any] = [
        2.0 * posterior - 1.0,
        np.maximum(logs, -15.0) / 5.0,
        np.maximum(ratio, -6.0) / 2.0,
        0.5 * read["innovation_along"].clip(-6.0, 6.0),
        0.5 * read["innovation_across"].clip(-6.0, 6.0),
        read["log_variance"],
        read["previous"],
        10.0 * read["curvature"] * (speed * np.float32(tau))[:, None],
    ]
    across = 0.1 * read["displacement_across"]
    of_track = [
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        3.0 * np.tanh(across / 3.0),
        0.05 * read["displacement_along"],
        np.clip(
            across / (ticks / 5.0 + 0.1),
            -3.0,
            3.0,
        ),
        0.5 * _log(read["anchor_xx"]),
        0.5 * _log(read["anchor_vv"] * np.float32(tau * tau)) + 2.0,
        read["anchor_xv"] * np.float32(tau),
        0.5 * (_log(speed * np.float32(tau)) - 0.5 * read["log_noise"]),
    ]
    # A mirrored trajectory changes the sign of these columns: the lateral innovation and the
    # curvature, and of the track the two of the lateral displacement.
    out = turn_views(
        np.stack(of_hypotheses, -1),
        logs,
        (4, 7),
        len(of_track),
    )
    out[..., -len(of_track) :] = np.stack(of_track, -1)[:, None]
    for column in (2, 4):
        out[..., column - len(of_track)] *= sides(layout.hypotheses)[1:]
    return np.clip(
        out,
        -5.0,
        5.0,
    ), logs


def _log(values: Rows) -> Rows:
    return np.log(np.maximum(values, np.float32(SMALLEST)))


def zero_layer(inputs: int, outputs: int) -> nn.Linear:
    """Return a linear layer whose outputs are zero until it is trained."""
    layer = nn.Linear(inputs, outputs)
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


def hidden_layers(inputs: int, hidden: int) -> nn.Sequential:
    """Return two layers of hidden units."""
    return nn.Sequential(
        nn.Linear(inputs, hidden),
        nn.SiLU(),
        nn.Linear(hidden, hidden),
        nn.SiLU(),
    )


def with_straight(outputs: Tensor) -> Tensor:
    """Return a number of each hypothesis (..., M) from two of each turn (..., M - 1, 2).

    A turn has its first one, straight motion the mean of the second ones.
    """
    return torch.cat(
        [outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]],
        -1,
    )


def places(lengths: Tensor) -> tuple[Tensor, Tensor]:
    """Return the segment (n,) of each row, and its tick (n,) from 0, of S segments of `lengths`
    rows.
    """
    segment = torch.arange(len(lengths)).repeat_interleave(lengths)
    return segment, torch.arange(len(segment)) - (lengths.cumsum(0) - lengths)[segment]


def each_tensor(function: Callable[..., Tensor], *states: Any) -> Any:
    """Apply a function to the tensors at the same places of states, which are nested tuples."""
    first = states[0]
    if first is None:
        return None
    if isinstance(first, Tensor):
        return function(*states)
    parts = [each_tensor(function, *parts) for parts in zip(*states, strict=True)]
    return type(first)(*parts) if hasattr(first, "_fields") else tuple(parts)


def where(tracks: Tensor, state: Any, other: Any) -> Any:
    """Return one state for the tracks of a mask (N,), and another one for the others."""

    def chosen(part: Tensor, others: Tensor) -> Tensor:
        return torch.where(
            tracks.view(-1, *[1] * (part.ndim - 1)),
            part,
            others,
        )

    return each_tensor(
        chosen,
        state,
        other,
    )


class SegmentDecider(PosteriorDecider):
    """Declares the likeliest hypothesis, or the best one of the likeliest type, once its error
    probability is at most alpha. The state is a tensor (N, ...) or a nested tuple of them.
    """

    network: ClassVar[Any]
    """Creates the network with a number of hidden units."""

    @abstractmethod
    def advance(self, rows: Rows, ticks: Tensor, state: Any) -> tuple[Tensor, Any]:
        """Return the posterior (N, M) in float64 and the state, after rows (N, width) at ticks
        (N,) from 1; without a state segments begin.
        """

    @torch.no_grad()
    def posterior(
        self,
        observation: Rows,
        state: Any,
        episode_start: Any,
    ) -> tuple[NDArray[np.float64], Any]:
        rows = np.asarray(observation, np.float32)
        ticks = self.layout.read(rows, "ticks").round().astype(np.int64)
        posterior, state = self.advance(
            rows,
            torch.from_numpy(ticks).clamp(min=1),
            state,
        )
        return posterior.numpy(), state

    def select_tracks(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        return each_tensor(
            lambda part: part[torch.from_numpy(tracks)],
            state,
        )


class Segments(NamedTuple):
    """S segments up to their declarations."""

    # (n, width), one segment after the other.
    rows: Rows
    # (S,) number of rows.
    lengths: NDArray[np.int64]
    # (S,) hypothesis.
    declared: NDArray[np.int64]
    # (S,) whether the reward of the declaration was positive.
    rewarded: NDArray[np.bool_]
    # (S,) true mode, which an agent that learns from rewards alone does not read.
    modes: NDArray[np.int64]


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
        posterior, memory = self.agent.posterior(
            observation,
            memory,
            episode_start,
        )
        error, best = self.agent.errors(
            observation,
            posterior,
            memory,
        )
        drawn = np.exp(
            self.generator.uniform(
                np.log(0.003),
                np.log(0.3),
                tracks,
            )
        )
        alpha = np.where(
            layout.read(observation, "ticks") < 1.5,
            drawn,
            alpha,
        )
        replaced = self.generator.random(tracks) < self.share
        random = self.generator.integers(layout.hypotheses, size=tracks)
        declares = (error <= alpha) | (layout.read(observation, "ticks_left") < 0.5)
        actions = np.where(
            declares,
            np.where(
                replaced,
                random,
                best,
            )
            + 1,
            0,
        )
        return actions, (memory, torch.from_numpy(alpha))

    def select_tracks(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        return self.agent.select_tracks(state, tracks)

    def segments(self, env: HybridTrackVectorEnv, seed: int) -> Segments:
        """Run one episode of every track; return its segments up to the declaration."""
        unfinished = np.ones(env.num_envs, np.bool_)
        running = np.arange(env.num_envs)
        # Missing if nobody decided.
        nothing = np.zeros(env.num_envs, np.int64)
        # Of each tick and track: track, row; then action, reward and true mode.
        asked: list[Any] = []
        answers: list[Any] = []
        for now in rollout(
            env,
            self,
            seed,
            unfinished,
        ):
            if now.step:
                modes = now.info.get("decided_true_mode", nothing)
                answers.append([part[running] for part in (now.actions, now.rewards, modes)])
                unfinished &= ~now.terminated
            running = np.flatnonzero(unfinished)
            if not running.size:
                break
            asked.append((running, now.observation[running]))
        tracks, rows = map(np.concatenate, zip(*asked, strict=True))
        order = np.argsort(tracks, kind="stable")
        actions, rewards, modes = map(np.concatenate, zip(*answers, strict=True))
        last = np.flatnonzero(actions[order])
        declarations = order[last]
        return Segments(
            rows[order],
            np.diff(last, prepend=-1),
            actions[declarations] - 1,
            rewards[declarations] + env.options.delay_cost > 0.0,
            modes[declarations],
        )


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
    inputs: ClassVar[Any] = staticmethod(row_inputs)
    """Returns arrays (n, ...) that the loss needs, from rows (n, width) and the tick [s]."""

    def make_env(self, **changes: Any) -> HybridTrackVectorEnv:
        """Return the environment of a round, with some changed options."""
        options = vars(self.world) | changes
        return HybridTrackVectorEnv(
            self.settings.n_envs,
            tick_info=False,
            **options,
        )

    def build(self) -> None:
        """Create network, optimizer and environment."""
        task = task_of(self.env_id, self.options)
        self.world = task.options
        if not task.waits or self.world.actions != "all":
            raise ArgumentError(f"env={self.env_id}: expected one in which hypotheses are declared")
        self.env = self.make_env()
        torch.manual_seed(self.seed)
        self.net = self.decider.network(self.settings.hidden)
        self.start(self.net, self.settings.learning_rate)

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        # Episodes of training begin at 10^12, 10^9 apart for each training seed.
        first = 10**12 + self.seed * 10**9 + self.rounds * self.settings.n_envs
        generator = np.random.default_rng(first)
        world = self.env.options
        found = Explorer(self.decider(self.net, world), generator).segments(
            self.env,
            first,
        )
        lengths, labels = found.lengths, self.labels(found)
        inputs = self.inputs(found.rows, world.tau)
        begins = lengths.cumsum() - lengths
        order = generator.permutation(lengths.size)
        losses = []
        self.set_learning_rate()
        for start in range(
            0,
            lengths.size,
            self.settings.batch_size,
        ):
            chosen = order[start : start + self.settings.batch_size]
            pairs = zip(
                begins[chosen],
                lengths[chosen],
                strict=True,
            )
            rows = np.concatenate([np.arange(n) + begin for begin, n in pairs])
            loss = self.loss(
                [torch.from_numpy(part[rows]) for part in inputs],
                torch.from_numpy(lengths[chosen]),
                *(
                    torch.from_numpy(label[rows if len(label) == len(found.rows) else chosen])
                    for label in labels
                ),
            )
            self.optimizer.zero_grad(set_to_none=False)
            loss.backward()
            nn.utils.clip_grad_norm_(self.net.parameters(), 1.0)
            self.optimizer.step()
            losses.append(float(loss.detach()))
        ticks = float(lengths.mean())
        reward = 2.0 * float(found.rewarded.mean()) - 1.0 - self.world.delay_cost * ticks
        return len(found.rows), reward, ticks, {"loss": float(np.mean(losses))}

    def labels(self, found: Segments) -> tuple[NDArray[Any], ...]:
        """Return what the loss needs of each segment, arrays (S, ...), or of each row, (n, ...):
        the true modes.
        """
        return (found.modes,)

    @abstractmethod
    def loss(self, inputs: list[Tensor], lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the loss of S segments with n rows, one segment after the other.

        Args:
            inputs: those of the rows (n, ...), see `inputs`.
            lengths: (S,) of the segments.
            labels: those of the segments or rows.
        """
