import json
import sys

import pytest

from agents.evaluation import simulators
from agents.studies import simulators_study
from agents.studies.compare_command import Compare
from agents.studies.simulators_study import holm, p_value
from baselines.recordings.simulators import tracks
from baselines.rules import seeds
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import ArgumentError
from hybrid_env.extras import OTHER_NAMES, MissingExtraError


def test_p_values_of_intervals_and_their_correction():
    assert p_value(Estimate(1.96, 0.0, 3.92)) == pytest.approx(0.05, abs=1e-3)
    assert p_value(Estimate(-1.0, -1.1, -0.9)) < 1e-10
    assert holm([0.04, 0.001, 0.02, 0.5]) == [False, True, False, False]
    assert holm([0.01, 0.02, 0.03]) == [True] * 3
    assert holm([0.2, 0.3]) == [False, False]


def test_worlds_tell_deciders_what_is_flown():
    worlds = simulators.simulator_worlds()
    assert len(worlds) == 81
    assert {simulators.VEHICLES[task.kind].module for task in worlds.values()} == set(simulators.SIMULATORS)
    assert len(simulators.simulator_worlds(["sumo"])) == 27
    task = worlds["airliner, 1.6 s, 100 m"]
    assert task.options.variances[0] == 100.0**2
    assert task.options.law.mean_duration * 1.6 == pytest.approx(3.0 * 8100.7 / 0.95 / 192.5, rel=0.02)
    factors = [one.get("process_variance", 1.0) for one in task.settings("tracks")]
    assert factors[1] / factors[2] == pytest.approx(0.01)
    assert task.settings("rows")[3] == task.untuned
    assert task.changed(task.untuned).likeliest
    assert task.changed(task.untuned).options == task.options


def test_command_compares_in_every_world(tmp_path, monkeypatch, capsys):
    pytest.importorskip("jsbsim")
    monkeypatch.setattr(tracks, "MINUTES", 3.0)
    worlds = simulators.simulator_worlds()
    few = {name: worlds[name] for name in ("airliner, 3.2 s, 20 m", "airliner, 3.2 s, 500 m")}
    monkeypatch.setattr(simulators, "simulator_worlds", lambda modules: few)
    Compare(simulators=("jsbsim",), deciders=("shipped", "threshold"), episodes=2, jobs=1, out=tmp_path).run()
    found = json.loads((tmp_path / "simulators.json").read_text())
    assert [one["world"] for one in found["results"]] == [*few] * 2
    shipped = found["results"][0]
    assert shipped["threshold"] == shipped["nominal_threshold"]
    assert shipped["setting"] == {"likeliest": True}
    assert min(shipped["reward"], shipped["nominal_reward"]) > 0.2
    assert found["worlds"] == 2
    assert all(0.7 < found["mismatches"][name] < 1.1 for name in few)
    assert (tmp_path / "simulators.png").exists()
    assert "by Holm's" in " ".join(capsys.readouterr().out.split())


def test_other_flags_are_refused():
    with pytest.raises(ArgumentError, match="no value with --simulators"):
        Compare(simulators=(), tier=("A",)).run()
    with pytest.raises(ArgumentError, match="no value with --simulators"):
        Compare(simulators=(), speed=3.0).run()


def test_a_missing_simulator_is_told_in_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "jsbsim", None)
    with pytest.raises(MissingExtraError, match=r"jsbsim is missing: this needs the extra \[simulators\]"):
        Compare(simulators=("jsbsim",)).run()
    assert {OTHER_NAMES[name] for name in ("sumo", "bluesky")} == {"eclipse-sumo", "bluesky-simulator"}


def test_closed_paths_are_opened_by_an_unbroken_seal_only(tmp_path, monkeypatch):
    assert simulators_study.first_seed(7, 40, sealed=False) == 7
    with pytest.raises(ArgumentError, match="seed=7000000000"):
        simulators_study.first_seed(seeds.SEALED, 40, sealed=False)
    with pytest.raises(ArgumentError, match="no value with --sealed"):
        simulators_study.first_seed(7, 40, sealed=True)
    seal, kept = simulators_study.current_seal(), tmp_path / "sealed_simulators.json"
    monkeypatch.setattr(simulators_study, "SEAL", kept)
    kept.write_text(json.dumps(seal))
    assert simulators_study.first_seed(0, 40, sealed=True) == seeds.SEALED
    seal["code"]["cars"] = "0" * 64
    kept.write_text(json.dumps(seal))
    with pytest.raises(ArgumentError, match=r"cars differ from sealed_simulators\.json"):
        simulators_study.first_seed(0, 40, sealed=True)


def test_the_seal_of_the_package_is_that_of_its_code():
    seal, found = json.loads(simulators_study.SEAL.read_text()), simulators_study.current_seal()
    assert {part: seal[part] for part in ("code", "weights")} == {part: found[part] for part in ("code", "weights")}
    assert all(found["programs"][name] in ("missing", text) for name, text in seal["programs"].items())
