import json

import pytest

from agents.evaluation import simulators
from agents.studies import simulators_study
from agents.studies.compare_command import Compare
from agents.studies.simulators_study import holm, p_value
from baselines.recordings.simulators import tracks
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import ArgumentError


def test_p_values_of_intervals_and_their_correction():
    assert p_value(Estimate(1.96, 0.0, 3.92)) == pytest.approx(0.05, abs=1e-3)
    assert p_value(Estimate(-1.0, -1.1, -0.9)) < 1e-10
    assert holm([0.04, 0.001, 0.02, 0.5]) == [False, True, False, False]
    assert holm([0.01, 0.02, 0.03]) == [True] * 3
    assert holm([0.2, 0.3]) == [False, False]


def test_worlds_tell_deciders_what_is_flown():
    worlds = simulators.simulator_worlds()
    assert len(worlds) == 27
    task = worlds["airliner, 1.6 s, 100 m"]
    assert task.options.variances[0] == 100.0**2
    assert task.options.law.mean_duration * 1.6 == pytest.approx(3.0 * 8100.7 / 0.95 / 192.5, rel=0.02)
    factors = [one.get("process_variance", 1.0) for one in task.settings()]
    assert factors[1] / factors[2] == pytest.approx(0.01)


def test_command_compares_in_every_world(tmp_path, monkeypatch, capsys):
    pytest.importorskip("jsbsim")
    monkeypatch.setattr(tracks, "MINUTES", 3.0)
    worlds = simulators.simulator_worlds()
    few = {name: worlds[name] for name in ("airliner, 3.2 s, 20 m", "airliner, 3.2 s, 500 m")}
    for place in (simulators, simulators_study):
        monkeypatch.setattr(place, "simulator_worlds", lambda: few)
    Compare(simulators=True, deciders=("shipped", "threshold"), episodes=2, jobs=1, out=tmp_path).run()
    found = json.loads((tmp_path / "simulators.json").read_text())
    assert [one["world"] for one in found["results"]] == [*few] * 2
    shipped = found["results"][0]
    assert shipped["reward"] == shipped["nominal_reward"] > 0.2
    assert found["worlds"] == 2
    assert all(0.7 < found["mismatches"][name] < 1.1 for name in few)
    assert (tmp_path / "simulators.png").exists()
    assert "by Holm's" in " ".join(capsys.readouterr().out.split())


def test_other_flags_are_refused():
    with pytest.raises(ArgumentError, match="no value with --simulators"):
        Compare(simulators=True, tier=("A",)).run()
    with pytest.raises(ArgumentError, match="no value with --simulators"):
        Compare(simulators=True, speed=3.0).run()
