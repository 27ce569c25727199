"""Worlds of simulators: gains on the same paths, and the seal."""

import json

import pytest

from baselines import Estimate
from studies.seal import current_seal
from studies.simulators.__main__ import SEAL
from studies.simulators.study import holm, p_value


def test_p_values_of_intervals_and_their_correction():
    assert p_value(Estimate(1.96, 0.0, 3.92)) == pytest.approx(0.05, abs=1e-3)
    assert p_value(Estimate(-1.0, -1.1, -0.9)) < 1e-10
    assert holm([0.04, 0.001, 0.02, 0.5]).tolist() == [False, True, False, False]


def test_the_quick_form_compares_in_a_world(tmp_path, quick_study):
    pytest.importorskip("jsbsim")
    flags = "robust", "threshold", "--simulators", "jsbsim"
    printed, content = quick_study("simulators", *flags)

    (row,) = content["worlds"]
    assert row["world"] == "fighter, 2 s, 320 m"
    assert min(row["nominal"]["value"], row["likeliest"]["value"]) > 0.2
    best = max(rule["value"] for rule in row["rules"].values())
    assert row["gain"]["value"] == pytest.approx(row["likeliest"]["value"] - best)
    assert 0.7 < row["mismatch"] < 1.1
    assert "by Holm's" in printed
    assert (tmp_path / "simulators.png").exists()


def test_the_seal_is_that_of_the_code():
    kept, present = json.loads(SEAL.read_text()), current_seal(SEAL)
    assert [kept[part] for part in ("code", "weights")] == [present["code"], present["weights"]]
