"""Training of the agents that state a mode at every tick, on their expected reward.

Every round simulates new tracks or flights in batches. Each batch is divided into parts of some
ticks, and one step of the optimizer is made for every part.

Statements change neither the object nor the bank. The probabilities of the statements of a tick
therefore follow from those of the last tick as in a Markov chain: the expected reward is a
differentiable function of them, and needs no sampled actions.

A round of simulated tracks is determined by its number, so that a checkpoint between two rounds
needs no other state than the network and its optimizer.
"""

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.evaluation.tasks import task_of
from agents.learned.jump_markov_net import JumpMarkovDecider, track_inputs
from agents.learned.rhythm_decider import RhythmDecider
from agents.learned.statement_decider import StatementDecider, UtilityDecider
from agents.learned.statement_net import StatementOutputs, count_ages, statement_inputs
from agents.training.run import OwnNetworkRun, Round
from agents.training.settings import StatementSettings
from baselines.recordings.log_uniform import log_uniform
from baselines.recordings.simulators.inexact import draw_told, inexact_travel
from baselines.recordings.simulators.process_noise import FACTORS
from baselines.recordings.simulators.tracks import GivenTracks
from baselines.rules import seeds
from baselines.rules.measurements import OBSERVED
from hybrid_env.checks import reject
from hybrid_env.durations import DRAWN
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv

# Norm.
LARGEST_GRADIENT = 0.5


class Batch(NamedTuple):
    """T ticks of N tracks, of which an agent states the mode."""

    # (T, N, M - 1, inputs) of the network.
    inputs: Tensor
    # (T, N, M) of the modes in the filters.
    log_probability: Tensor
    # (T, N)
    true_modes: Tensor
    # (T, N) cost of a change to a wrong mode.
    change_cost: Tensor
    # (T, N) of the reward of each tick.
    weight: Tensor

    def split(self, ticks: int) -> Iterator["Batch"]:
        """Divide it into parts of `ticks` ticks; the last one may be shorter."""
        return (Batch(*parts) for parts in zip(*(part.split(ticks) for part in self), strict=True))


def change_probabilities(utility: Tensor, stay: Tensor) -> Tensor:
    """Return the probabilities (T, N, M, M) of the next statement (last axis) given the last one.

    The utility (T, N, M) is that of stating a mode; `stay` (T, N) is added where the statement is
    kept.
    """
    kept = stay[..., None, None] * torch.eye(utility.shape[-1])
    return torch.softmax(utility[..., None, :] + kept, -1)


def expected_reward(
    outputs: StatementOutputs,
    batch: Batch,
    last: Tensor | None,
) -> tuple[Tensor, Tensor]:
    """Return the expected mean reward of a tick (N,), and the probabilities of the last
    statement (N, M).

    `last` are those of the statement before the first tick; None where an episode begins.
    """
    utility = outputs.utility
    M = utility.shape[-1]
    change = change_probabilities(utility, outputs.stay)
    right = nn.functional.one_hot(batch.true_modes, M).to(utility.dtype)
    to_wrong = (1.0 - torch.eye(M)) * (1.0 - right)[..., None, :]
    wrong_changes = (change * to_wrong).sum(-1)
    probability = torch.softmax(utility[0], -1) if last is None else last
    before = []
    after = []
    for tick, matrix in enumerate(change.unbind(0)):
        # The first statement is no change.
        if tick == 0 and last is None:
            before.append(torch.zeros_like(probability))
        else:
            before.append(probability)
            probability = torch.bmm(probability[:, None], matrix)[:, 0]
        after.append(probability)
    stated = torch.stack(after)
    previous = torch.stack(before)
    reward = (stated * right).sum(-1) - batch.change_cost * (previous * wrong_changes).sum(-1)
    return (batch.weight * reward).mean(0), probability


def cross_entropy(outputs: StatementOutputs, batch: Batch) -> Tensor:
    """Return the weighted mean cross-entropy of the present mode."""
    beliefs = outputs.belief.flatten(0, 1)
    each = nn.functional.cross_entropy(beliefs, batch.true_modes.flatten(), reduction="none")
    return (batch.weight.flatten() * each).mean()


class StatementRun(OwnNetworkRun):
    """A training run on the expected reward; see `agents.training.runs.make_run` for the arguments.

    Base class; the subclasses simulate what it trains on. Between two rounds no tracks have to be
    saved.
    """

    decider: ClassVar[type[UtilityDecider]]
    # An `ExpectedRewardSettings`.
    settings: Any
    # Steps of a round.
    round_steps: int
    # Options of the environment of the agent, None if it has none.
    world: QuickestOptions | None = None

    def build(self) -> None:
        """Create network and optimizer."""
        # Steps of the optimizer so far.
        self.updates = 0
        self.prepare()
        torch.manual_seed(self.seed)
        self.net = self.decider.network(self.settings.hidden)
        self.start(self.net, self.settings.learning_rate)

    @abstractmethod
    def prepare(self) -> None:
        """Check what is to be simulated, and set `round_steps`."""

    @abstractmethod
    def batches(self) -> Iterator[Batch]:
        """Simulate the batches of the next round."""

    def restore_values(self, values: dict[str, Any]) -> None:
        if self.num_timesteps % self.round_steps:
            raise ValueError("the number of steps is not one of complete rounds")

    def train_round(self) -> Round:
        rewards, entropies = zip(*map(self._train_on, self.batches()), strict=True)
        reward = float(np.mean(rewards))
        metrics = {"expected_reward": reward, "cross_entropy": float(np.mean(entropies))}
        return self.round_steps, reward, math.nan, metrics

    def _train_on(self, batch: Batch) -> tuple[float, float]:
        """Make one step of the optimizer for each part; return the means of reward and
        cross-entropy.
        """
        memory = last = None
        totals = np.zeros(2)
        parts = list(batch.split(self.settings.n_steps))
        for part in parts:
            self.set_learning_rate()
            outputs = self.net(part.inputs, part.log_probability, memory)
            reward, last = expected_reward(outputs, part, last)
            entropy = cross_entropy(outputs, part)
            loss = (
                self.settings.belief_weight * entropy
                - reward.mean()
                + self.further_loss(outputs, part)
            )
            self.optimizer.zero_grad(set_to_none=False)
            loss.backward()
            nn.utils.clip_grad_norm_(self.net.parameters(), LARGEST_GRADIENT)
            self.optimizer.step()
            self.updates += 1
            memory, last = outputs.memory.detach(), last.detach()
            totals += float(reward.detach().mean()), float(entropy.detach())
        mean: NDArray[np.float64] = totals / len(parts)
        return float(mean[0]), float(mean[1])

    def further_loss(self, outputs: StatementOutputs, batch: Batch) -> Tensor | float:
        """Return what is added to the loss of a part."""
        return 0.0


# Range of the bank's hazard where the law of the durations is drawn.
HAZARDS = 1 / 160, 1 / 30
# Tracks x ticks x turns, whose inputs take half a gigabyte.
LARGEST_ROUND = 2**22


class TrackRun(StatementRun):
    """A training run on simulated tracks; it refuses an environment in which modes are not
    stated.
    """

    decider: ClassVar[type[UtilityDecider]] = StatementDecider
    smallest_factor: ClassVar[float] = 0.01
    settings: StatementSettings

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """Return inputs, log-probabilities and true modes of one episode of each track; see
        `simulate`.
        """
        assert issubclass(self.decider, StatementDecider)
        return simulate(world, tracks, seed, self.decider(self.net, world), inexact)

    def prepare(self) -> None:
        task = task_of(self.env_id, self.options)
        if task.switches != self.decider.task:
            raise reject(
                "env",
                self.env_id,
                "an environment in which a mode is stated at every tick",
            )
        self.world: QuickestOptions = task.options
        world = self.world
        if self.settings.inexact:
            if self.decider.observes != "rows":
                raise reject(
                    "inexact",
                    self.settings.inexact,
                    "0 for an agent that does not read rows",
                )
            for name in ("noise", "missed", "sensors", "object_variance", "start"):
                if getattr(world, name) != getattr(QuickestOptions(), name):
                    raise reject(name, getattr(world, name), "the default with the setting inexact")
        self._laws = *self.settings.durations, *([None] * self.settings.inexact)
        self._round_tracks = len(self._laws) * self.settings.n_envs
        self._ticks = world.ticks if self.settings.ticks is None else self.settings.ticks
        if self._round_tracks * self._ticks * (world.hypotheses - 1) > LARGEST_ROUND:
            allowed = f"n_envs x environments x ticks x (M - 1) of at most {LARGEST_ROUND:,}"
            raise reject("n_envs", self.settings.n_envs, allowed)
        self.round_steps = self._round_tracks * self._ticks

    def batches(self) -> Iterator[Batch]:
        """Simulate the tracks of a round, and divide them at random."""
        number = self.num_timesteps // self.round_steps
        first = seeds.TRAINING + self.seed * 10**9 + number * self._round_tracks
        generator = np.random.default_rng(first)
        count = self.settings.n_envs
        parts = [
            self.simulate(self._draw_world(generator, law), count, first + k * count, law is None)
            for k, law in enumerate(self._laws)
        ]
        arrays = [
            torch.from_numpy(np.concatenate(part, axis=1)) for part in zip(*parts, strict=True)
        ]
        order = generator.permutation(self._round_tracks)
        for start in range(0, len(order), self.settings.batch_size):
            inputs, logs, modes = (
                array[:, order[start : start + self.settings.batch_size]] for array in arrays
            )
            costs = torch.full(modes.shape, self.world.change_cost)
            yield Batch(inputs, logs, modes, costs, torch.ones(modes.shape))

    def _draw_world(self, generator: np.random.Generator, law: str | None) -> QuickestOptions:
        if law is None:
            return draw_told(generator, replace(self.world, ticks=self._ticks))
        variance, radius = (
            log_uniform(generator, *one) for one in (self.settings.variances, self.settings.radii)
        )
        variances = tuple(variance * self.world.variances)
        habits: dict[str, Any] = {"durations": law}
        # The bank's hazard follows from the law, which is then unknown.
        if law == DRAWN:
            hazard = float(log_uniform(generator, *HAZARDS))
            habits |= {"order": DRAWN, "hazard": min(hazard, 1.0 - 1.0 / self.world.hypotheses)}
        return replace(
            self.world,
            **habits,
            ticks=self._ticks,
            measurement_variance=variances if len(variances) == 2 else variances[0],
            radii=tuple(radius * np.array(self.world.radii)),
        )


class RhythmRun(TrackRun):
    """A training run of the agent that learns habits within the episode."""

    decider = RhythmDecider


class JumpMarkovRun(TrackRun):
    """A training run of the jump-Markov net on the tracks of `TrackRun`, without their true
    states.
    """

    decider = JumpMarkovDecider

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """See `TrackRun.simulate`; the inputs are (T, N, 6 + M - 1), see `track_inputs`."""
        env = make_tracks(world, tracks, inexact)
        env.reset(seed=seed)
        decider = JumpMarkovDecider(self.net, world)
        seen = []
        modes = []
        for _ in range(world.ticks):
            seen.append(decider.observe(env.world))
            modes.append(env.world.field("true_mode").astype(np.int64))
            env.step(np.zeros(tracks, np.int64))
        logs = np.array(seen, np.float32)[..., OBSERVED : OBSERVED + world.hypotheses]
        return np.array([track_inputs(world, one) for one in seen]), logs, np.array(modes)

    def further_loss(self, outputs: StatementOutputs, batch: Batch) -> Tensor | float:
        """Return the mean negative log-likelihood of a measurement by the filter of the true
        mode.
        """
        assert outputs.logs is not None
        return -outputs.logs.gather(-1, batch.true_modes[..., None]).mean()


def make_tracks(world: QuickestOptions, tracks: int, inexact: bool) -> Any:
    """Return a vector environment; `inexact` objects move otherwise than told, with rows of the
    likeliest noise.
    """
    if inexact:
        return GivenTracks(inexact_travel, world, tracks, FACTORS)
    return HybridTrackQuickestVectorEnv(
        tracks,
        autoreset_mode="Disabled",
        tick_info=False,
        **vars(world),
    )


def simulate(
    world: QuickestOptions,
    tracks: int,
    seed: int,
    decider: StatementDecider | None = None,
    inexact: bool = False,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Return inputs (T, N, M - 1, k), log-probabilities (T, N, M) and true modes (T, N) of one
    episode each.

    The inputs are those of the network of a decider, by default a `StatementDecider`; the network
    is not used. inexact: whether objects move otherwise than told, see `make_tracks`.
    """
    if decider is None:
        decider = StatementDecider(StatementDecider.network(1), world)
    env = make_tracks(world, tracks, inexact)
    rows, _ = env.reset(seed=seed)
    all_rows = np.empty((world.ticks, *rows.shape), np.float32)
    log_probability = np.empty((world.ticks, tracks, world.hypotheses), np.float32)
    true_modes, ages = (np.empty((world.ticks, tracks), np.int64) for _ in range(2))
    best = np.full(tracks, -1)
    age = np.zeros(tracks, np.int64)
    statement = np.zeros(tracks, np.int64)
    more: list[NDArray[np.float32]] = []
    filters = None
    starts = np.zeros(tracks, np.bool_)
    for tick in range(world.ticks):
        all_rows[tick], true_modes[tick] = rows, env.world.field("true_mode")
        _, seen = decider.divide(rows if decider.observes == "rows" else decider.observe(env.world))
        bank = decider.layout.read(rows, "log_probability")
        log_probability[tick], further, filters = decider.filtered(bank, seen, filters, starts)
        if further is not None:
            more.append(further)
        previous, best = best, bank.argmax(-1)
        ages[tick] = age = count_ages(best, previous, age)
        # Statements change only columns that the network does not read.
        rows, *_ = env.step(statement)
    inputs = statement_inputs(world, all_rows, ages, np.stack(more) if more else None)
    return inputs, log_probability, true_modes
