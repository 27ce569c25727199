"""Training on the expected reward: the reward itself, seeds, settings and resuming."""

import itertools

import numpy as np
import pytest
import torch

from agents.training.recipe import load_recipe, recipe_of
from agents.training.runs import make_run, resume_run
from agents.training.expected_reward import change_probabilities, expected_reward
from agents.training.simulated_tracks import simulate
from baselines import Statements, measure_statements
from hybrid_env import QuickestOptions

ENV = "hybrid_env:HybridTrackQuickest-v0"
OPTIONS = {"ticks": 40, "durations": "uniform 5-20"}
SMALL = load_recipe(
    "statements",
    ENV,
    ("n_envs=8", "batch_size=16", "n_steps=16", "hidden=6", "durations=[uniform 5-20, geometric 30]"),
)
ROUND = 2 * 8 * 40


def random_outputs(ticks=4, tracks=2, M=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    utility = torch.randn(ticks, tracks, M, generator=generator, dtype=torch.float64)
    stay = torch.rand(ticks, tracks, generator=generator, dtype=torch.float64)
    return utility, stay, torch.randint(M, (ticks, tracks), generator=generator)


def test_the_expected_reward_is_the_mean_over_all_sequences_of_statements():
    utility, stay, true_modes = random_outputs()
    change, first = change_probabilities(utility, stay), torch.softmax(utility[0], -1)
    expected, last = expected_reward(utility, stay, true_modes, 5.0, None)
    for track in range(2):
        total, ends = 0.0, np.zeros(3)
        for sequence in itertools.product(range(3), repeat=4):
            probability = float(first[track, sequence[0]])
            for tick in range(1, 4):
                probability *= float(change[tick, track, sequence[tick - 1], sequence[tick]])
            stated = np.array(sequence)[:, None]
            reward = measure_statements(Statements(true_modes[:, track, None].numpy(), stated), 5.0).reward
            total += probability * reward[0]
            ends[sequence[-1]] += probability
        assert float(expected[track]) == pytest.approx(total, abs=1e-12)
        np.testing.assert_allclose(last[track], ends, atol=1e-12)


def test_pieces_have_the_reward_of_the_whole():
    utility, stay, true_modes = random_outputs(ticks=10)
    whole, last = expected_reward(utility, stay, true_modes, 2.0, None)
    one, between = expected_reward(utility[:4], stay[:4], true_modes[:4], 2.0, None)
    other, end = expected_reward(utility[4:], stay[4:], true_modes[4:], 2.0, between)
    torch.testing.assert_close(whole, 0.4 * one + 0.6 * other)
    torch.testing.assert_close(end, last)


def test_the_reward_of_a_tick_has_its_weight_and_its_cost():
    utility, stay, true_modes = random_outputs(ticks=3)
    each = torch.stack(
        [
            3.0 * expected_reward(utility, stay, true_modes, cost, None, weight)[0]
            for cost, weight in zip((2.0, 0.5, 4.0), torch.eye(3)[..., None].expand(3, 3, 2), strict=True)
        ]
    )  # (3, N): the reward of each tick alone, with a cost of its own
    costs = torch.tensor([2.0, 0.5, 4.0])[:, None].expand(3, 2)
    weights = torch.tensor([0.0, 2.0, 1.0])[:, None].expand(3, 2)
    whole, _ = expected_reward(utility, stay, true_modes, costs, None, weights)
    torch.testing.assert_close(whole, (2.0 * each[1] + each[2]) / 3.0)


def test_simulated_inputs_count_the_ticks_of_the_most_probable_mode():
    inputs, log_probability, true_modes = simulate(QuickestOptions(**OPTIONS), 5, 0)
    assert inputs.shape == (40, 5, 2, 26)
    assert true_modes.shape == (40, 5)
    assert np.isfinite(inputs).all()
    ages = np.stack([inputs[..., 0, 6], inputs[..., 0, 14], inputs[..., 1, 14]], -1) * 100.0
    for track in range(5):
        ends = [(mode, tick) for mode, run in itertools.groupby(log_probability[:, track].argmax(-1))
                for tick, _ in enumerate(run, start=1)]  # fmt: skip
        expected = np.zeros((40, 3))
        for row, (mode, tick) in zip(expected, ends, strict=True):
            row[mode] = tick
        np.testing.assert_allclose(ages[:, track], expected, rtol=1e-5)


def trained(rounds, seed=0):
    run = make_run(ENV, OPTIONS, SMALL, seed, steps=rounds * ROUND)
    run.train()
    return run


def test_the_same_seed_gives_the_same_weights_and_another_one_does_not():
    nets = [trained(2, seed).net.state_dict() for seed in (1, 1, 2)]
    assert all(torch.equal(nets[0][name], nets[1][name]) for name in nets[0])
    assert not all(torch.equal(nets[0][name], nets[2][name]) for name in nets[0])


def test_training_increases_the_expected_reward():
    rewards = []
    run = make_run(ENV, OPTIONS, SMALL, 0, steps=40 * ROUND)
    run.train(lambda progress: rewards.append(progress.reward))
    assert np.mean(rewards[-10:]) > np.mean(rewards[:10])


def test_an_interrupted_run_resumes_between_two_rounds(tmp_path):
    def interrupt(progress):
        if progress.steps == 2 * ROUND:
            raise KeyboardInterrupt

    run = make_run(ENV, OPTIONS, SMALL, 0, tmp_path / "run", 4 * ROUND)
    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt, save_every=1e-9)
    resumed = resume_run(tmp_path / "run")
    assert resumed.num_timesteps == ROUND
    resumed.train()
    for name, tensor in trained(4).net.state_dict().items():
        assert torch.equal(resumed.net.state_dict()[name], tensor)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"durations": []}, "durations="),
        ({"durations": ["normal 3"]}, "durations="),
        ({"durations": "uniform 5-20"}, "durations="),
        ({"n_envs": 0}, "n_envs=0"),
        ({"n_envs": 10**6}, "n_envs=1000000"),
        ({"variances": [2.0, 1.0]}, "variances="),
        ({"variances": [1.0]}, "variances="),
        ({"radii": [0.0, 1.0]}, "radii="),
        ({"batch_size": 1.5}, "batch_size=1.5"),
        ({"n_steps": 0}, "n_steps=0"),
        ({"hidden": 10**6}, "hidden=1000000"),
        ({"learning_rate": 2.0}, "learning_rate=2.0"),
        ({"belief_weight": -1.0}, "belief_weight=-1.0"),
    ],
)
def test_invalid_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        recipe_of("mine", SMALL.as_json()["entry"] | arguments)


def test_an_environment_without_statements_is_refused():
    with pytest.raises(ValueError, match="env="):
        make_run("hybrid_env:HybridTrack-v0", {}, SMALL, steps=1)
