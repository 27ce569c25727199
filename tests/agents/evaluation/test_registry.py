"""Deciders by name, for both kinds of switches."""

import numpy as np
import pytest

from agents.evaluation.registry import (
    SHIPPED,
    find_decider,
    find_family,
    load_decider,
    policy_folder,
    shipped_names,
)
from baselines import record_statements
from baselines.rules import refiltering
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from hybrid_env import ArgumentError, HybridTrackVectorEnv, WorldOptions
from hybrid_env.quickest_options import QuickestOptions

OPTIONS = {
    ANNOUNCED: WorldOptions(scheme="random 2x20-25"),
    UNKNOWN: QuickestOptions(ticks=40, durations="uniform 10-20"),
}


AGENTS = [(task, name) for task in OPTIONS for name in shipped_names(task)]


@pytest.mark.parametrize(
    ("task", "name"),
    [*((task, name) for task in OPTIONS for name in rules(task)), *AGENTS],
)
def test_every_decider_decides_at_its_default_and_can_be_made_at_every_threshold(
    task,
    name,
    monkeypatch,
):
    monkeypatch.setattr(refiltering, "CALIBRATION_EPISODES", 100)
    options = OPTIONS[task]
    family, threshold = find_decider(name, options)

    assert threshold == family.default
    assert family.default in family.thresholds
    assert len(set(family.thresholds)) == len(family.thresholds)
    for each in family.thresholds[:: max(1, len(family.thresholds) // 3)]:
        family.make(each)
    decider = family.make(threshold)
    if task == UNKNOWN:
        statements = record_statements(decider, 2, 5, **vars(options))
        assert (statements.stated_modes < options.hypotheses).all()
    elif not family.options:
        env = HybridTrackVectorEnv(2, **vars(options))
        rows, _ = env.reset(seed=5)
        seen = (
            rows if getattr(decider, "observes", "rows") == "rows" else decider.observe(env.world)
        )
        actions, _ = decider.predict(seen, None, np.ones(2, np.bool_))
        assert (actions <= options.hypotheses).all()


@pytest.mark.parametrize(
    ("task", "name"),
    [
        *(
            (UNKNOWN, name)
            for name in ("oracle", "", "ate", "cusum:0", "threshold:much", "threshold:nan")
        ),
        *(
            (ANNOUNCED, name)
            for name in ("oracle", "", "cusum", "ate:much", "ate:nan", "ate:2", "ml:0.5")
        ),
        (UNKNOWN, "threshold:2"),
    ],
)
def test_other_names_and_thresholds_are_refused_in_one_line(task, name):
    with pytest.raises(ArgumentError) as found:
        load_decider(name, OPTIONS[task])
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("task", OPTIONS)
def test_a_policy_for_the_other_kind_of_switches_is_refused(task):
    (other,) = set(OPTIONS) - {task}
    with pytest.raises(ArgumentError, match=r"a policy for (un)?known switch moments"):
        find_family(str(policy_folder(SHIPPED, other)), OPTIONS[task])
