"""Rules where a decision is asked for every few ticks."""

import pytest

from baselines.rules.decider import ANNOUNCED, rules
from baselines.rules.rollout import record_decisions
from hybrid_env import WorldOptions


@pytest.mark.parametrize("name", ["ate", "fixed", "gap", "msprt", "msprt-type", "sprt"])
def test_a_rule_is_right_as_often_as_if_it_is_asked_at_every_tick(name):
    """Fewer decisions are later, with more evidence; 120 segments each."""
    rule = rules(ANNOUNCED)[name]
    right = []
    for ticks in (1, 6):
        options = {"bank": "anchor_aware", **rule.attribute("options"), "decide_every": ticks}
        decider = rule.create(WorldOptions(**options))
        made = record_decisions(decider, "HybridTrackPublished-v0", 20, 0, **options)
        right.append(made.correct.mean())
    assert right[1] > right[0] - 0.04
