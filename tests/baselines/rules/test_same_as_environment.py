"""The on-line tracker equals both environments tick by tick, bit for bit."""

import pytest
from online_episodes import COMMON, same_as_announced, same_as_quickest

from baselines import (
    BeamDecider,
    CusumDecider,
    FixedTimeDecider,
    GapDecider,
    GLRDecider,
    MeanRatioDecider,
    MSPRTDecider,
    ShiryaevRobertsDecider,
    SPRTDecider,
    ThresholdDecider,
)
from baselines.rules.refiltering import RefilteringDecider
from hybrid_env import QuickestOptions, WorldOptions

NEVER = FixedTimeDecider(1000)


@pytest.mark.parametrize("start", ["known", "random"])
@pytest.mark.parametrize("name", COMMON)
def test_unknown_switch_moments(name, start):
    modes = same_as_quickest(
        ThresholdDecider(0.6),
        seed=3,
        ticks=300,
        start=start,
        **COMMON[name],
    )
    assert len(set(modes)) > 1


@pytest.mark.parametrize("name", ["R 0.1", "axes", "ship"])
@pytest.mark.parametrize(
    "decider",
    [CusumDecider(), ShiryaevRobertsDecider(), ThresholdDecider(0.9, 0.3)],
)
def test_rules_for_unknown_switch_moments(decider, name):
    same_as_quickest(decider, seed=1, **COMMON[name])


@pytest.mark.parametrize("name", ["R 0.1", "aircraft"])
@pytest.mark.parametrize("rule", [BeamDecider, GLRDecider, MeanRatioDecider])
def test_rules_that_filter_the_measurements(rule, name):
    options = COMMON[name]
    same_as_quickest(rule(QuickestOptions(**options)), seed=2, ticks=100, **options)


@pytest.mark.parametrize("follow", ["declared", "bank"])
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
@pytest.mark.parametrize("name", COMMON)
def test_known_switch_moments(name, bank, follow):
    decided = same_as_announced(
        MSPRTDecider(0.02),
        seed=4,
        bank=bank,
        follow=follow,
        **COMMON[name],
    )
    assert len(decided) == 6
    assert len({mode for mode, _ in decided}) > 1


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
@pytest.mark.parametrize("name", ["R 0.1", "axes", "aircraft"])
@pytest.mark.parametrize("refined", [False, True])
def test_recalculated_and_refined_estimates(name, bank, refined):
    options = {"radii": (3.0, 5.0)} | COMMON[name]
    decided = same_as_announced(
        MSPRTDecider(0.3),
        seed=4,
        bank=bank,
        recalculation=True,
        refine_radius=refined,
        **options,
    )

    assert not all(forced for _, forced in decided)


DECIDERS = {
    "sprt": lambda world: SPRTDecider(),
    "gap": lambda world: GapDecider(),
    "kept": lambda world: RefilteringDecider(world, bank="published", prior=None),
    "calibrated": lambda world: RefilteringDecider(world, prior=None),
}


@pytest.mark.parametrize("name", ["R 0.1", "axes", "car"])
@pytest.mark.parametrize("decider", DECIDERS)
def test_rules_for_known_switch_moments(decider, name):
    same_as_announced(
        DECIDERS[decider](WorldOptions(**COMMON[name])),
        seed=7,
        **COMMON[name],
    )


@pytest.mark.parametrize("follow", ["declared", "bank"])
@pytest.mark.parametrize("undecided", ["likeliest", "keep"])
def test_segments_that_end_undecided(undecided, follow):
    decided = same_as_announced(NEVER, seed=0, undecided=undecided, follow=follow)
    assert all(forced for _, forced in decided)
    assert ({mode for mode, _ in decided} == {0}) == (undecided == "keep")


def test_the_action_that_declares_the_likeliest_hypothesis():
    class BestAt20:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return (observation[:, -10] > 0.195).astype(int), None

    decided = same_as_announced(BestAt20(), seed=5, actions="best", reset_covariance=False)

    assert not any(forced for _, forced in decided)
