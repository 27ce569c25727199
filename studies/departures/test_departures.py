"""A rule that is references of a departure beside one that is not, on the same episodes."""

import json

import pytest


def test_the_quick_form_compares_with_the_rule_that_is_told(tmp_path, run_study):
    printed = run_study("departures", "--quick", "--jobs", "1", "--out", str(tmp_path))
    rows = json.loads((tmp_path / "departures.json").read_text())

    assert "Rhythm: durations" in printed
    references = rows[::2]
    untold = rows[1::2]
    # Two levels of each road.
    assert len(references) == len(untold) == 8
    for reference, decider in zip(references, untold, strict=True):
        assert reference["gap"] is None
        gap = decider["reward"]["value"] - reference["reward"]["value"]
        assert decider["gap"]["value"] == pytest.approx(gap)
    assert (tmp_path / "departures.md").read_text().count("|---") == 3 * 4
    assert (tmp_path / "departures.png").exists()
