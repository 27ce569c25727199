"""Training the anchor agent: seeds, several worlds, settings and resuming."""

import numpy as np
import pytest
import torch
from agents.evaluation.evaluate import evaluate

from agents.learned.anchor_decider import AnchorDecider, load_anchor
from agents.learned.policy_file import load_policy
from agents.training.recipe import load_recipe, recipe_of
from agents.training.runs import make_run, resume_run
from baselines import FixedTimeDecider
from hybrid_env import WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
SMALL = load_recipe("anchor", ENV, ("n_steps=16", "hidden=12", "worlds=[{n_envs: 32}]"))


def trained(recipe, steps, seed=0, **options):
    run = make_run(ENV, options, recipe, seed, steps=steps)
    run.train()
    return run.net


def test_the_same_seed_gives_the_same_weights():
    nets = [trained(SMALL, 2000, seed=4) for _ in range(2)]
    for one, other in zip(*(net.state_dict().values() for net in nets), strict=True):
        assert torch.equal(one, other)


def test_short_training_beats_a_fixed_decision_time():
    net = trained(load_recipe("anchor", ENV, ("hidden=16",)), 30_000)
    learned = evaluate(AnchorDecider(net, WorldOptions(), 0.1), episodes=200, seed=7)
    fixed = evaluate(FixedTimeDecider(round(learned.ticks.mean())), episodes=200, seed=7)
    assert learned.correct.mean() > fixed.correct.mean()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"n_steps": 0}, "n_steps=0"),
        ({"random_declarations": 1.0}, "random_declarations=1.0"),
        ({"worlds": [{"n_envs": 0}]}, "n_envs=0"),
        ({"worlds": [{"tracks": 3}]}, "worlds="),
        ({"worlds": [{"n_envs": 3, "options": 3}]}, "options=3"),
        ({"worlds": [{"n_envs": 3, "options": {"bad": 1}}]}, "option='bad'"),
        ({"worlds": [{"n_envs": 3, "env": 3}]}, "env=3"),
        ({"hidden": 1.5}, "hidden=1.5"),
        ({"learning_rate": -1.0}, "learning_rate=-1.0"),
        ({"smallest_alpha": 0.5}, "smallest_alpha=0.5"),
        ({"last_tick": 0}, "last_tick=0"),
        ({"updates_per_world": 0}, "updates_per_world=0"),
        ({"drawn_worlds": [{"radii": 0, "worlds": 1, "n_envs": 1}]}, "radii=0"),
        ({"drawn_worlds": [{"radii": 1}]}, "drawn_worlds="),
        ({"drawn_worlds": [{"radii": 900, "worlds": 900, "n_envs": 900}]}, "n_steps="),
    ],
)
def test_invalid_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        recipe_of("mine", SMALL.as_json()["entry"] | arguments)


def test_training_uses_several_environments_and_banks_at_once():
    worlds = [
        {"n_envs": 8, "options": {"measurement_variance": 0.01}},
        {"n_envs": 8, "options": {"measurement_variance": 1.0}},
        {"n_envs": 4, "env": "hybrid_env:HybridTrackBank-v0"},
    ]
    recipe = recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds})
    net = trained(recipe, 1000)
    world = WorldOptions(radii=(2.0, 5.0))
    assert evaluate(AnchorDecider(net, world, 0.5), episodes=3, radii=(2.0, 5.0)).ticks.shape == (3, 6)
    with pytest.raises(ValueError, match="alpha="):
        AnchorDecider(net, world, 0.0)
    with pytest.raises(ValueError, match="observation shape"):
        AnchorDecider(net, WorldOptions(), 0.5).predict(np.zeros((3, 40), np.float32))


def test_an_interrupted_run_resumes_from_its_last_checkpoint(tmp_path):
    folder = tmp_path / "run"
    run = make_run(ENV, {}, SMALL, 0, folder, 4096)

    def interrupt(progress):
        if progress.steps == 2048:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.train(interrupt, save_every=1e-9)
    resumed = resume_run(folder)
    assert resumed.num_timesteps == 1536  # the incomplete rollout is lost
    for one, other in zip(
        load_anchor(folder, *load_policy(folder)).state_dict().values(),
        resumed.net.state_dict().values(),
        strict=True,
    ):
        assert torch.equal(one, other)
    resumed.train()
    assert resumed.num_timesteps == 4096
    assert resume_run(folder, steps=5000).steps == 5000


def test_environment_options_of_the_recipe_override_those_of_the_run():
    worlds = [{"n_envs": 8, "options": {"measurement_variance": 0.5}}, {"n_envs": 8}]
    recipe = recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds})
    run = make_run(ENV, {"measurement_variance": 0.2}, recipe, steps=1)
    envs = [env for stream in run._streams for env in stream.envs]
    assert [env.options.measurement_variance for env in envs] == [0.5, 0.2]
    worlds[0]["options"]["actions"] = "best"
    with pytest.raises(ValueError, match="actions='best'"):
        make_run(ENV, {}, recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds}), steps=1)
