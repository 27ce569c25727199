"""Training the anchor agent: what it learns, in several environments at once."""

import numpy as np
import pytest

from agents.learned.anchor_decider import AnchorDecider
from agents.training.recipe import load_recipe, recipe_of
from agents.training.runs import make_run
from baselines import FixedTimeDecider
from baselines.rules.rollout import evaluate
from hybrid_env import WorldOptions

ENV = "hybrid_env:HybridTrack-v0"
SMALL = load_recipe("anchor", ENV, ("n_steps=16", "hidden=12", "worlds=[{n_envs: 32}]"))


def trained(recipe, steps, seed=0, **options):
    run = make_run(ENV, options, recipe, seed, steps=steps)
    run.train()
    return run.net


def test_short_training_beats_a_fixed_decision_time():
    net = trained(load_recipe("anchor", ENV, ("hidden=16",)), 30_000)
    learned = evaluate(AnchorDecider(net, WorldOptions(), 0.1), episodes=200, seed=7)
    fixed = evaluate(FixedTimeDecider(round(learned.ticks.mean())), episodes=200, seed=7)
    assert learned.correct.mean() > fixed.correct.mean()


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


def test_environment_options_of_the_recipe_override_those_of_the_run():
    worlds = [{"n_envs": 8, "options": {"measurement_variance": 0.5}}, {"n_envs": 8}]
    recipe = recipe_of("mine", SMALL.as_json()["entry"] | {"worlds": worlds})
    run = make_run(ENV, {"measurement_variance": 0.2}, recipe, steps=1)
    envs = [env for stream in run._streams for env in stream.envs]
    assert [env.options.measurement_variance for env in envs] == [0.5, 0.2]
