"""The agent that learns from rewards alone."""

import numpy as np
import pytest
import torch
from small_training import small_run

from agents.learned.reward_decider import RewardDecider
from agents.learned.reward_net import RewardNet, reward_inputs
from agents.training.recipe import load_recipe
from agents.training.reward import Explorer, record
from agents.training.runs import make_run
from baselines import MSPRTDecider
from baselines.rules.msprt import mode_types
from baselines.rules.rollout import evaluate
from hybrid_env import Layout, WorldOptions

ENV = "hybrid_env:HybridTrack-v0"


def test_training_for_seconds_earns_more_than_the_bank_it_starts_from():
    recipe = load_recipe("reward", ENV, ("n_envs=32", "hidden=32", "batch_size=32"))
    run = make_run(ENV, {}, recipe, seed=1, steps=150_000)
    start = RewardDecider(RewardNet(8), run.world, 0.03)
    bank, before = (evaluate(one, episodes=100, seed=5) for one in (MSPRTDecider(0.03), start))
    np.testing.assert_array_equal(bank.ticks, before.ticks)
    run.train()
    gain = evaluate(run.family("").make(0.03), episodes=100, seed=5).reward - before.reward
    assert gain.mean() > 3.0 * gain.mean(1).std() / np.sqrt(len(gain)) > 0.0


@pytest.mark.parametrize("options", [{}, {"radii": (2.0, 5.0), "correctness": "type"}])
def test_segments_hold_what_the_agent_saw_and_one_reward_each(options):
    run = make_run(ENV, options, load_recipe("reward", ENV, ("n_envs=6", "hidden=8", "random_declarations=0.5")))
    torch.nn.init.normal_(run.net.output.weight, std=0.5)
    explorer = Explorer(run.net, run.world, run.settings, np.random.default_rng(1))
    segments = record(run.env, explorer, 5)
    assert len(segments.declared) == 6 * run.world.segments
    ticks = Layout.of_rows(segments.rows).read(segments.rows, "ticks").round()
    lengths = np.diff(segments.ends, prepend=0)
    np.testing.assert_array_equal(ticks, np.concatenate([np.arange(n) + 1 for n in lengths]))
    assert 0.4 < segments.rewarded.mean() < 0.95
    # the probabilities of whole segments, as in training, equal those of one row after the other
    inputs, logs = map(torch.from_numpy, reward_inputs(segments.rows, run.world.tau))
    state, losses = None, []
    for k, end in enumerate(segments.ends):
        for row in segments.rows[end - lengths[k] : end]:
            posterior, state = explorer.posterior(row[None], state, None)
            losses.append(posterior[0])
        kinds = mode_types(posterior.size) if options else np.arange(posterior.size)
        rewarded = kinds == kinds[segments.declared[k]]
        target = np.maximum(posterior[0], 1e-9) * (rewarded == segments.rewarded[k])
        losses[-lengths[k] :] = [-(target / target.sum()) @ np.log(p) for p in losses[-lengths[k] :]]
    arrays = (torch.from_numpy(part) for part in (lengths, segments.declared, segments.rewarded))
    np.testing.assert_allclose(float(run.loss(inputs, logs, *arrays).detach()), np.mean(losses), rtol=1e-4)


def test_only_the_last_row_learns_without_every_row():
    run = small_run("reward", steps=200, more=("every_row=false",))
    run.train()
    assert run.num_timesteps >= 200
    assert RewardDecider(run.net, WorldOptions()).predict(np.zeros((2, 28), np.float32))[0].shape == (2,)
