"""The agent that learns from rewards alone."""

import numpy as np
import pytest
import torch

from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from baselines import MSPRTDecider
from baselines.rules.msprt import mode_types
from baselines.rules.rollout import evaluate
from hybrid_env import Layout, WorldOptions
from studies.league import reward
from studies.league.families import recipe_file
from studies.league.reward import RewardDecider, RewardNet, reward_inputs

ENV = "hybrid_env:HybridTrackPublished-v0"


def test_an_untrained_agent_declares_as_the_bank():
    agent = RewardDecider(
        RewardNet(8),
        WorldOptions(),
        0.03,
    )
    bank, untrained = (
        evaluate(
            one,
            episodes=50,
            seed=5,
        )
        for one in (MSPRTDecider(0.03), agent)
    )

    np.testing.assert_array_equal(bank.ticks, untrained.ticks)


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0), "correctness": "type"},
    ],
)
def test_the_loss_of_whole_segments_is_that_of_one_row_after_the_other(options, monkeypatch):
    monkeypatch.setattr(
        reward,
        "RANDOM_DECLARATIONS",
        0.5,
    )
    run = make_run(
        ENV,
        options,
        load_recipe(
            recipe_file("reward"),
            ENV,
            ("n_envs=6", "hidden=8"),
        ),
    )
    torch.nn.init.normal_(
        run.net.output.weight,
        std=0.5,
    )
    agent = RewardDecider(run.net, run.world)
    rows, lengths, declared, rewarded, _ = reward.Explorer(
        agent,
        np.random.default_rng(1),
    ).segments(
        run.env,
        5,
    )

    assert len(declared) == 6 * run.world.segments
    ticks = Layout.of_rows(rows).read(rows, "ticks").round()
    np.testing.assert_array_equal(
        ticks,
        np.concatenate([np.arange(n) + 1 for n in lengths]),
    )
    assert 0.4 < rewarded.mean() < 0.95
    state = None
    losses = []
    for k, end in enumerate(lengths.cumsum()):
        for row in rows[end - lengths[k] : end]:
            posterior, state = agent.posterior(
                row[None],
                state,
                None,
            )
            losses.append(posterior[0])
        kinds = mode_types(posterior.size) if options else np.arange(posterior.size)
        possible = (kinds == kinds[declared[k]]) == rewarded[k]
        target = np.maximum(posterior[0], 1e-9) * possible
        losses[-lengths[k] :] = [
            -(target / target.sum()) @ np.log(p) for p in losses[-lengths[k] :]
        ]
    parts = *reward_inputs(rows, run.world.tau), lengths, declared, rewarded
    loss = run.loss(*map(torch.from_numpy, parts))
    np.testing.assert_allclose(
        float(loss.detach()),
        np.mean(losses),
        rtol=1e-4,
    )
