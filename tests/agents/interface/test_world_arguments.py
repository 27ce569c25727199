"""Flags of the options of every environment."""

import json

import pytest

from agents.interface.world_arguments import WorldArguments
from hybrid_env import HybridTrackQuickestEnv, WorldOptions
from hybrid_env.checks import ArgumentError
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import environment_options

QUICKEST = "HybridTrackQuickest-v0"


def test_the_class_of_the_options_tells_the_environments_apart():
    for env_id in ("HybridTrack-v0", "hybrid_env:HybridTrackBank-v0"):
        assert environment_options(env_id) is WorldOptions
    assert environment_options(f"hybrid_env:{QUICKEST}") is QuickestOptions
    with pytest.raises(ArgumentError, match=r"^env='CartPole-v1' is not allowed"):
        environment_options("CartPole-v1")


def test_given_flags_become_options_of_the_environment():
    given = {"ticks": 40, "durations": "uniform 5-9", "start": "random", "change_cost": 2.0, "hazard": 0.1}
    arguments = WorldArguments(env=QUICKEST, radii=(4.0,), **given)
    assert arguments.world_options() == given | {"radii": (4.0,)}
    env = HybridTrackQuickestEnv(**arguments.world_options())
    assert env.options.ticks == 40
    assert WorldArguments(scheme="S5").world_options() == {"scheme": "S5"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"durations": "geometric 9"}, r"^durations='geometric 9' is .*, because HybridTrack-v0 has no such option$"),
        ({"env": "hybrid_env:HybridTrackBank-v0", "ticks": 9}, r"^ticks=9 is .*HybridTrackBank-v0 has no"),
        ({"env": QUICKEST, "recalculation": True}, r"^recalculation=True is .*HybridTrackQuickest-v0 has no"),
        ({"env": QUICKEST, "scheme": "S5"}, r"^scheme='S5' is .*HybridTrackQuickest-v0 has no"),
        ({"env": "CartPole-v1"}, r"^env='CartPole-v1' is not allowed"),
    ],
)
def test_an_option_that_the_environment_does_not_have_is_refused(arguments, message):
    with pytest.raises(ArgumentError, match=message):
        WorldArguments(**arguments).world_options()


def test_a_run_folder_brings_the_options_of_its_environment(tmp_path):
    card = {"environment": f"hybrid_env:{QUICKEST}", "options": {"durations": "geometric 9", "ticks": 50}}
    (tmp_path / "policy.json").write_text(json.dumps(card))
    found = WorldArguments(ticks=60, tau=0.2).world_of(str(tmp_path))
    assert found == (card["environment"], {"durations": "geometric 9", "ticks": 60, "tau": 0.2})
    with pytest.raises(ArgumentError, match=r"^scheme='S5' is .*HybridTrackQuickest-v0 has no"):
        WorldArguments(scheme="S5").world_of(str(tmp_path))
