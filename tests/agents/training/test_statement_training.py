"""Training of agents that state the present mode at every tick."""

import json

import numpy as np
import pytest
import small_training
import torch
from agents.evaluation.deciders import learned_family
from agents.evaluation.statement_deciders import learned_statement_family, statement_decider
from baselines.rules.metrics import measure_statements
from small_training import SMALL_PPO, log_often, small_run

from agents.cli import main
from agents.learned.features import ObservationFeatures
from agents.learned.policy import make_policy
from agents.learned.statement_policy import StatementPolicyDecider
from agents.training.learning_figure import draw_learning_curve
from agents.training.recipe import load_recipe
from agents.training.run_folder import read_metrics
from agents.training.runs import make_run
from agents.training.statement_learning_curve import StatementLearningCurve
from baselines.rules import seeds
from baselines.rules.statements import record_statements
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout, WorldOptions
from hybrid_env.checks import ArgumentError
from hybrid_env.quickest_options import QuickestOptions

ENV = "hybrid_env:HybridTrackQuickest-v0"
SHORT = {"ticks": 60, "durations": "uniform 20-40"}


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


def rows_of(stated):
    """Observation rows with given last statements, None for none."""
    layout = QuickestLayout(3)
    rows = np.random.default_rng(0).normal(size=(len(stated), layout.width)).astype(np.float32)
    rows[:, layout.slices["stated"]] = [np.eye(3)[one] if one is not None else np.zeros(3) for one in stated]
    return rows


@pytest.fixture(scope="module")
def policy():
    torch.manual_seed(0)
    env = HybridTrackQuickestVectorEnv(1)
    return make_policy(
        env.single_observation_space,
        env.single_action_space,
        {"net_arch": [8], "ortho_init": False},
        layout=QuickestLayout,
    )


def test_without_a_margin_the_most_probable_action_is_stated(policy):
    decider = StatementPolicyDecider(policy)
    rows = rows_of(np.random.default_rng(1).integers(0, 3, 300).tolist())
    np.testing.assert_array_equal(decider.predict(rows)[0], policy.predict(rows, deterministic=True)[0])


@pytest.mark.parametrize("margin", [0.0, 0.05, 0.3, 100.0])
def test_a_statement_changes_if_the_log_odds_exceed_the_margin(policy, margin):
    decider = StatementPolicyDecider(policy).with_threshold(margin)
    stated = np.random.default_rng(2).integers(0, 3, 300)
    rows = rows_of(stated.tolist())
    logits = decider.logits(rows)[0]
    expected = [
        max(range(3), key=lambda mode, k=k: logits[k, mode])
        if max(logits[k]) - logits[k, stated[k]] > margin
        else stated[k]
        for k in range(300)
    ]
    np.testing.assert_array_equal(decider.predict(rows)[0], expected)
    assert (np.array(expected) == stated).all() == (margin == 100.0)


def test_the_first_statement_is_the_most_probable_mode(policy):
    decider = StatementPolicyDecider(policy, 100.0)
    rows = rows_of([None] * 50)
    np.testing.assert_array_equal(decider.predict(rows)[0], decider.logits(rows)[0].argmax(1))


def test_sampling_follows_the_probabilities_of_the_policy(policy):
    decider = StatementPolicyDecider(policy)
    rows = np.repeat(rows_of([0]), 40_000, 0)
    logits = decider.logits(rows[:1])[0][0]
    expected = np.exp(logits) / np.exp(logits).sum()
    found = np.bincount(decider.predict(rows, deterministic=False)[0], minlength=3) / len(rows)
    np.testing.assert_allclose(found, expected, atol=4 * 0.5 / np.sqrt(len(rows)))


def test_the_probabilities_of_the_bank_can_be_observed():
    env = HybridTrackQuickestVectorEnv(50)
    rows, info = env.reset(seed=0)
    features = ObservationFeatures(env.single_observation_space, ("posterior", "speed"), QuickestLayout)
    selected = features(torch.from_numpy(rows))
    assert selected.shape == (50, 4)
    # a logarithm of the row has float32 precision and is at least -30
    np.testing.assert_allclose(selected[:, :3], np.exp(info["log_probability"]), atol=1e-5)
    np.testing.assert_array_equal(selected[:, 3], rows[:, -2])


def test_a_short_training_learns_to_state_the_mode():
    run = make_run(ENV, SHORT, load_recipe("ppo", ENV), seed=1, steps=100_000)
    run.train()
    right = measure_statements(record_statements(run.decider, 200, 5, **SHORT)).right
    # a third of the statements is right by chance; the standard error of 200 tracks is below .02
    assert right.mean() > 0.55


def test_a_run_folder_has_the_layout_on_its_card_and_an_equivalent_decider(tmp_path):
    run = small_run("ppo-quickest", tmp_path / "run", 1280)
    notes = []
    run.train(lambda now: notes.append(now.note))
    assert "per tick" in notes[-1]
    card = json.loads((tmp_path / "run" / "policy.json").read_text())
    scales = QuickestLayout.hypothesis_features | QuickestLayout.track_features
    assert (card["environment"], card["actions"], card["observation_scales"]) == (ENV, 3, scales)
    world = QuickestOptions(**card["options"])
    family = learned_statement_family("run", tmp_path / "run", QuickestOptions())
    assert family.hypotheses == 3
    recorded = [
        record_statements(decider, 20, 3, **vars(world)).stated_modes
        for decider in (run.decider, family.make(0.0), run.family("").make(0.0))
    ]
    np.testing.assert_array_equal(recorded[0], recorded[1])
    np.testing.assert_array_equal(recorded[0], recorded[2])
    with pytest.raises(ArgumentError, match="a policy for known switch moments"):
        learned_family(tmp_path / "run", WorldOptions())
    with pytest.raises(ArgumentError, match="a policy for 5 hypotheses"):
        statement_decider(str(tmp_path / "run"), QuickestOptions(radii=(5.0, 7.0)))


def test_an_agent_that_declares_modes_is_refused_here(tmp_path):
    small_run("ppo", tmp_path / "run", 640).train()
    with pytest.raises(ArgumentError, match="a policy for unknown switch moments"):
        learned_statement_family("run", tmp_path / "run", QuickestOptions())


def test_the_learning_curve_measures_fixed_tracks_of_the_environment(tmp_path, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(small_training.learning_curve, "EPISODES", 7)
    run = make_run(ENV, SHORT, load_recipe("ppo", ENV, SMALL_PPO), 0, tmp_path / "run", 640)
    run.train()
    [point] = [row for row in read_metrics(tmp_path / "run") if "evaluation/reward" in row]
    metrics = measure_statements(record_statements(run.decider, 7, seeds.LEARNING_CURVE, **SHORT))
    assert point["evaluation/reward"] == metrics.reward.mean()
    assert point["evaluation/right"] == metrics.right.mean()
    assert point["evaluation/wrong_changes"] == metrics.wrong_changes.mean()
    curve = StatementLearningCurve(ENV, SHORT)
    assert point["evaluation/threshold"] == curve.reference_reward
    assert "threshold rule" in curve.summary([point])[1]
    assert "per tick" in curve.summary([point])[0]
    draw_learning_curve(tmp_path / "run", tmp_path / "curve.png", curve)
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


def test_the_command_trains_and_resumes(tmp_path, capsys):
    run = str(tmp_path / "run")
    line = [
        "train",
        "--env",
        ENV,
        "--ticks",
        "30",
        "--durations",
        "uniform 5-9",
        "--steps",
        "640",
        "--out",
        run,
    ]
    assert main([*line, "--set", *SMALL_PPO]) == 0
    assert main(["train", "--resume", run, "--steps", "1280"]) == 0
    assert "right" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("recipe", "changes", "message"),
    [
        ("ppo", ["wait_bias=5"], "wait_bias=5"), ("ppo", ["observe=[ticks_left]"], "observe='ticks_left'"),
        ("recurrent-ppo", [], "wait_bias=5.0"), ("anchor", [], "env="),
    ],
)  # fmt: skip
def test_a_recipe_for_announced_switches_is_refused(recipe, changes, message):
    if recipe == "recurrent-ppo":
        pytest.importorskip("sb3_contrib")
    with pytest.raises(ArgumentError, match=message):
        make_run(ENV, {}, load_recipe(recipe, ENV, changes), 0)


def test_a_recurrent_agent_can_state_modes(tmp_path):
    pytest.importorskip("sb3_contrib")
    changes = [*SMALL_PPO, "policy_kwargs.lstm_hidden_size=8", "wait_bias=0"]
    run = make_run(ENV, SHORT, load_recipe("recurrent-ppo", ENV, changes), 0, tmp_path / "run", 640)
    run.train()
    loaded = statement_decider(f"{tmp_path / 'run'}:0.5", QuickestOptions(**SHORT))[2]
    recorded = [
        record_statements(decider, 5, 3, **SHORT).stated_modes
        for decider in (run.decider.with_threshold(0.5), loaded)
    ]
    np.testing.assert_array_equal(*recorded)
