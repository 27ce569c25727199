"""Trainings of the shipped agents: reproducible, resumed with equal results, and with a run folder
whose agent decides as the trained one.
"""

import numpy as np
import pytest
import torch
from scipy.stats import multivariate_normal
from small_training import (
    PUBLISHED,
    QUICK,
    SCHEME,
    STEPS,
    assert_folder_decides_as,
    interrupted,
    log_often,
    outcome,
    small_run,
    whole_runs,
)

from agents.training.runs import resume_run
from studies.shipped.anchor import anchor_loss

KINDS = {
    "anchor": (
        "studies/shipped/anchor.yml",
        PUBLISHED,
        SCHEME,
        (
            "hidden=8",
            "buffer_size=200",
            "batches=2",
            "batch_size=32",
            "worlds=[{n_envs: 16}, {n_envs: 4, env: HybridTrackPublishedBank-v0}]",
            "drawn_worlds=[{radii: 1, worlds: 1, n_envs: 4}]",
        ),
    ),
    "stopping": (
        "studies/shipped/stopping.yml",
        PUBLISHED,
        SCHEME,
        (
            "batch_size=16",
            "passes=2",
            "worlds=[{n_envs: 8}, {n_envs: 2, env: HybridTrackPublishedBank-v0}]",
            "drawn_worlds=[{radii: 1, worlds: 1, n_envs: 2}]",
        ),
    ),
    "rhythm": (
        "studies/shipped/rhythm.yml",
        "HybridTrackQuickest-v0",
        QUICK,
        (
            "n_envs=8",
            "batch_size=8",
            "n_steps=25",
            "hidden=6",
            "ticks=50",
            "durations=[drawn, geometric 30]",
        ),
    ),
}
"""Recipe, environment, its options and changed hyper-parameters."""


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return whole_runs(tmp_path_factory.mktemp("whole"), KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_a_resumed_run_equals_an_uninterrupted_one(kind, whole, tmp_path):
    folder = interrupted(kind, tmp_path / "run", STEPS // 2 + 1, KINDS)
    resume_run(folder).train(save_every=1000.0)

    assert outcome(folder) == outcome(whole(kind).folder)


@pytest.mark.parametrize("kind", KINDS)
def test_the_agent_of_a_run_folder_decides_as_the_trained_one(kind, whole):
    assert_folder_decides_as(whole(kind), KINDS[kind][2])


def test_training_increases_the_expected_reward():
    rewards = []
    run = small_run("rhythm", steps=1, kinds=KINDS)
    run.steps = 40 * run.round_steps
    run.train(lambda progress: rewards.append(progress.reward))

    assert np.mean(rewards[-10:]) > np.mean(rewards[:10])


def test_the_loss_of_the_anchors_is_the_density_of_the_mixture():
    net = small_run("anchor", kinds=KINDS).network.anchor
    torch.nn.init.normal_(net.output.weight, std=0.02)
    inputs, errors = torch.randn(5, net.inputs), torch.randn(5, 4)
    with torch.no_grad():
        log_weight, mean, factor = net(inputs)
        weight = log_weight.exp().double()
        covariance = (factor @ factor.mT).double()
        density = [
            sum(
                weight[i, c]
                * multivariate_normal(mean[i, c].double(), covariance[i, c]).pdf(errors[i])
                for c in range(weight.shape[1])
            )
            for i in range(5)
        ]
        loss = anchor_loss(net, inputs, errors).item()
    assert loss == pytest.approx(-np.log(density).mean(), rel=1e-4)


def test_the_quick_form_trains_an_agent(tmp_path, run_study):
    printed = run_study("shipped", "--quick", "--out", str(tmp_path))

    assert "| rhythm | HybridTrackQuickest-v0 |" in printed
    assert (tmp_path / "shipped.md").read_text() in printed
