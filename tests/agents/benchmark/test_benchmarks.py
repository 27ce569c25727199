"""The benchmark measures both sides alike and counts ticks correctly. No time is asserted."""

import json

import numpy as np
import pytest

from agents.benchmark import timing
from agents.benchmark.environments import _Steps
from agents.benchmark.online import CASES, online_tracker
from agents.benchmark.peers import FilterpyBank, NumpyBank
from agents.benchmark.report import markdown
from agents.benchmark.timing import Measurement, measure_in_turn, seconds_per_call, speed_ratio
from agents.cli import main
from baselines.papers.golubkov2018 import START
from hybrid_env import KalmanBank
from hybrid_env.registration import make_vector_env

RADII = (3.0, 5.0, 9.0)


@pytest.mark.parametrize("peer", [NumpyBank, FilterpyBank])
def test_the_bank_and_its_peers_compute_the_same_likelihoods(peer):
    ours, theirs = KalmanBank(RADII), peer(RADII)
    ours.anchor(START)
    generator = np.random.default_rng(5)
    for k in range(30):
        z = np.array([0.0, 0.2 * (k + 1)]) + generator.normal(0, 0.3, 2)
        ours.step(z)
        theirs.step(z)
    np.testing.assert_allclose(ours.log_likelihood, theirs.log_likelihood, rtol=1e-10)


def test_the_two_sides_are_measured_in_turn():
    calls = []
    measure_in_turn(lambda: calls.append("A"), lambda: calls.append("B"), repetitions=2, least=1e-9)
    order = "".join(side for k, side in enumerate(calls) if k == 0 or calls[k - 1] != side)
    assert order == "ABABAB"  # once each before, then two pairs


def test_a_ratio_is_the_median_over_pairs_with_its_range():
    one = speed_ratio("g", "n", [1.0, 2.0, 1.0], [3.0, 4.0, 5.0], goal=2.5, work=1.0)
    assert (one.value, one.low, one.high) == (3.0, 2.0, 5.0)
    assert one.met is True
    assert speed_ratio("g", "n", [1.0], [3.0], goal=6.5, work=2.0).met is False
    assert Measurement("g", "n", 7.0, 7.0, 7.0, "%", 8.0, at_most=True).met is True
    assert Measurement("g", "n", 7.0, 7.0, 7.0, "").met is None


def test_calls_are_counted():
    calls = []
    assert seconds_per_call(lambda: calls.append(1), least=1e-4) > 0
    assert len(calls) > 1


def test_simulated_ticks_include_fast_forwarded_ones():
    env = make_vector_env("hybrid_env:HybridTrack-v0", 400, tick_info=False)
    env.reset(seed=0)
    assert _Steps(env, 0.0).ticks_per_step == 1.0
    # a declaration in 25 at tick k of a segment of 75 runs 75 - k ticks more, k about 19 on average:
    # (1 + 56 / 25) a step, give or take a tenth for the segments' lengths and the start
    env.reset(seed=0)
    assert _Steps(env, 0.04).ticks_per_step == pytest.approx(3.2, rel=0.15)


def test_the_command_writes_table_figure_and_data(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(timing, "REPETITIONS", 1)
    monkeypatch.setattr(timing, "SECONDS", 1e-4)
    assert main(["bench", "single", "quickest", "bank", "--out", str(tmp_path)]) == 0
    assert "21 hypotheses" in capsys.readouterr().out
    found = json.loads((tmp_path / "bench.json").read_text())["measurements"]
    assert len(found) == 9
    assert [one["name"].split(", ")[1] for one in found[2:5]] == ["1 track", "64 tracks", "1,024 tracks"]
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
    table = (tmp_path / "bench.md").read_text()
    assert table.count("\n| ") == 10
    assert table == markdown([Measurement(**one) for one in found], table.splitlines()[0].rstrip("."))


def test_the_tracker_is_measured_with_its_deciders(monkeypatch):
    monkeypatch.setattr(timing, "REPETITIONS", 1)
    monkeypatch.setattr(timing, "SECONDS", 1e-4)
    found = list(online_tracker())
    assert [one.name for one in found] == list(CASES)
    assert all(one.unit == "us" and one.at_most and one.value > 0 for one in found)


@pytest.mark.parametrize("line", ["bench everything", "bench --out bad.txt"])
def test_unknown_groups_and_bad_folders_are_refused(line, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.txt").write_text("")
    assert main(line.split()) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
