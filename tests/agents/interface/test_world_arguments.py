"""Flags of the options of every environment."""

import json

from agents.interface.world_arguments import WorldArguments, option_names, print_options

QUICKEST = "HybridTrackQuickest-v0"


def test_a_run_folder_brings_the_options_of_its_environment(tmp_path):
    card = {
        "environment": f"hybrid_env:{QUICKEST}",
        "options": {"durations": "geometric 9", "ticks": 50},
    }
    (tmp_path / "policy.json").write_text(json.dumps(card))
    world = WorldArguments(ticks=60, tau=0.2).world_of(str(tmp_path))

    assert world == (card["environment"], {"durations": "geometric 9", "ticks": 60, "tau": 0.2})


def test_the_options_of_an_environment_have_its_defaults(capsys):
    print_options(["--env", QUICKEST])
    printed = capsys.readouterr().out

    for name in option_names(QUICKEST):
        assert f"--{name.replace('_', '-')} " in printed
    # That of this environment only.
    assert "25 + geometric 50" in printed
    assert "--delay-cost" not in printed
