"""Rules on modes that climb and descend: those that read rows decide among them, and those with
filters of their own refuse them.
"""

import pytest

from baselines import record_statements
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from baselines.rules.rollout import record_decisions
from baselines.scoring.statements import measure_statements
from hybrid_env import ArgumentError, QuickestOptions, WorldOptions

GIVEN = {
    "modes": "straight, left 5, climb 0.6, descend 0.6",
    "measurement_variance": 0.01,
    "height_variance": 0.01,
}
NAMES = [(task, name) for task in (ANNOUNCED, UNKNOWN) for name in rules(task)]


@pytest.mark.parametrize(("task", "name"), NAMES)
def test_a_rule_decides_among_climbs_or_refuses_them_in_one_line(task, name):
    rule = rules(task)[name]
    if task == ANNOUNCED:
        given = GIVEN | {"scheme": "random 2x60-60", **rule.attribute("options")}

        def right():
            decider = rule.create(WorldOptions(**given))
            return record_decisions(
                decider, "hybrid_env:HybridTrack-v0", 60, **given
            ).correct.mean()
    else:
        given = GIVEN | {"ticks": 200, "durations": "uniform 50-70"}

        def right():
            decider = rule.create(QuickestOptions(**given))
            return measure_statements(record_statements(decider, 8, 0, **given)).right.mean()

    if rule.kind.any_modes and rule.kind.observes == "rows":
        # By chance a sixth would be right.
        assert right() > (0.2 if name == "at-once" else 0.5)
    else:
        assert name not in ("ml", "ate", "msprt", "threshold", "steady")
        with pytest.raises(ArgumentError, match=r"^modes='straight level[^\n]*not allowed"):
            right()
