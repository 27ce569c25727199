"""Flags of the options of every environment."""

import json

import pytest

from agents.interface.world_arguments import WorldArguments
from hybrid_env import HybridTrackQuickestEnv
from hybrid_env.checks import ArgumentError

QUICKEST = "HybridTrackQuickest-v0"


def test_given_flags_become_options_of_the_environment():
    given = {
        "ticks": 40,
        "durations": "uniform 5-9",
        "start": "random",
        "change_cost": 2.0,
        "hazard": 0.1,
    }
    arguments = WorldArguments(env=QUICKEST, radii=(4.0,), **given)

    assert arguments.world_options() == given | {"radii": (4.0,)}
    env = HybridTrackQuickestEnv(**arguments.world_options())
    assert env.options.ticks == 40
    assert WorldArguments(scheme="S5").world_options() == {"scheme": "S5"}


def test_a_run_folder_brings_the_options_of_its_environment(tmp_path):
    card = {
        "environment": f"hybrid_env:{QUICKEST}",
        "options": {"durations": "geometric 9", "ticks": 50},
    }
    (tmp_path / "policy.json").write_text(json.dumps(card))
    world = WorldArguments(ticks=60, tau=0.2).world_of(str(tmp_path))

    assert world == (
        card["environment"],
        {
            "durations": "geometric 9",
            "ticks": 60,
            "tau": 0.2,
        },
    )
    with pytest.raises(ArgumentError, match=r"^scheme='S5' is .*HybridTrackQuickest-v0 has no"):
        WorldArguments(scheme="S5").world_of(str(tmp_path))
