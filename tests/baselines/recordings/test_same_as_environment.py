"""The on-line tracker equals both environments tick by tick, bit for bit."""

import pytest
from online_episodes import COMMON, same_as_announced, same_as_quickest

from baselines import (
    BeamDecider,
    CusumDecider,
    FixedTimeDecider,
    MSPRTDecider,
    RestartDecider,
    ShiryaevRobertsDecider,
    ThresholdDecider,
)
from baselines.rules.propagated import RefilteringDecider
from hybrid_env import QuickestOptions, WorldOptions


@pytest.mark.parametrize(("name", "start"), [("axes", "known"), ("ship", "random")])
@pytest.mark.parametrize("decider", [CusumDecider(), ShiryaevRobertsDecider(), ThresholdDecider()])
def test_unknown_switch_moments(decider, name, start):
    missed = 0.2 if name == "ship" else 0.0
    given = {"start": start, "missed": missed} | COMMON[name]
    modes = same_as_quickest(decider, seed=3, ticks=300, **given)
    assert len(set(modes)) > 1


@pytest.mark.parametrize("rule", [BeamDecider, RestartDecider])
def test_rules_that_filter_the_measurements(rule):
    options = COMMON["aircraft"]
    same_as_quickest(rule(QuickestOptions(**options)), seed=2, ticks=100, **options)


@pytest.mark.parametrize(
    ("name", "bank", "follow", "missed"),
    [
        ("axes", "published", "bank", 0.2),
        ("car", "published", "declared", 0.0),
        ("ship", "anchor_aware", "bank", 0.0),
        ("aircraft", "anchor_aware", "declared", 0.2),
    ],
)
def test_known_switch_moments(name, bank, follow, missed):
    decided = same_as_announced(
        MSPRTDecider(0.02), seed=4, bank=bank, follow=follow, missed=missed, **COMMON[name]
    )
    assert len(decided) == 6
    assert len({mode for mode, _ in decided}) > 1


def test_a_rule_with_filters_of_its_own():
    options = COMMON["axes"]
    decider = RefilteringDecider(WorldOptions(**options), bank="published", propagates=False)
    same_as_announced(decider, seed=7, **options)


@pytest.mark.parametrize(("undecided", "follow"), [("likeliest", "bank"), ("keep", "declared")])
def test_segments_that_end_undecided(undecided, follow):
    decided = same_as_announced(FixedTimeDecider(1000), seed=0, undecided=undecided, follow=follow)
    assert all(forced for _, forced in decided)
    assert ({mode for mode, _ in decided} == {0}) == (undecided == "keep")
