"""Scores of statements of any origin: cases counted by hand."""

import numpy as np
import pytest

from baselines.scoring.score import score


def values(*arguments, name="statements", **options):
    statistics = score(*arguments, **options).estimates[name]
    return {key: estimate.value for key, estimate in statistics.items()}


def test_a_case_counted_by_hand():
    # Truth:      A A A A B B B B C C D D D   (the last is the end) statements: A C A A A A B B B B
    # D D D   C is false, B is 2 late, C is missed, D is right at once.
    times = np.arange(13) * 10.0
    statistics = values(times, list("AAAABBBBCCDDD"), list("ACAAAABBBBDDD"), per=60.0)

    assert np.isnan(statistics.pop("false_alarms"))
    assert statistics == pytest.approx(
        {
            "agreement": 7 / 12,
            "delay": (20.0 + 0.0) / 2,
            "misses": 1 / 3,
            "full_delay": (20.0 + 20.0 + 0.0) / 3,
            "false_changes": 1 / 120.0 * 60.0,
            "false_per_1000": 1000.0 / 12,
            "changes_per_switch": 4 / 3,
        }
    )


def test_switches_are_as_good_as_samples_and_statements_have_their_own_times():
    # Right in 0-30 and 33-60; the alarm from 10 to 11 is false; the end is 100.
    modes = ["straight", "left", "straight", "left"]
    switches = values(
        [0.0, 30.0, 100.0],
        ["straight", "left", "left"],
        modes,
        statement_times=[0.0, 10.0, 11.0, 33.5],
        per=1.0,
    )
    times = np.arange(0.0, 100.5, 0.5)
    stated = ((times >= 10.0) & (times < 11.0)) | (times >= 33.5)
    samples = values(times, np.where(times < 30.0, 0, 1), stated.astype(float), per=1.0)
    for statistics in (switches, samples):
        assert statistics["agreement"] == pytest.approx(1.0 - 4.5 / 100.0)
        assert statistics["delay"] == pytest.approx(3.5)
        assert statistics["false_changes"] == pytest.approx(0.01)
    listed = values([0.0, 30.0, 100.0], [0, 1, 1], stated, statement_times=times)
    assert listed["false_per_1000"] == pytest.approx(1000.0 / 200)


def test_what_is_not_known_is_not_scored_and_nothing_stated_is_not_right():
    truth = ["a", "a", None, "", "a", "b", "b", "b"]
    stated = [None, "a", "b", "b", "a", "a", np.nan, "b"]
    statistics = values(np.arange(8.0), truth, stated, per=1.0)

    # Right in 1-2 and 4-5, of five intervals.
    assert statistics["agreement"] == pytest.approx(2 / 5)
    assert statistics["delay"] == 2.0
    # b is stated where nothing is scored.
    assert statistics["false_changes"] == 0.0
    late = values([0.0, 10.0], ["a", "a"], ["a"], statement_times=[4.0])
    assert late["agreement"] == pytest.approx(0.6)


def tracks(count, switches, late, seed=0):
    """Times, truth and statements that are late by as many samples."""
    generator = np.random.default_rng(seed)
    steps = generator.integers(1, 3, (count, switches + 1)).cumsum(1) % 3
    truth = np.repeat(steps, 10, axis=1)
    stated = np.concatenate([np.repeat(truth[:, :1], late, axis=1), truth[:, :-late]], axis=1)
    return [np.arange(truth.shape[1], dtype=float)] * count, list(truth), list(stated)


def test_differences_are_paired_over_tracks():
    times, truth, slow = tracks(9, 8, 4)
    fast = tracks(9, 8, 1)[2]
    fast[0] = slow[0]
    result = score(times, truth, {"fast": fast, "slow": slow, "again": fast})
    less = result.differences["slow"]["delay"]
    same = result.differences["again"]["delay"]

    assert result.unit == "tracks"
    assert less.value == pytest.approx(8 / 9 * 3.0)
    assert 0.0 < less.low < less.value < less.high <= 3.0
    assert (same.low, same.value, same.high) == (0.0, 0.0, 0.0)
    assert result.as_json()["less_first"]["slow"]["delay"]["value"] == less.value


def test_a_single_track_has_intervals_over_blocks_if_it_is_long():
    times, truth, stated = tracks(1, 100, 2)
    stated[0][500:510] = (truth[0][500:510] + 1) % 3
    whole = score(times[0], truth[0], stated[0])
    counts = whole.scores["statements"]

    assert whole.unit == "20 blocks"
    assert whole.estimates["statements"]["false_changes"].high > 0.0
    assert counts.of("switches", 0).sum() == 100
    assert counts.of("scored", 0).sum() == times[0][-1]
