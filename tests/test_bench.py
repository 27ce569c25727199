"""The benchmark computes the same as its peer and counts ticks correctly. No time is asserted."""

import json

import numpy as np
import pytest

from hybrid_env import KalmanBank
from hybrid_env.registration import make_vector_env
from tools.bench import timing
from tools.bench.__main__ import main
from tools.bench.environments import Steps
from tools.bench.filters import START, FilterpyBank
from tools.bench.programs import CASES
from tools.bench.timing import Measurement, markdown

RADII = (3.0, 5.0, 9.0)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(timing, "REPETITIONS", 1)
    monkeypatch.setattr(timing, "SECONDS", 1e-4)


def test_the_bank_and_its_peer_compute_the_same_likelihoods():
    ours = KalmanBank(RADII)
    theirs = FilterpyBank(RADII)
    ours.anchor(START)
    generator = np.random.default_rng(5)
    for k in range(30):
        z = np.array([0.0, 0.2 * (k + 1)]) + generator.normal(0, 0.3, 2)
        ours.step(z)
        theirs.step(z)

    np.testing.assert_allclose(ours.log_likelihood, theirs.log_likelihood, rtol=1e-10)


def test_simulated_ticks_include_fast_forwarded_ones():
    env = make_vector_env("hybrid_env:HybridTrackPublished-v0", 400, tick_info=False)
    env.reset(seed=0)

    assert Steps(env, 0.0).ticks_per_step == 1.0
    # A declaration in 25 at tick k of a segment of 75 runs 75 - k ticks more, k about 19 on
    # average: (1 + 56 / 25) a step, give or take a tenth for the segments' lengths and the start.
    env.reset(seed=0)
    assert Steps(env, 0.04).ticks_per_step == pytest.approx(3.2, rel=0.15)


def test_the_benchmark_of_gymnasium_counts_the_steps_of_both_environments(
    monkeypatch,
    capsys,
    tmp_path,
):
    monkeypatch.setattr(timing, "WHOLE_SECONDS", 0)
    main(["gymnasium", "--out", str(tmp_path)])
    found = json.loads((tmp_path / "bench.json").read_text())["measurements"]

    assert [one["name"].split(",")[0] for one in found] == [
        "HybridTrackPublished-v0",
        "CartPole-v1",
    ] * 3
    assert all(one["value"] > 0 and one["unit"] == "steps/s" for one in found)
    assert capsys.readouterr().out.count("steps/s") == 6


def test_groups_are_printed_and_written(short, capsys, tmp_path):
    main(["single", "quickest", "online", "bank", "--out", str(tmp_path)])
    printed = capsys.readouterr().out

    assert "21 hypotheses" in printed
    found = json.loads((tmp_path / "bench.json").read_text())["measurements"]
    assert [one["name"].split(", ")[1] for one in found[2:5]] == [
        "1 track",
        "64 tracks",
        "1,024 tracks",
    ]
    assert [one["name"] for one in found[5:9]] == list(CASES)
    assert len(found) == 11
    assert all(one["value"] > 0 and one["name"] in printed for one in found)
    table = (tmp_path / "bench.md").read_text()
    assert table.count("\n| ") == 12
    assert table == markdown(
        [Measurement(**one) for one in found],
        table.splitlines()[0].rstrip("."),
    )
