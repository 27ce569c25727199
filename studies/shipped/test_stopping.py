"""Training of the learned stop."""

import numpy as np
import pytest
import torch

from agents import load_recipe
from agents.training.runs import make_run
from baselines.rules.rollout import record_decisions
from hybrid_env import ArgumentError
from studies.shipped.stopping import expected_reward, paths_of
from studies.shipped.test_shipped import KINDS, small_run

ENV = "hybrid_env:HybridTrackPublished-v0"
ALONE = (
    "drawn_worlds=[]",
    "worlds=[{n_envs: 12}]",
    "batch_size=12",
    "passes=4",
    "delay_costs=[0.1, 0.1]",
)


def test_the_expected_reward_is_the_sum_over_all_ticks_of_the_declaration():
    generator = np.random.default_rng(0)
    logits, rewards = generator.normal(size=(2, 3, 7))
    lengths = np.array([7, 4, 1])
    expected = []
    for k, length in enumerate(lengths):
        left = 1.0
        total = 0.0
        for t in range(length):
            stops = 1.0 if t == length - 1 else 1.0 / (1.0 + np.exp(-logits[k, t]))
            total += left * stops * rewards[k, t]
            left *= 1.0 - stops
        expected.append(total)
    waits = np.arange(7) < lengths[:, None] - 1
    computed = expected_reward(*map(torch.from_numpy, (logits, rewards, waits)))

    np.testing.assert_allclose(computed, expected, rtol=1e-12)


def test_a_segment_that_runs_on_knows_what_each_declaration_earns():
    run = make_run(ENV, {"follow": "bank"}, load_recipe("studies/shipped/stopping.yml", ENV, ALONE))
    [explorer] = run.explorers(np.random.default_rng(1))
    inputs, rewards, lengths = paths_of(explorer)

    assert len(inputs) == len(rewards) == lengths.sum()
    # Half of 72.
    assert 10 < lengths.size < 62
    assert ((lengths >= 50) & (lengths <= 100)).all()
    ticks = np.concatenate([np.arange(length) + 1 for length in lengths])
    declared = rewards + run.world.delay_cost * ticks
    np.testing.assert_allclose(np.abs(declared), 1.0, atol=1e-5)
    assert declared[ticks > 40].mean() > 0.9 > declared[ticks < 5].mean()


def test_training_of_the_stop_leaves_the_anchor_agent_as_it_is():
    run = small_run("stopping", steps=700, kinds=KINDS)
    before = {name: tensor.clone() for name, tensor in run.network.state_dict().items()}
    run.train()
    after = run.network.state_dict()
    changed = [name for name in after if not torch.equal(after[name], before[name])]

    assert changed
    assert all("stopping" in name for name in changed)


def test_factors_change_numbers_among_the_options_within_their_bounds():
    changes = ("factors={speed: [0.5, 2.0], initial_error: [0.1, 0.2]}", *ALONE)
    run = make_run(ENV, {}, load_recipe("studies/shipped/stopping.yml", ENV, changes))
    generator = np.random.default_rng(2)
    drawn = [run.changed_world(run.world, generator) for _ in range(60)]
    speeds = {world.speed for world in drawn} - {run.world.speed}

    assert 30 < len(speeds) < 60
    assert 1.0 <= min(speeds) < 1.3 < 3.0 < max(speeds) <= 4.0
    for world in drawn:
        position, velocity = np.divide(world.initial_error, run.world.initial_error)
        assert position == pytest.approx(velocity)
        assert position == 1.0 or 0.1 <= position <= 0.2


@pytest.mark.parametrize("name", ["noise", "object_variance", "sped"])
def test_factors_are_for_options_that_are_numbers(name):
    changes = (f"factors={{{name}: [0.5, 2.0]}}", *ALONE)
    with pytest.raises(ArgumentError, match=f"factors={name}"):
        make_run(ENV, {}, load_recipe("studies/shipped/stopping.yml", ENV, changes))


@pytest.mark.study
def test_the_stop_is_trained_for_a_delay_cost():
    run = make_run(
        ENV,
        {"delay_cost": 0.1},
        load_recipe("studies/shipped/stopping.yml", ENV, ALONE),
        seed=1,
        steps=60_000,
    )
    # Training goes on from a stop that is good already.
    for layer in run.network.stopping.modules():
        if isinstance(layer, torch.nn.Linear):
            layer.reset_parameters()
    rewards = []
    for train in (lambda: None, run.train):
        train()
        decisions = record_decisions(run.agent("").at(0.0), ENV, 100, 5, delay_cost=0.1)
        rewards.append(decisions.reward)
    gain = rewards[1] - rewards[0]

    assert gain.mean() > 4.0 * gain.mean(1).std() / np.sqrt(len(gain)) > 0.0
