"""The expected reward of random statements, as a differentiable function of their probabilities.

Statements change neither the object nor the bank. The probabilities of the statements of a tick therefore
follow from those of the last tick as in a Markov chain, and the expected reward needs no sampled actions.
"""

from collections.abc import Iterator
from typing import NamedTuple

import torch
from torch import Tensor, nn

from agents.learned.statement_net import StatementOutputs


class Batch(NamedTuple):
    """T ticks of N tracks, of which an agent states the mode.

    Attributes:
        inputs: (T, N, M - 1, inputs) of the network.
        log_probability: (T, N, M) of the modes in the filters.
        true_modes: (T, N).
        change_cost: (T, N) cost of a change to a wrong mode.
        weight: (T, N) of the reward of each tick.
    """

    inputs: Tensor
    log_probability: Tensor
    true_modes: Tensor
    change_cost: Tensor
    weight: Tensor

    def split(self, ticks: int) -> Iterator["Batch"]:
        """Divide it into parts of `ticks` ticks; the last one may be shorter."""
        return (Batch(*parts) for parts in zip(*(part.split(ticks) for part in self), strict=True))


def change_probabilities(utility: Tensor, stay: Tensor) -> Tensor:
    """Return the probabilities (T, N, M, M) of the next statement (last axis) given the last one.

    Args:
        utility: (T, N, M) of stating a mode.
        stay: (T, N) added where the statement is kept.
    """
    kept = stay[..., None, None] * torch.eye(utility.shape[-1])
    return torch.softmax(utility[..., None, :] + kept, -1)


def expected_reward(outputs: StatementOutputs, batch: Batch, last: Tensor | None) -> tuple[Tensor, Tensor]:
    """Return the expected mean reward of a tick (N,), and the probabilities of the last statement (N, M).

    Args:
        outputs: of the network on the batch.
        batch: the ticks.
        last: (N, M) probabilities of the statement before the first tick; None where an episode begins.
    """
    utility = outputs.utility
    M = utility.shape[-1]
    change = change_probabilities(utility, outputs.stay)
    right = nn.functional.one_hot(batch.true_modes, M).to(utility.dtype)
    to_wrong = (1.0 - torch.eye(M)) * (1.0 - right)[..., None, :]
    wrong_changes = (change * to_wrong).sum(-1)
    probability = torch.softmax(utility[0], -1) if last is None else last
    before, after = [], []
    for tick, matrix in enumerate(change.unbind(0)):
        if tick == 0 and last is None:  # the first statement is no change
            before.append(torch.zeros_like(probability))
        else:
            before.append(probability)
            probability = torch.bmm(probability[:, None], matrix)[:, 0]
        after.append(probability)
    stated, previous = torch.stack(after), torch.stack(before)
    reward = (stated * right).sum(-1) - batch.change_cost * (previous * wrong_changes).sum(-1)
    return (batch.weight * reward).mean(0), probability


def cross_entropy(outputs: StatementOutputs, batch: Batch) -> Tensor:
    """Return the weighted mean cross-entropy of the present mode."""
    beliefs = outputs.belief.flatten(0, 1)
    each = nn.functional.cross_entropy(beliefs, batch.true_modes.flatten(), reduction="none")
    return (batch.weight.flatten() * each).mean()
