"""The benchmark compares like with like, and counts what it says; no time is asserted."""

import json

import numpy as np
import pytest

from agents.benchmark import measurements as benchmark
from agents.benchmark.measurements import Measurement, faster, in_turn, seconds_per_call
from agents.benchmark.peers import FilterpyBank, NumpyBank
from agents.benchmark.report import markdown
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
    in_turn(lambda: calls.append("A"), lambda: calls.append("B"), repetitions=2, least=1e-9)
    order = "".join(side for k, side in enumerate(calls) if k == 0 or calls[k - 1] != side)
    assert order == "ABABAB"  # once each before, then two pairs


def test_a_ratio_is_the_median_over_pairs_with_its_range():
    one = faster("g", "n", [1.0, 2.0, 1.0], [3.0, 4.0, 5.0], goal=2.5, share=1.0)
    assert (one.value, one.low, one.high) == (3.0, 2.0, 5.0)
    assert one.met is True
    assert faster("g", "n", [1.0], [3.0], goal=6.5, share=2.0).met is False
    assert Measurement("g", "n", 7.0, 7.0, 7.0, "%", 8.0, at_most=True).met is True
    assert Measurement("g", "n", 7.0, 7.0, 7.0, "").met is None


def test_calls_are_counted():
    calls = []
    assert seconds_per_call(lambda: calls.append(1), least=1e-4) > 0
    assert len(calls) > 1


def test_world_ticks_count_what_is_fast_forwarded():
    env = make_vector_env("hybrid_env:HybridTrack-v0", 400, tick_info=False)
    assert benchmark._Steps(env, 0.0).ticks_per_step == 1.0
    # a declaration in 25 at tick k of a segment of 75 runs 75 - k ticks more, k about 19 on average:
    # (1 + 56 / 25) a step, give or take a tenth for the segments' lengths and the start
    assert benchmark._Steps(env, 0.04).ticks_per_step == pytest.approx(3.2, rel=0.15)


def test_the_command_writes_its_table_figure_and_data(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(benchmark, "REPETITIONS", 1)
    monkeypatch.setattr(benchmark, "SECONDS", 1e-4)
    assert main(["bench", "single", "bank", "--out", str(tmp_path)]) == 0
    assert "21 hypotheses" in capsys.readouterr().out
    found = json.loads((tmp_path / "bench.json").read_text())["measurements"]
    assert len(found) == 6
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")
    table = (tmp_path / "bench.md").read_text()
    assert table.count("\n| ") == 7
    assert table == markdown([Measurement(**one) for one in found], table.splitlines()[0].rstrip("."))


@pytest.mark.parametrize("line", ["bench everything", "bench --out bad.txt"])
def test_nonsense_is_refused(line, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.txt").write_text("")
    assert main(line.split()) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
