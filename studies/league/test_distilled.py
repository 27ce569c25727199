"""The shipped agent in a small network: what the teacher states, the loss, and what is learned
in seconds.
"""

import numpy as np
import pytest
import torch

from agents.evaluation.registry import find_family
from agents.training.recipe import load_recipe
from agents.training.runs import make_run
from studies.league.distilled import DistilledDecider, taught
from studies.league.families import recipe_file
from studies.league.reward import Explorer, reward_inputs

ENV = "hybrid_env:HybridTrackPublished-v0"


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (2.0, 5.0), "correctness": "type"},
    ],
)
def test_the_teacher_states_the_same_as_when_it_sees_each_episode_alone(options):
    run = make_run(
        ENV,
        options,
        load_recipe(
            recipe_file("distilled"),
            ENV,
            ("n_envs=4", "hidden=8"),
        ),
    )
    found = Explorer(
        DistilledDecider(run.net, run.world),
        np.random.default_rng(1),
    ).segments(
        run.env,
        5,
    )
    counts = found.lengths.reshape(4, -1).sum(1)
    family = find_family("shipped-threshold", run.world)
    posterior = taught(
        family.make(0.02),
        found.rows,
        counts,
    )
    begin = counts[0]
    state = None
    alone = family.make(0.02)
    for k, row in enumerate(found.rows[begin : begin + counts[1]]):
        expected, state = alone.posterior(
            row[None],
            state,
            np.array([k == 0]),
        )
        np.testing.assert_allclose(
            posterior[begin + k],
            expected[0],
            atol=1e-6,
        )
    parts = *reward_inputs(found.rows, run.world.tau), found.lengths, posterior.astype(np.float32)
    loss = float(run.loss(*map(torch.from_numpy, parts)).detach())
    own, _ = DistilledDecider(run.net, run.world).posterior(
        found.rows,
        None,
        None,
    )

    assert loss == pytest.approx(-(posterior * np.log(own)).sum(1).mean(), rel=1e-4)


def test_training_for_seconds_comes_closer_to_the_teacher():
    run = make_run(
        ENV,
        {},
        load_recipe(
            recipe_file("distilled"),
            ENV,
            ("n_envs=32", "batch_size=32"),
        ),
        seed=1,
        steps=100_000,
    )
    agent = DistilledDecider(run.net, run.world)
    rows, lengths, *_ = found = Explorer(agent, np.random.default_rng(1)).segments(
        run.env,
        5,
    )
    parts = *reward_inputs(rows, run.world.tau), lengths, *run.labels(found)
    losses = [float(run.loss(*map(torch.from_numpy, parts)).detach())]
    teacher = -(parts[-1] * np.log(np.maximum(parts[-1], 1e-30))).sum(1).mean()
    run.train()
    losses.append(float(run.loss(*map(torch.from_numpy, parts)).detach()))

    assert teacher < losses[1] < losses[0] - 0.01
