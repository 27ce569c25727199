"""Training: reproducible, resumable, and with consistent files."""

import json

import numpy as np
import pytest
import torch
from agents.evaluation.deciders import load_decider, policy_family
from agents.evaluation.evaluate import evaluate

from agents.learned.policy import PolicyDecider, load_actor, make_policy
from agents.learned.policy_file import load_policy
from agents.training.recipe import Recipe, load_recipe, recipe_of
from agents.training.runs import make_run, resume_run
from hybrid_env import WorldOptions
from hybrid_env.checks import ArgumentError

ENV = "hybrid_env:HybridTrack-v0"
PPO = load_recipe("ppo", ENV)
SMALL_CHANGES = ("n_envs=16", "n_steps=32", "batch_size=256", "n_epochs=2", "policy_kwargs.net_arch=[16]")
SMALL = load_recipe("ppo", ENV, SMALL_CHANGES)


def weights(run):
    return {name: value.clone() for name, value in run.model.policy.state_dict().items()}


def test_equal_seeds_give_equal_weights_and_different_seeds_different_ones():
    runs = [make_run(ENV, {}, SMALL, seed, steps=2048) for seed in (3, 3, 4)]
    for run in runs:
        run.train()
    first, second, other = map(weights, runs)
    assert all(torch.equal(first[name], second[name]) for name in first)
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_short_training_learns_to_wait_and_beats_immediate_declarations():
    run = make_run(ENV, {}, PPO, seed=1, steps=300_000)
    run.train()
    decisions = evaluate(run.decider, ENV, episodes=150, seed=5)
    # immediate declarations earn -.35, no declarations -.50; the standard error of 900 segments is about .03
    assert decisions.reward.mean() > 0.2


def test_a_run_folder_contains_config_metrics_events_and_an_equivalent_policy(tmp_path):
    folder = tmp_path / "run"
    run = make_run(ENV, {"measurement_variance": 0.2}, SMALL, 0, folder, 1024)
    reports = []
    run.train(reports.append)
    assert reports[-1].steps == 1024
    card = json.loads((folder / "policy.json").read_text())
    assert (card["environment"], card["options"]) == (ENV, {"measurement_variance": 0.2})
    assert {"torch", "stable-baselines3", "numpy", "hybrid-track"} <= set(card["versions"])
    rows = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows if "segment/reward" in row or "time/fps" in row] == [512, 1024]
    assert [row["step"] for row in rows if "evaluation/reward" in row] == [1024]
    assert any(path.name.startswith("events.out.tfevents") for path in folder.iterdir())
    assert not list(folder.glob("*.part*"))
    loaded = PolicyDecider(load_actor(folder, *load_policy(folder)))
    rows = np.random.default_rng(0).normal(0, 1, (50, 28)).astype(np.float32)
    np.testing.assert_array_equal(loaded.logits(rows)[0], run.decider.logits(rows)[0])


def test_an_interrupted_run_resumes_from_its_last_checkpoint(tmp_path):
    folder = tmp_path / "run"
    run = make_run(ENV, {}, SMALL, 0, folder, 4096)

    def interrupt(progress):
        if progress.steps == 1536:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt, save_every=0.0)
    resumed = resume_run(folder)
    assert resumed.model.num_timesteps == 1024  # the incomplete rollout is lost, but not the update before it
    state = resumed.model.policy.optimizer.state_dict()["state"]
    assert all(entry["step"] > 0 and entry["exp_avg_sq"].abs().sum() > 0 for entry in state.values())
    resumed.train()
    assert resumed.model.num_timesteps == 4096
    assert resume_run(folder, steps=4608).steps == 4608
    rows = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows if "evaluation/reward" not in row] == list(range(512, 4097, 512))


def test_a_run_interrupted_before_its_first_checkpoint_is_resumed(tmp_path):
    run = make_run(ENV, {}, SMALL, 0, tmp_path / "run", 4096)

    def interrupt(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt)
    resumed = resume_run(tmp_path / "run")
    assert resumed.model.num_timesteps == 0
    resumed.train()
    assert resumed.model.num_timesteps == 4096


def test_training_and_evaluation_use_different_episodes():
    run = make_run(ENV, {}, SMALL, 0, steps=512)
    run.train()
    assert min(run.track_seeds()) >= 10**12


@pytest.mark.parametrize(("name", "value"), [("steps", 0), ("seed", -1), ("seed", 2**31)])
def test_a_run_refuses_invalid_arguments(name, value):
    with pytest.raises(ArgumentError, match=f"{name}={value}.*expected"):
        make_run(ENV, {}, SMALL, **{name: value})


def test_damaged_or_missing_run_folders_are_refused_in_one_line(tmp_path):
    folder = tmp_path / "run"
    make_run(ENV, {}, SMALL, 0, folder, 512).train()
    (folder / "checkpoint-previous.safetensors").unlink()
    for name in ("checkpoint.safetensors", "config.json"):
        path = folder / name
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])
        with pytest.raises(ArgumentError, match="resume=") as caught:
            resume_run(folder)
        assert "\n" not in str(caught.value)
        path.write_bytes(content)
    for name in ("policy.safetensors", "policy.json"):
        path = folder / name
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2])
        with pytest.raises(ArgumentError, match="run=") as caught:
            load_policy(folder)
        assert "\n" not in str(caught.value)
        path.write_bytes(content)
    with pytest.raises(ArgumentError, match="resume="):
        resume_run(tmp_path / "nowhere")
    with pytest.raises(ArgumentError, match="run="):
        load_policy(tmp_path)


INVALID = [
    ("n_envs", -1), ("n_steps", 1.5), ("batch_size", 0), ("batch_size", 10**6), ("batch_size", 1),
    ("batch_size", 1000), ("n_epochs", 0), ("learning_rate", 0.0), ("learning_rate", float("nan")),
    ("learning_rate", 2.0), ("learning_rate", "log_3"), ("gae_lambda", 1.5), ("gamma", -1.0),
    ("ent_coef", -1.0),
    ("policy_kwargs", {"net_arch": []}), ("policy_kwargs", {"net_arch": [0]}), ("wait_bias", float("inf")),
    ("n_timesteps", 0), ("n_timesteps", True), ("algo", "magic"), ("algo", [1]), ("unknown", 3),
    ("gamma", True),
    ("policy", "CnnPolicy"), ("policy_kwargs", 3), ("policy_kwargs", {"net_arch": 3}),
    ("policy_kwargs", {"net_arch": [True]}), ("observe", 5), ("observe", "posterior"), ("observe", [3]),
    ("policy_kwargs", {"log_std_init": float("nan")}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), INVALID)
def test_invalid_settings_are_refused_in_one_line_that_names_them(name, value):
    entry = PPO.as_json()["entry"] | {name: value}
    named = {"policy_kwargs": "net_arch|policy_kwargs|recipe", "unknown": "hyper-parameter='unknown'"}.get(
        name, name
    )
    with pytest.raises(ArgumentError, match=named) as caught:
        recipe_of("mine", entry)
    assert "expected" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_recipes_are_read_changed_written_and_read_again(tmp_path):
    assert SMALL.settings.n_envs == 16
    assert recipe_of("ppo", json.loads(json.dumps(SMALL.as_json()["entry"]))).settings == SMALL.settings
    path = tmp_path / "mine.yml"
    entry = {name: value for name, value in SMALL.as_json()["entry"].items() if name != "n_epochs"}
    path.write_text(
        json.dumps({"HybridTrack-v0": entry | {"n_epochs": 3}, "default": entry | {"n_epochs": 5}})
    )
    assert isinstance(load_recipe(str(path), ENV), Recipe)
    assert load_recipe(str(path), ENV).settings.n_epochs == 3
    assert load_recipe(str(path), "hybrid_env:HybridTrackBank-v0").settings.n_epochs == 5
    path.write_text(json.dumps({"HybridTrack-v0": entry}))
    for env in (ENV, "hybrid_env:HybridTrackBank-v0"):
        with pytest.raises(ArgumentError, match="recipe="):
            load_recipe(str(path), env)


def test_the_observed_quantities_can_be_selected():
    from agents.learned.features import ObservationFeatures
    from hybrid_env.world import World

    world = World(WorldOptions(), 1)
    features = ObservationFeatures(world.observation_space(), ("posterior", "ticks", "innovation_along"))
    rows = torch.randn(5, 28)
    selected = features(rows)
    assert selected.shape == (5, 7)
    torch.testing.assert_close(selected[:, :3], torch.softmax(10 * rows[:, :3], -1))
    torch.testing.assert_close(selected[:, 3:], torch.cat([rows[:, 18:19], rows[:, 3:6]], -1))


@pytest.mark.parametrize("name", ["ppo-posteriors", "recurrent-ppo"])
def test_other_recipes_are_trained_and_restored_from_their_folder(name, tmp_path):
    if name == "recurrent-ppo":
        pytest.importorskip("sb3_contrib")
    recipe = load_recipe(name, ENV, SMALL_CHANGES)
    run = make_run(ENV, {}, recipe, 0, tmp_path / "run", 512)
    run.train()
    loaded = load_decider(str(tmp_path / "run"), WorldOptions())
    episodes = [evaluate(decider, ENV, 5, seed=1) for decider in (run.decider, loaded)]
    np.testing.assert_array_equal(*(one.ticks for one in episodes))
    if name == "recurrent-ppo":  # the logits depend on the LSTM state
        rows = np.random.default_rng(0).normal(0, 1, (3, 20, 28)).astype(np.float32)
        _, state = run.decider.predict(rows[0])
        first, second = (run.decider.logits(rows[2], one)[0] for one in (state, None))
        assert np.abs(first - second).max() > 1e-6


def test_deciders_are_loaded_by_name_threshold_and_folder(tmp_path):
    options = WorldOptions()
    assert load_decider("ate", options).upper == pytest.approx(np.log(999))
    assert load_decider("ate:0.01", options).upper == pytest.approx(np.log(99))
    assert load_decider("fixed:30", options).ticks == 30
    folder = tmp_path / "run"
    make_run(ENV, {}, SMALL, 0, folder, 512).train()
    assert load_decider(str(folder), options).threshold == 0.0
    assert load_decider(f"{folder}:-2.5", options).threshold == -2.5
    for invalid in (
        "at",
        "ate:x",
        "ate:nan",
        "ate:2",
        "fixed:2.5",
        "fixed:0",
        str(tmp_path / "none"),
        "",
        ":1",
    ):
        with pytest.raises(ArgumentError, match="expected"):
            load_decider(invalid, options)
    with pytest.raises(ArgumentError, match="21 hypotheses"):
        load_decider(str(folder), WorldOptions(radii=tuple(range(1, 11))))
    with pytest.raises(ArgumentError, match="actions='best'"):
        load_decider("ate", WorldOptions(actions="best"))


def test_a_higher_threshold_waits_longer_and_zero_is_the_most_probable_action():
    run = make_run(ENV, {}, SMALL, 0, steps=512)
    family = policy_family("PPO", run.decider)
    rows = np.random.default_rng(0).normal(0, 1, (400, 28)).astype(np.float32)
    most_probable, _ = run.model.policy.predict(rows, deterministic=True)
    np.testing.assert_array_equal(family.make(0.0).predict(rows)[0], most_probable)
    waiting = [(family.make(odds).predict(rows)[0] == 0).mean() for odds in (-20.0, -5.0, 0.0, 20.0)]
    assert waiting == sorted(waiting)
    assert (waiting[0], waiting[-1]) == (0.0, 1.0)


def test_a_policy_with_two_actions_declares_the_most_likely_hypothesis():
    world = make_run(ENV, {"actions": "best"}, SMALL, 0, steps=512)
    decider = PolicyDecider(world.model.policy, threshold=-100.0)
    rows = np.zeros((2, 28), np.float32)
    rows[0, :3], rows[1, :3] = (-1.0, 0.0, -0.5), (-1.0, -0.5, 0.0)
    assert decider.predict(rows)[0].tolist() == [2, 3]


def test_sampling_follows_the_policys_probabilities():
    space = WorldOptions()
    torch.manual_seed(0)
    from hybrid_env.world import World

    world = World(space, 1)
    policy = make_policy(world.observation_space(), world.action_space(), {"net_arch": [8]})
    decider = PolicyDecider(policy)
    rows = np.zeros((40_000, 28), np.float32)
    logits = decider.logits(rows[:1])[0][0]
    expected = np.exp(logits) / np.exp(logits).sum()
    actions, _ = decider.predict(rows, deterministic=False)
    found = np.bincount(actions, minlength=4) / len(rows)
    np.testing.assert_allclose(found, expected, atol=4 * 0.5 / np.sqrt(len(rows)))
