"""Rules on modes other than straight motion and turns: all that read rows decide among them, and
those with filters for turns refuse them.
"""

import numpy as np
import pytest

from baselines import MSPRTDecider, record_statements
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from baselines.rules.rollout import record_decisions
from baselines.scoring.statements import measure_statements
from hybrid_env import ArgumentError, QuickestOptions, WorldOptions

# Four and five modes, in an order of their own.
FOUR = "stop, straight, left 5, accelerate 2"
FIVE = "left 5, left 2, stop, accelerate 2, straight"
CLIMBS = "straight, left 5, climb 0.6, descend 0.6"
EVERY = pytest.mark.parametrize(
    ("task", "name"), [(task, name) for task in (ANNOUNCED, UNKNOWN) for name in rules(task)]
)


def share_right(task, rule, modes):
    """Play a rule among modes, and return how often it is right."""
    given = {"modes": modes, "measurement_variance": 0.01, "height_variance": 0.01}
    if task == ANNOUNCED:
        given |= {"scheme": "random 3x60-60", **rule.attribute("options")}
        decider = rule.create(WorldOptions(**given))
        return record_decisions(decider, "hybrid_env:HybridTrack-v0", 40, **given).correct.mean()
    given |= {"ticks": 200, "durations": "uniform 50-70"}
    decider = rule.create(QuickestOptions(**given))
    return measure_statements(record_statements(decider, 8, 0, **given)).right.mean()


@EVERY
def test_a_rule_decides_among_any_modes_or_refuses_them_in_one_line(task, name):
    rule = rules(task)[name]
    if rule.kind.any_modes:
        # By chance a fourth would be right.
        assert share_right(task, rule, FOUR) > 0.5
    else:
        assert name.startswith(("propagated", "msprt-kept"))
        with pytest.raises(ArgumentError, match=f"^modes='{FOUR}' is not allowed: [^\n]*turns"):
            share_right(task, rule, FOUR)


@EVERY
def test_a_rule_decides_among_climbs_or_refuses_them_in_one_line(task, name):
    """Those that read rows decide among them, and those with filters of their own refuse them."""
    rule = rules(task)[name]
    if rule.kind.any_modes and rule.kind.observes == "rows":
        # By chance a sixth would be right.
        assert share_right(task, rule, CLIMBS) > (0.2 if name == "at-once" else 0.5)
    else:
        assert name not in ("ml", "ate", "msprt", "threshold", "steady")
        with pytest.raises(ArgumentError, match=r"^modes='straight level[^\n]*not allowed"):
            share_right(task, rule, CLIMBS)


def test_a_rule_that_is_made_by_hand_gets_the_types_of_the_environment():
    given = {"modes": FIVE, "correctness": "type", "scheme": "random 3x60-60"}
    decider = MSPRTDecider(0.02, by="type")
    first, second = (
        record_decisions(each, "hybrid_env:HybridTrack-v0", 20, **given)
        for each in (decider, decider.for_modes(WorldOptions(**given)))
    )

    np.testing.assert_array_equal(first.decided_mode, second.decided_mode)
