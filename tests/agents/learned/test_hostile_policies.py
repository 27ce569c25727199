"""Run folders with one value of the card changed, or with damaged weights."""

import json

import numpy as np
import pytest
import torch
from agents.evaluation.deciders import load_decider
from agents.evaluation.statement_deciders import statement_decider
from hostile_input import accepted, damaged, mutated, profile
from hypothesis import given

from agents.interface.world_arguments import WorldArguments
from agents.learned.anchor_decider import AnchorNetworks, save_anchor
from agents.learned.policy import make_policy, save_actor
from agents.learned.policy_file import CARD, WEIGHTS, save_policy
from agents.learned.statement_net import StatementNet
from agents.training.recipe import load_recipe
from hybrid_env import HybridTrackVectorEnv, QuickestLayout, QuickestOptions
from hybrid_env.registration import make_track_vector_env

ENV = "hybrid_env:HybridTrack-v0"
OPTIONS = {"measurement_variance": 0.2, "scheme": "S5 L5r5", "radii": [5.0]}


def card_of(recipe, *changes):
    recipe = load_recipe(recipe, ENV, changes)
    return {"environment": ENV, "options": OPTIONS, "recipe": recipe.as_json(), "seed": 0}


def save_small_anchor(folder):
    torch.manual_seed(0)
    save_anchor(folder, AnchorNetworks(4), card_of("anchor", "hidden=4"))


def save_small_actor(folder, recipe="ppo", **policy_kwargs):
    torch.manual_seed(0)
    policy_kwargs = {"net_arch": [6, 5]} | policy_kwargs
    env = HybridTrackVectorEnv(1, **OPTIONS)
    policy = make_policy(
        env.single_observation_space, env.single_action_space, policy_kwargs, (), recipe != "ppo"
    )
    changes = [f"policy_kwargs.{name}={value}" for name, value in policy_kwargs.items()]
    save_actor(folder, policy, card_of(recipe, *changes))


def save_small_recurrent(folder):
    pytest.importorskip("sb3_contrib")
    save_small_actor(folder, "recurrent-ppo", lstm_hidden_size=4)


def save_small_statements(folder):
    torch.manual_seed(0)
    recipe = load_recipe("statements", "HybridTrackQuickest-v0", ("hidden=4",))
    card = {
        "environment": "hybrid_env:HybridTrackQuickest-v0", "options": {"ticks": 20}, "seed": 0,
        "recipe": recipe.as_json(),
    }  # fmt: skip
    save_policy(folder, StatementNet(4).state_dict(), card, QuickestLayout)


KINDS = [save_small_anchor, save_small_actor, save_small_statements, save_small_recurrent]


def decide(folder):
    """Load the decider of a run folder as a command does; it then decides on some ticks."""
    env_id, options = WorldArguments().world_of(str(folder))
    env = make_track_vector_env(env_id, 3, **options)
    if isinstance(env.options, QuickestOptions):
        _, _, decider = statement_decider(str(folder), env.options)
    else:
        decider = load_decider(str(folder), env.options)
    rows, state = env.reset(seed=0)[0], None
    for _ in range(3):
        actions, state = decider.predict(rows, state, np.zeros(3, np.bool_))
        assert actions.shape == (3,)
        rows = env.step(actions)[0]
    return actions


@pytest.mark.parametrize("examples", [30, pytest.param(3_000, marks=pytest.mark.study)])
@pytest.mark.parametrize("save", KINDS)
def test_a_card_with_one_changed_value_is_used_or_refused(save, examples, tmp_path):
    save(tmp_path)
    card = json.loads((tmp_path / CARD).read_text())
    decide(tmp_path)  # also compiles, which takes longer than an example may

    @profile(examples)
    @given(mutated(card))
    def check(changed):
        (tmp_path / CARD).write_text(json.dumps(changed))
        accepted(lambda: decide(tmp_path))

    check()


@pytest.mark.parametrize("examples", [30, pytest.param(3_000, marks=pytest.mark.study)])
@pytest.mark.parametrize("name", [CARD, WEIGHTS])
@pytest.mark.parametrize("save", KINDS[:3])
def test_a_damaged_file_is_used_or_refused(name, save, examples, tmp_path):
    save(tmp_path)
    decide(tmp_path)
    content = (tmp_path / name).read_bytes()

    @profile(examples)
    @given(damaged(content))
    def check(changed):
        (tmp_path / name).write_bytes(changed)
        accepted(lambda: decide(tmp_path))

    check()
