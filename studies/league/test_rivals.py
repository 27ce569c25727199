"""Every rival: what is decided row by row is what is trained on whole segments, and mirrored for
mirrored tracks; one closed form of each network.
"""

import numpy as np
import pytest
import torch
from scipy.special import log_softmax, softmax

from agents import load_recipe
from agents.training.runs import make_run
from hybrid_env import ArgumentError
from studies.league.families import find_recipe
from studies.league.kalman import KalmanNet, segment_logs, turning
from studies.league.protocol import THREE
from studies.league.segments import Explorer, places
from studies.league.tandem import log_ratios, windows_of


def random_run(name, options):
    """A run with random weights, its agent, and rows and segments that this explores."""
    run = make_run(THREE, options, load_recipe(*find_recipe(name), ("n_envs=6", "hidden=8")))
    torch.manual_seed(1)
    for parameter in run.net.parameters():
        torch.nn.init.normal_(parameter.data, std=0.2)
    agent = run.decider(run.net, run.world)
    return run, agent, *Explorer(agent, np.random.default_rng(1), 0.5).segments(run.env, 5)


def kalman_logs(net, inputs, lengths):
    logs, inside = segment_logs(net, inputs, lengths)
    return logs.cumsum(0).swapaxes(0, 1)[inside.T]


def tandem_logs(net, inputs, lengths, order):
    ticks = places(lengths)[1] + 1
    return log_ratios(*map(net, windows_of(inputs, ticks, order)), ticks, order)


@pytest.mark.parametrize(
    ("name", "whole"),
    [
        ("reward", lambda net, *segments: net.whole(*segments)),
        ("tandem", lambda net, inputs, logs, lengths: tandem_logs(net, inputs, lengths, net.order)),
        ("kalman", kalman_logs),
    ],
)
@torch.no_grad()
def test_a_decision_after_every_row_is_that_of_whole_segments_and_mirrored(name, whole):
    run, agent, rows, segments = random_run(name, {"radii": (2.0, 5.0), "correctness": "type"})
    inputs = map(torch.from_numpy, run.inputs(rows, segments.lengths))
    logs = whole(run.net, *inputs, torch.from_numpy(segments.lengths)).double().numpy()

    state = None
    for row, expected in zip(rows[:150], softmax(logs, -1), strict=False):
        posterior, state = agent.posterior(row[None], state, None)
        np.testing.assert_allclose(posterior[0], expected, atol=1e-3)

    layout, mirror = agent.layout, [0, 3, 4, 1, 2]
    mirrored = rows.copy()
    for block in layout.slices.values():
        if block.stop - block.start == len(mirror):
            mirrored[:, block] = mirrored[:, block][:, mirror]
    for odd in ("displacement_across", "innovation_across", "turn_angle"):
        mirrored[:, layout.slices[odd]] *= -1.0
    plain, other = (agent.posterior(each, None, None)[0] for each in (rows, mirrored))
    np.testing.assert_allclose(plain, other[:, mirror], atol=1e-5)


@torch.no_grad()
def test_the_agent_of_rewards_learns_any_modes_and_its_rivals_refuse_them():
    modes = {"modes": "stop, straight, left 5, accelerate 1"}
    run, agent, rows, segments = random_run("reward", modes)
    posterior, _ = agent.posterior(rows, None, None)
    assert posterior.shape == (len(rows), 4)
    inputs = map(torch.from_numpy, run.inputs(rows, segments.lengths))
    assert torch.isfinite(run.loss([*inputs], type(segments)(*map(torch.from_numpy, segments))))
    with pytest.raises(ArgumentError, match=r"^modes='stop, straight, left 5, accelerate 1'"):
        random_run("tandem", modes)


def test_the_filter_with_a_constant_gain_and_covariance_is_the_literal_one():
    torch.manual_seed(0)
    net = KalmanNet(8)
    motion, gain = turning(torch.tensor(0.3)), torch.rand(4, 2)
    net.gain[2].bias.data[:] = gain.flatten()
    net.covariance[2].bias.data[:] = torch.tensor([0.2, -0.3, 0.4])
    state, measurement = torch.randn(5, 4), torch.randn(5, 2)
    with torch.no_grad():
        last = net.start(state, torch.zeros(5, 2))
        after, log = net.step(last, motion, measurement, torch.ones(5, 1))
    predicted = state @ motion.T
    # The inverse of the Cholesky factor; the logarithms are hardly compressed.
    inverse = torch.tensor([[np.exp(-0.2), 0.0], [0.4, np.exp(0.3)]]).float()
    positions = predicted[:, :2]
    law = torch.distributions.MultivariateNormal(positions, precision_matrix=inverse.T @ inverse)

    expected = predicted + (measurement - positions) @ gain.T
    np.testing.assert_allclose(after.state, expected, atol=1e-5)
    np.testing.assert_allclose(log, law.log_prob(measurement), atol=1e-2)


def test_exact_posteriors_of_windows_give_the_exact_ratios():
    # Unit normal vectors around the axis of each of three hypotheses, as both turns see them.
    generator = np.random.default_rng(0)
    vectors = np.eye(3)[generator.integers(3, size=4)][:, None] + generator.normal(size=(4, 9, 3))
    exact = vectors.cumsum(1).reshape(-1, 3)
    views = torch.from_numpy(np.stack([vectors, vectors[..., [0, 2, 1]]], 2)).flatten(0, 1)

    def posterior(windows):
        return torch.log_softmax(windows[:, 0].unflatten(-1, (5, 4))[..., :3].sum(1), -1)

    ratios = tandem_logs(posterior, views, torch.full((4,), 9), 4)
    np.testing.assert_allclose(log_softmax(ratios, -1), log_softmax(exact, -1), atol=1e-5)
