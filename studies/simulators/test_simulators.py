"""Worlds of simulators: modes that are commanded, gains on the same paths, closed paths."""

import json

import numpy as np
import pytest

from baselines import Estimate, GivenTracks, ThresholdDecider, measure_statements, record_in
from hybrid_env import ArgumentError
from studies.simulators import seal
from studies.simulators.aircraft import AIRCRAFT
from studies.simulators.paths import CONTROL
from studies.simulators.study import holm, p_value
from studies.simulators.worlds import World


def test_p_values_of_intervals_and_their_correction():
    assert p_value(Estimate(1.96, 0.0, 3.92)) == pytest.approx(0.05, abs=1e-3)
    assert p_value(Estimate(-1.0, -1.1, -0.9)) < 1e-10
    assert holm([0.04, 0.001, 0.02, 0.5]) == [False, True, False, False]
    assert holm([0.01, 0.02, 0.03]) == [True] * 3
    assert holm([0.2, 0.3]) == [False, False]


def test_statements_follow_the_commands():
    pytest.importorskip("jsbsim")
    world = World("fighter", 1.0, 20.0, minutes=4.0)
    deciders = [ThresholdDecider(0.6), ThresholdDecider(1.0)]
    statements = record_in(lambda: GivenTracks(world.travel, world.options(), 3), deciders, 4)
    right = [measure_statements(each).right.mean() for each in statements]

    assert right[0] > 0.7 > right[1]
    for track in range(3):
        modes = AIRCRAFT["fighter"].travel(4 + track, 240.0).modes
        moments = np.round(np.arange(1, 241) / CONTROL).astype(int)
        commanded = modes[np.minimum(moments, len(modes) - 1)]
        assert np.mean(statements[0].true_modes[:, track] == commanded) > 0.99


def test_the_quick_form_compares_in_a_world(tmp_path, run_study):
    pytest.importorskip("jsbsim")
    flags = "--quick --simulators jsbsim --deciders robust threshold cusum --jobs 1 --out"
    printed = run_study("simulators", *flags.split(), str(tmp_path))
    content = json.loads((tmp_path / "simulators.json").read_text())

    (row,) = content["worlds"]
    assert row["world"] == "fighter, 2 s, 320 m"
    assert min(row["nominal"]["value"], row["likeliest"]["value"]) > 0.2
    best = max(rule["value"] for rule in row["rules"].values())
    assert row["gain"]["value"] == pytest.approx(row["likeliest"]["value"] - best)
    assert 0.7 < row["mismatch"] < 1.1
    assert content["counts"]["worlds"] == 1
    assert "by Holm's" in printed
    assert (tmp_path / "simulators.png").exists()


def test_closed_paths_are_opened_by_an_unbroken_seal_only(tmp_path, monkeypatch):
    kept = json.loads(seal.SEAL.read_text())
    now = seal.current_seal()
    assert {part: kept[part] for part in ("code", "weights")} == {
        part: now[part] for part in ("code", "weights")
    }
    copy = tmp_path / "sealed.json"
    monkeypatch.setattr(seal, "SEAL", copy)
    copy.write_text(json.dumps(now))
    assert seal.first_closed_path() == seal.CLOSED
    now["code"]["cars"] = "0" * 64
    copy.write_text(json.dumps(now))
    with pytest.raises(ArgumentError, match=r"cars differ from sealed\.json"):
        seal.first_closed_path()
