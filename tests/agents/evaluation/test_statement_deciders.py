"""Deciders for unknown switch moments by name."""

import json

import numpy as np
import pytest
from agents.evaluation.statement_deciders import (
    ALGORITHM,
    PROBABILITIES,
    RULES,
    SHIPPED_STATEMENTS,
    shipped_agents,
    statement_decider,
    statement_family,
)

from agents.evaluation import statement_deciders
from agents.learned.policy_file import save_policy
from agents.learned.statement_net import StatementNet
from agents.training.recipe import load_recipe
from baselines import BeamDecider, CusumDecider, ThresholdDecider, record_statements
from hybrid_env import ArgumentError
from hybrid_env.durations import GeometricDurations
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

OPTIONS = QuickestOptions(ticks=40, durations="uniform 10-20")


@pytest.mark.parametrize("name", RULES)
def test_every_rule_decides_at_its_default_and_at_every_threshold(name):
    family, threshold, decider = statement_decider(name, OPTIONS)
    assert threshold == family.default
    assert family.default in family.thresholds
    assert list(family.thresholds) == sorted(family.thresholds)
    statements = record_statements(decider, 2, 5, **vars(OPTIONS))
    assert (statements.stated_modes < OPTIONS.hypotheses).all()
    for each in family.thresholds:
        family.make(each)


def test_a_threshold_follows_a_colon():
    _, threshold, decider = statement_decider("cusum:3.5", OPTIONS)
    assert threshold == 3.5
    assert isinstance(decider, CusumDecider)
    assert decider.threshold == 3.5


def test_thresholds_below_the_smallest_largest_probability_are_left_out():
    few, many = (QuickestOptions(radii=tuple(range(1, n + 1))) for n in (1, 5))
    assert statement_family("threshold", few).thresholds[:2] == (0.0, 0.4)
    assert statement_family("threshold", many).thresholds == PROBABILITIES  # 1 / 11 is less than all of them
    decider = statement_family("threshold", few).make(0.0)
    assert isinstance(decider, ThresholdDecider)


def test_one_beam_knows_the_law_of_durations_and_the_other_only_its_mean():
    knows, geometric = (statement_decider(name, OPTIONS)[2] for name in ("beam", "beam-geometric"))
    assert isinstance(knows, BeamDecider)
    assert isinstance(geometric, BeamDecider)
    assert knows.model.hazards[1, 8] == 0.0  # no segment ends after 9 ticks
    assert knows.model.hazards[1, 19] == pytest.approx(1.0)
    np.testing.assert_allclose(geometric.model.hazards, 1.0 / OPTIONS.law.mean_duration)
    assert isinstance(OPTIONS.law, GeometricDurations) is False


@pytest.mark.parametrize(
    "name", ["oracle", "", "ate", "threshold:much", "threshold:nan", "threshold:2", "cusum:0"]
)
def test_other_names_and_thresholds_are_refused_in_one_line(name):
    with pytest.raises(ArgumentError) as found:
        statement_decider(name, OPTIONS)
    assert "\n" not in str(found.value)


def test_the_shipped_agent_is_known_only_if_its_weights_exist(tmp_path, monkeypatch):
    monkeypatch.setattr(statement_deciders, "SHIPPED_STATEMENTS", tmp_path / "absent")
    assert shipped_agents() == ()
    with pytest.raises(ArgumentError, match=r"^decider='shipped' is not allowed: expected 'threshold', "):
        statement_family("shipped", OPTIONS)
    monkeypatch.setattr(statement_deciders, "SHIPPED_STATEMENTS", tmp_path)
    assert shipped_agents() == ("shipped",)
    assert SHIPPED_STATEMENTS.name == "shipped_quickest"


def test_a_trained_agent_is_swept_over_its_margin(tmp_path, monkeypatch):
    recipe = load_recipe("statements", "HybridTrackQuickest-v0", ("hidden=4",))
    assert recipe.algo == ALGORITHM
    save_policy(tmp_path, StatementNet(4).state_dict(), {"recipe": recipe.as_json()}, QuickestLayout)
    family, threshold, decider = statement_decider(f"{tmp_path}:1.5", OPTIONS)
    assert (family.name, family.default, threshold) == (tmp_path.name, 0.0, 1.5)
    assert decider.margin == 1.5
    monkeypatch.setattr(statement_deciders, "SHIPPED_STATEMENTS", tmp_path)
    assert statement_family("shipped", OPTIONS).name == "shipped"


def test_a_policy_for_known_switch_moments_is_refused():
    from agents.evaluation.deciders import SHIPPED_FOLDER

    algo = json.loads((SHIPPED_FOLDER / "policy.json").read_text())["recipe"]["entry"]["algo"]
    assert algo != "statements"
    with pytest.raises(ArgumentError, match="a policy for unknown switch moments"):
        statement_family(str(SHIPPED_FOLDER), OPTIONS)
