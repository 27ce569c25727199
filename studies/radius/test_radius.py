"""The estimated radius beside those of the bank."""

import json

import pandas as pd
import pytest


def test_the_quick_form_compares_the_radii(tmp_path, run_study):
    printed = run_study("radius", "--quick", "--jobs", "1", "--out", str(tmp_path))
    rows = pd.DataFrame(json.loads((tmp_path / "radius.json").read_text()))
    assert (tmp_path / "radius.md").read_text() in printed
    assert (tmp_path / "radius.png").exists()
    errors = rows.assign(error=[error["value"] for error in rows.error])
    last = errors[errors.since == 50].set_index(["ratio", "radius"]).error

    # 5 is a fifth less than 6.25.
    assert last[1.25, "fixed"] == pytest.approx(0.2, abs=0.08)
    assert last[1.25, "estimated"] < 0.5 * last[1.25, "fixed"]
    assert last[1.0, "estimated"] < 0.1
