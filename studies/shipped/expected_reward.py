"""Base class of the algorithms that train agents which state a mode at every tick, on their
expected reward.

Every round simulates new tracks or flights in batches. Each batch is divided into parts of some
ticks, and one step of the optimizer is made for every part.

Statements change neither the object nor the bank. The probabilities of the statements of a tick
therefore follow from those of the last tick as in a Markov chain: the expected reward is a
differentiable function of them, and needs no sampled actions.
"""

import math
from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
import torch
from annotated_types import Ge
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import NetworkAlgorithm, NetworkSettings, StatementOutputs, UtilityDecider


@dataclass(frozen=True, kw_only=True)
class ExpectedRewardSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on its expected reward; base class."""

    # Ticks of an update; gradients do not reach back beyond its first tick.
    n_steps: Annotated[int, Ge(1)]
    # Weight of the cross-entropy of the present mode, in addition to the reward.
    belief_weight: Annotated[float, Ge(0.0)]


class StatementBatch(NamedTuple):
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

    def split(self, ticks: int) -> Iterator["StatementBatch"]:
        """Divide it into parts of `ticks` ticks; the last one may be shorter."""
        return (
            StatementBatch(*parts)
            for parts in zip(*(part.split(ticks) for part in self), strict=True)
        )


def change_probabilities(utility: Tensor, stay: Tensor) -> Tensor:
    """Return the probabilities (T, N, M, M) of the next statement (last axis) given the last one.

    The utility (T, N, M) is that of stating a mode; `stay` (T, N) is added where the statement is
    kept.
    """
    kept = stay[..., None, None] * torch.eye(utility.shape[-1])
    return torch.softmax(utility[..., None, :] + kept, -1)


def expected_reward(
    outputs: StatementOutputs, batch: StatementBatch, last: Tensor | None
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
    # The first statement is no change.
    before = torch.zeros_like(probability) if last is None else last
    every = []
    for tick, matrix in enumerate(change.unbind(0)):
        if tick or last is not None:
            probability = torch.bmm(probability[:, None], matrix)[:, 0]
        every.append(probability)
    stated = torch.stack(every)
    previous = torch.cat([before[None], stated[:-1]])
    reward = (stated * right).sum(-1) - batch.change_cost * (previous * wrong_changes).sum(-1)
    return (batch.weight * reward).mean(0), probability


def cross_entropy(outputs: StatementOutputs, batch: StatementBatch) -> Tensor:
    """Return the weighted mean cross-entropy of the present mode."""
    beliefs = outputs.belief.flatten(0, 1)
    each = nn.functional.cross_entropy(beliefs, batch.true_modes.flatten(), reduction="none")
    return (batch.weight.flatten() * each).mean()


class ExpectedRewardAlgorithm(NetworkAlgorithm):
    """Trains on the expected reward; the subclasses simulate what it trains on.

    Between two rounds no tracks have to be saved.
    """

    decider: ClassVar[type[UtilityDecider]]
    # An `ExpectedRewardSettings`.
    settings: Any
    # Steps of a round, which `prepare` sets.
    round_steps: int
    # Steps of the optimizer so far.
    updates: int = 0

    @abstractmethod
    def batches(self) -> Iterator[StatementBatch]:
        """Simulate the batches of the next round."""

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        parts = zip(*map(self._train_on, self.batches()), strict=True)
        reward, entropy = (float(np.mean(values)) for values in parts)
        metrics = {"expected_reward": reward, "cross_entropy": entropy}
        return self.round_steps, reward, math.nan, metrics

    def _train_on(self, batch: StatementBatch) -> NDArray[np.float64]:
        """Make one step of the optimizer for each part; return the means of reward and
        cross-entropy.
        """
        memory = last = None
        totals = np.zeros(2)
        parts = list(batch.split(self.settings.n_steps))
        for part in parts:
            self.set_learning_rate()
            outputs = self.network(part.inputs, part.log_probability, memory)
            reward, last = expected_reward(outputs, part, last)
            entropy = cross_entropy(outputs, part)
            loss = self.settings.belief_weight * entropy - reward.mean()
            self.improve(loss, 0.5, self.network)
            self.updates += 1
            memory, last = outputs.memory.detach(), last.detach()
            totals += float(reward.detach().mean()), float(entropy.detach())
        return totals / len(parts)
