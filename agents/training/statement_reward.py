"""The expected reward of random statements, as a differentiable function of their probabilities.

Statements change neither the object nor the bank. The probabilities of the statements of a tick therefore
follow from those of the last tick as in a Markov chain, and the expected reward needs no sampled actions.
"""

import torch
from torch import Tensor, nn


def change_probabilities(utility: Tensor, stay: Tensor) -> Tensor:
    """Return the probabilities (T, N, M, M) of the next statement (last axis) given the last one.

    Args:
        utility: (T, N, M) of stating a mode.
        stay: (T, N) added where the statement is kept.
    """
    kept = stay[..., None, None] * torch.eye(utility.shape[-1])
    return torch.softmax(utility[..., None, :] + kept, -1)


def expected_reward(
    utility: Tensor,
    stay: Tensor,
    true_modes: Tensor,
    change_cost: float | Tensor,
    last: Tensor | None,
    weight: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Return the expected mean reward of a tick (N,), and the probabilities of the last statement (N, M).

    Args:
        utility, stay: see `change_probabilities`.
        true_modes: (T, N).
        change_cost: cost of a change to a wrong mode, a number or (T, N).
        last: (N, M) probabilities of the statement before the first tick; None where an episode begins.
        weight: (T, N) of the reward of each tick; None for 1.
    """
    M = utility.shape[-1]
    change = change_probabilities(utility, stay)
    right = nn.functional.one_hot(true_modes, M).to(utility.dtype)
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
    reward = (stated * right).sum(-1) - change_cost * (previous * wrong_changes).sum(-1)
    return (reward if weight is None else weight * reward).mean(0), probability
