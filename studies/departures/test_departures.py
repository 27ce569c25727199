"""A rule that is references of a departure beside one that is not, on the same episodes."""

import json

import pandas as pd
import pytest


def test_the_quick_form_compares_with_the_rule_that_is_told(tmp_path, run_study):
    printed = run_study("departures", "--quick", "--jobs", "1", "--out", str(tmp_path))
    rows = json.loads((tmp_path / "departures.json").read_text())

    assert "Rhythm: durations" in printed
    levels = pd.DataFrame(rows).groupby(["road", "level"], sort=False)
    # Two levels of each road.
    assert len(levels) == 8
    for (road, _), here in levels:
        reference, *others = here.to_dict("records")
        assert [row["decider"] for row in others[1:]] == ["bound"] * ("rhythm" not in road)
        for row in others:
            gap = row["reward"]["value"] - reference["reward"]["value"]
            assert row["gap"]["value"] == pytest.approx(gap)
    assert (tmp_path / "departures.md").read_text().count("|---") == 3 * 4 + 3
    assert (tmp_path / "departures.png").exists()
