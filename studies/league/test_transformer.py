"""The transformer on measurements: causal, the loss, and what is learned in seconds."""

import numpy as np
import pytest
import torch

from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from baselines.rules.rollout import evaluate
from hybrid_env import Layout
from studies.league.families import recipe_file
from studies.league.reward import Explorer
from studies.league.transformer import RAW_INPUTS, TransformerDecider, raw_inputs

ENV = "hybrid_env:HybridTrackPublished-v0"


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0), "correctness": "type"},
    ],
)
def test_a_decision_after_every_row_is_that_of_whole_segments(options):
    run = make_run(
        ENV,
        options,
        load_recipe(
            recipe_file("transformer"),
            ENV,
            ("n_envs=6", "hidden=8"),
        ),
    )
    torch.nn.init.normal_(
        run.net.output[1].weight,
        std=0.5,
    )
    agent = TransformerDecider(run.net, run.world)
    found = Explorer(agent, np.random.default_rng(1)).segments(
        run.env,
        5,
    )
    parts = [
        torch.from_numpy(one)
        for one in (*raw_inputs(found.rows, run.world.tau), found.lengths, found.modes)
    ]

    assert parts[0].shape == (len(found.rows), run.world.hypotheses - 1, RAW_INPUTS)
    with torch.no_grad():
        whole = run.net(parts[0], parts[2])
    state = None
    for row, expected in zip(
        found.rows[:200],
        whole.exp().numpy(),
        strict=False,
    ):
        posterior, state = agent.posterior(
            row[None],
            state,
            None,
        )
        np.testing.assert_allclose(
            posterior[0],
            expected,
            atol=1e-4,
        )
    modes = np.repeat(found.modes, found.lengths)
    loss = -whole.numpy()[np.arange(len(modes)), modes].mean()
    assert float(run.loss(*parts).detach()) == pytest.approx(loss, rel=1e-4)


def test_a_mirrored_trajectory_gives_the_inputs_of_the_mirrored_turn_and_the_bank_is_not_read():
    layout = Layout(3)
    generator = np.random.default_rng(0)
    rows = generator.uniform(
        0.1,
        1.0,
        (5, layout.width),
    ).astype(np.float32)
    rows[:, layout.slices["previous"]] = np.eye(3, dtype=np.float32)[[0, 1, 2, 1, 0]]
    rows[:, layout.slices["curvature"]] = 0.0, 0.2, -0.2
    other = rows.copy()
    for name in (
        "log_ratio",
        "innovation_along",
        "innovation_across",
        "log_variance",
        "anchor_xx",
        "anchor_vv",
    ):
        other[:, layout.slices[name]] = 7.0
    other[:, layout.slices["displacement_across"]] *= -1.0
    other[:, layout.slices["previous"]] = other[:, layout.slices["previous"]][:, [0, 2, 1]]

    np.testing.assert_allclose(
        raw_inputs(other, 0.1)[0],
        raw_inputs(rows, 0.1)[0][:, ::-1],
    )


@pytest.mark.study
def test_training_for_seconds_earns_more_than_at_once():
    run = make_run(
        ENV,
        {},
        load_recipe(
            recipe_file("transformer"),
            ENV,
            ("n_envs=64", "hidden=16", "batch_size=32"),
        ),
        seed=1,
        steps=150_000,
    )
    run.train()
    # At once: -0.35.
    assert (
        evaluate(
            run.family("").make(0.1),
            episodes=100,
            seed=5,
        ).reward.mean()
        > 0.1
    )
