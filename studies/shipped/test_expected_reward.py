"""The expected reward of random statements, and the simulated tracks that it is trained on."""

import itertools

import numpy as np
import pytest
import torch

from agents import StatementOutputs
from baselines import Statements, measure_statements
from studies.shipped.expected_reward import StatementBatch, change_probabilities, expected_reward


def random_outputs(ticks=4, tracks=2, M=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    utility = torch.randn(ticks, tracks, M, generator=generator, dtype=torch.float64)
    stay = torch.rand(ticks, tracks, generator=generator, dtype=torch.float64)
    return utility, stay, torch.randint(M, (ticks, tracks), generator=generator)


def reward_of(utility, stay, true_modes, cost, last=None, weight=1.0):
    """The expected reward of outputs, with a cost and a weight for all ticks or (T, N)."""
    outputs = StatementOutputs(utility, stay, utility, torch.empty(0))
    costs, weights = (torch.as_tensor(factor).expand(true_modes.shape) for factor in (cost, weight))
    return expected_reward(
        outputs, StatementBatch(torch.empty(0), utility, true_modes, costs, weights), last
    )


def test_the_expected_reward_is_the_mean_over_all_sequences_of_statements():
    utility, stay, true_modes = random_outputs()
    change = change_probabilities(utility, stay)
    first = torch.softmax(utility[0], -1)
    expected, last = reward_of(utility, stay, true_modes, 5.0)
    for track in range(2):
        total = 0.0
        ends = np.zeros(3)
        for sequence in itertools.product(range(3), repeat=4):
            probability = float(first[track, sequence[0]])
            for tick in range(1, 4):
                probability *= float(change[tick, track, sequence[tick - 1], sequence[tick]])
            stated = np.array(sequence)[:, None]
            reward = measure_statements(
                Statements(true_modes[:, track, None].numpy(), stated), 5.0
            ).reward
            total += probability * reward[0]
            ends[sequence[-1]] += probability
        assert float(expected[track]) == pytest.approx(total, abs=1e-12)
        np.testing.assert_allclose(last[track], ends, atol=1e-12)


def test_the_reward_of_a_tick_has_its_weight_and_its_cost():
    utility, stay, true_modes = random_outputs(ticks=3)
    each = [
        reward_of(utility, stay, true_modes, cost, None, only)[0]
        for cost, only in zip((2.0, 0.5, 4.0), torch.eye(3)[..., None], strict=True)
    ]
    costs = torch.tensor([2.0, 0.5, 4.0])[:, None].expand(3, 2)
    weights = torch.tensor([0.0, 2.0, 1.0])[:, None].expand(3, 2)
    whole, _ = reward_of(utility, stay, true_modes, costs, None, weights)

    torch.testing.assert_close(whole, 2.0 * each[1] + each[2])
