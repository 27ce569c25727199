"""The agent of rewards: what is decided row by row is what is trained on whole segments."""

import numpy as np
import torch
from scipy.special import softmax

from agents import load_recipe
from agents.training.runs import make_run
from studies.league.protocol import THREE
from studies.league.reward import Explorer
from studies.league.rows import row_inputs

RECIPE = "studies/league/recipes/reward.yml"


def random_run(options):
    """A run with random weights, its agent, and rows and segments that this explores."""
    run = make_run(THREE, options, load_recipe(RECIPE, THREE, ("n_envs=6", "hidden=8")))
    torch.manual_seed(1)
    for parameter in run.network.parameters():
        torch.nn.init.normal_(parameter.data, std=0.2)
    agent = run.decider(run.network, run.world)
    return run, agent, *Explorer(agent, np.random.default_rng(1), 0.5).segments(run.env, 5)


@torch.no_grad()
def test_a_decision_after_every_row_is_that_of_whole_segments_and_mirrored():
    run, agent, rows, segments = random_run({"radii": (2.0, 5.0), "correctness": "type"})
    inputs = map(torch.from_numpy, row_inputs(rows))
    logs = run.network.whole(*inputs, torch.from_numpy(segments.lengths)).double().numpy()

    state = None
    for row, expected in zip(rows[:150], softmax(logs, -1), strict=False):
        posterior, state = agent.posterior(row[None], state)
        np.testing.assert_allclose(posterior[0], expected, atol=1e-3)

    layout, mirror = agent.layout, [0, 3, 4, 1, 2]
    mirrored = rows.copy()
    for block in layout.slices.values():
        if block.stop - block.start == len(mirror):
            mirrored[:, block] = mirrored[:, block][:, mirror]
    for odd in ("displacement_across", "innovation_across", "turn_angle"):
        mirrored[:, layout.slices[odd]] *= -1.0
    plain, other = (agent.posterior(each, None)[0] for each in (rows, mirrored))
    np.testing.assert_allclose(plain, other[:, mirror], atol=1e-5)


def test_the_agent_of_rewards_learns_any_modes():
    run, agent, rows, _ = random_run({"modes": "stop, straight, left 5, accelerate 1"})
    posterior, _ = agent.posterior(rows, None)
    assert posterior.shape == (len(rows), 4)
    steps, _, _, metrics = run.train_round()
    assert steps > 0
    assert np.isfinite(metrics["loss"])
