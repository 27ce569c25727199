import json

import pytest

from agents.evaluation import simulators
from agents.studies import simulators_study
from agents.studies.compare_command import Compare
from agents.studies.simulators_study import holm, p_value
from baselines.recordings.simulators import tracks
from baselines.rules import seeds
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import ArgumentError


def test_p_values_of_intervals_and_their_correction():
    assert p_value(Estimate(1.96, 0.0, 3.92)) == pytest.approx(0.05, abs=1e-3)
    assert p_value(Estimate(-1.0, -1.1, -0.9)) < 1e-10
    assert holm([0.04, 0.001, 0.02, 0.5]) == [False, True, False, False]
    assert holm([0.01, 0.02, 0.03]) == [True] * 3
    assert holm([0.2, 0.3]) == [False, False]


def test_command_compares_in_every_world(tmp_path, monkeypatch, capsys):
    pytest.importorskip("jsbsim")
    monkeypatch.setattr(tracks, "MINUTES", 3.0)
    worlds = simulators.simulator_worlds()
    few = {name: worlds[name] for name in ("airliner, 3.2 s, 20 m", "airliner, 3.2 s, 500 m")}
    monkeypatch.setattr(simulators, "simulator_worlds", lambda modules: few)
    Compare(
        simulators=("jsbsim",),
        deciders=("shipped", "threshold"),
        episodes=2,
        jobs=1,
        out=tmp_path,
    ).run()
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


def test_closed_paths_are_opened_by_an_unbroken_seal_only(tmp_path, monkeypatch):
    assert simulators_study.first_seed(7, 40, sealed=False) == 7
    with pytest.raises(ArgumentError, match="seed=7000000000"):
        simulators_study.first_seed(seeds.SEALED, 40, sealed=False)
    with pytest.raises(ArgumentError, match="no value with --sealed"):
        simulators_study.first_seed(7, 40, sealed=True)
    seal = simulators_study.current_seal()
    kept = tmp_path / "sealed_simulators.json"
    monkeypatch.setattr(simulators_study, "SEAL", kept)
    kept.write_text(json.dumps(seal))
    assert simulators_study.first_seed(0, 40, sealed=True) == seeds.SEALED
    seal["code"]["cars"] = "0" * 64
    kept.write_text(json.dumps(seal))
    with pytest.raises(ArgumentError, match=r"cars differ from sealed_simulators\.json"):
        simulators_study.first_seed(0, 40, sealed=True)


def test_the_seal_of_the_package_is_that_of_its_code():
    seal = json.loads(simulators_study.SEAL.read_text())
    found = simulators_study.current_seal()

    assert {part: seal[part] for part in ("code", "weights")} == {
        part: found[part] for part in ("code", "weights")
    }
    assert all(
        found["programs"][name] in ("missing", text) for name, text in seal["programs"].items()
    )
