"""Training of agents of every kind: seeds, what they learn, their run folders, and what is
refused.
"""

import json

import numpy as np
import pytest
import small_training
import torch
from small_training import KINDS, log_often, small_run

from agents.evaluation.registry import learned_family
from agents.training.learning_curve import draw_learning_curve, environment_curve
from agents.training.library import LibraryAlgorithm
from agents.training.recipe import load_recipe
from agents.training.run_folder import read_metrics
from agents.training.runs import make_run
from baselines import measure_statements
from baselines.rules import seeds
from baselines.rules.rollout import evaluate, record_statements
from hybrid_env import QuickestLayout, QuickestOptions, WorldOptions
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrackPublished-v0"
QUICKEST = "hybrid_env:HybridTrackQuickest-v0"


@pytest.fixture(autouse=True)
def _small_evaluations(monkeypatch):
    log_often(monkeypatch.setattr)
    torch.set_num_threads(1)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """The folder and the run of a short training of each kind, made once."""
    made = {}

    def folder_of(kind):
        if kind not in made:
            folder = tmp_path_factory.mktemp("runs") / kind
            run = small_run(kind, folder, 1280)
            run.notes = []
            run.train(lambda now: run.notes.append(now.note))
            made[kind] = folder, run
        return made[kind]

    return folder_of


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "recurrent-ppo"])
def test_equal_seeds_give_equal_weights_and_different_seeds_different_ones(kind):
    nets = []
    for seed in (3, 3, 4):
        run = small_run(kind, steps=700, seed=seed)
        run.train()
        nets.append(run.network.state_dict())

    assert all(torch.equal(nets[0][name], nets[1][name]) for name in nets[0])
    assert not all(torch.equal(nets[0][name], nets[2][name]) for name in nets[0])


@pytest.mark.study
def test_ppo_learns_to_wait_and_beats_immediate_declarations():
    run = make_run(ENV, {}, load_recipe("ppo", ENV), seed=1, steps=300_000)
    run.train()
    decisions = evaluate(
        run.family("").make(0.0),
        ENV,
        episodes=150,
        seed=5,
    )
    # Immediate declarations earn -.35, no declarations -.50; the standard error of 900 segments is
    # about .03.
    assert decisions.reward.mean() > 0.2


@pytest.mark.study
def test_ppo_learns_to_state_the_mode():
    options = {"ticks": 60, "durations": "uniform 20-40"}
    run = make_run(
        QUICKEST,
        options,
        load_recipe("ppo", QUICKEST),
        seed=1,
        steps=100_000,
    )
    run.train()
    right = measure_statements(record_statements(run.family("").make(0.0), 200, 5, **options)).right
    # A third of the statements is right by chance; the standard error of 200 tracks is below .02.
    assert right.mean() > 0.55


@pytest.mark.parametrize(
    ("kind", "rounds", "more"),
    [
        ("statements", 40, ()),
    ],
)
def test_training_increases_the_expected_reward(kind, rounds, more):
    rewards = []
    run = small_run(kind, steps=1, more=more)
    run.steps = rounds * run.round_steps
    run.train(lambda progress: rewards.append(progress.reward))

    assert len(rewards) == rounds
    assert np.mean(rewards[-rounds // 4 :]) > np.mean(rewards[: rounds // 4])


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_folder_has_card_metrics_and_an_equivalent_decider(kind, folders):
    folder, run = folders(kind)
    card = json.loads((folder / "policy.json").read_text())
    recipe, env, options, _ = KINDS[kind]

    assert card["environment"] == f"hybrid_env:{env}"
    assert (card["options"], card["recipe"]["name"], card["seed"]) == (options, recipe, 3)
    assert {"torch", "stable-baselines3", "numpy", "hybrid-track"} <= set(card["versions"])
    if "Quickest" in env:
        assert (
            card["observation_scales"]
            == QuickestLayout.hypothesis_features | QuickestLayout.track_features
        )
    assert ("per tick" in run.notes[-1]) == ("Quickest" in env)
    rows = read_metrics(folder)
    assert [row["step"] for row in rows if "evaluation/reward" in row][-1] == run.num_timesteps
    assert any("events.out.tfevents" in path.name for path in folder.iterdir()) == (
        isinstance(run, LibraryAlgorithm)
    )
    assert not list(folder.glob("*.part*"))
    world = (QuickestOptions if "Quickest" in env else WorldOptions)(**options)
    family = learned_family(folder, world)
    assert (family.name, family.hypotheses) == (
        kind,
        3 if isinstance(run, LibraryAlgorithm) else None,
    )
    loaded, own = (one.make(one.default) for one in (family, run.family("")))
    if "Quickest" in env:
        recorded = [record_statements(one, 5, 3, **options).stated_modes for one in (loaded, own)]
        np.testing.assert_array_equal(*recorded)
    else:
        np.testing.assert_array_equal(
            *(evaluate(one, ENV, 5, 1, **options).ticks for one in (loaded, own))
        )
    others = {WorldOptions(): "known", QuickestOptions(): "unknown"}
    for other, words in others.items():
        if other.switches != world.switches:
            with pytest.raises(ArgumentError, match=f"a policy for {words} "):
                learned_family(folder, other)


@pytest.mark.parametrize("kind", ["ppo-quickest", "ppo"])
def test_the_learning_curve_measures_fixed_episodes_of_the_environment(kind, tmp_path, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(small_training.learning_curve, "EPISODES", 7)
    run = small_run(kind, tmp_path / "run", 640)
    run.train()
    _, env, options, _ = KINDS[kind]
    [point] = [row for row in read_metrics(tmp_path / "run") if "evaluation/reward" in row]
    if kind == "ppo":
        decisions = evaluate(
            run.family("").make(0.0),
            ENV,
            7,
            seeds.LEARNING_CURVE,
            **options,
        )
        expected = {
            "reward": decisions.reward,
            "accuracy": decisions.correct,
            "ticks": decisions.ticks,
        }
    else:
        metrics = measure_statements(
            record_statements(
                run.family("").make(0.0),
                7,
                seeds.LEARNING_CURVE,
                **options,
            )
        )
        expected = {name: getattr(metrics, name) for name in ("reward", "right", "wrong_changes")}
    for name, values in expected.items():
        assert point[f"evaluation/{name}"] == pytest.approx(values.mean(), rel=1e-12)
    curve = environment_curve(f"hybrid_env:{env}", options)

    assert point[curve.reference_key] == curve.reference_reward
    unit, rule = ("segment", "SPRT") if kind == "ppo" else ("tick", "threshold rule")
    assert f"per {unit}" in curve.summary([point])[0]
    assert rule in curve.summary([point])[1]
    draw_learning_curve(tmp_path / "run", tmp_path / "curve.png", curve)
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("env", "options", "recipe", "changes", "message"),
    [
        (QUICKEST, {}, "ppo", ["wait_bias=5"], "wait_bias=5"),
        (QUICKEST, {}, "ppo", ["observe=[ticks_left]"], "observe='ticks_left'"),
        (QUICKEST, {}, "recurrent-ppo", [], r"wait_bias=5\.0"),
        (QUICKEST, {}, "anchor", [], "env="),
        (ENV, {}, "statements", [], "env="),
        (ENV, {}, "anchor", ["worlds=[{n_envs: 8, options: {actions: best}}]"], "actions='best'"),
    ],
)
def test_a_recipe_for_another_environment_is_refused(env, options, recipe, changes, message):
    if recipe == "recurrent-ppo":
        pytest.importorskip("sb3_contrib")
    with pytest.raises(ArgumentError, match=message):
        make_run(env, options, load_recipe(recipe, env, changes), 0)
