"""Scores of statements of any origin: cases counted by hand."""

import datetime

import numpy as np
import pytest

from baselines.scoring.score import score


def values(result, name="statements"):
    return {key: estimate.value for key, estimate in result.estimates[name].items()}


def test_a_case_counted_by_hand():
    # Truth:      A A A A B B B B C C D D D   (the last is the end) statements: A C A A A A B B B B
    # D D D   C is false, B is 2 late, C is missed, D is right at once.
    figures = values(
        score(
            np.arange(13) * 10.0,
            list("AAAABBBBCCDDD"),
            list("ACAAAABBBBDDD"),
            per=60.0,
        )
    )
    assert figures["agreement"] == pytest.approx(7 / 12)
    assert figures["delay"] == pytest.approx((20.0 + 0.0) / 2)
    assert figures["misses"] == pytest.approx(1 / 3)
    assert figures["full_delay"] == pytest.approx((20.0 + 20.0 + 0.0) / 3)
    assert figures["false_changes"] == pytest.approx(1 / 120.0 * 60.0)
    assert figures["false_per_1000"] == pytest.approx(1000.0 / 12)
    assert figures["changes_per_switch"] == pytest.approx(4 / 3)
    assert np.isnan(figures["false_alarms"])


def test_false_alarms_are_counted_in_the_time_of_normal_operation():
    # C is one, A in B is none; the last is no time.
    truth = list("AAAABBBBCCAA")
    stated = list("ACAABBABCCAB")
    figures = values(
        score(
            np.arange(12) * 10.0,
            truth,
            stated,
            per=60.0,
            normal="A",
        )
    )

    assert figures["false_changes"] == pytest.approx(3 / 110.0 * 60.0)
    assert figures["false_alarms"] == pytest.approx(2 / 50.0 * 60.0)


def test_switches_are_as_good_as_samples_and_statements_have_their_own_times():
    # Right in 0-30 and 33-60; the alarm from 10 to 11 is false; the end is 100.
    switches = score(
        [0.0, 30.0, 100.0],
        ["straight", "left", "left"],
        ["straight", "left", "straight", "left"],
        statement_times=[0.0, 10.0, 11.0, 33.5],
        per=1.0,
    )
    times = np.arange(0.0, 100.5, 0.5)
    truth = np.where(times < 30.0, 0, 1)
    stated = ((times >= 10.0) & (times < 11.0)) | (times >= 33.5)
    samples = score(times, truth, stated.astype(float), per=1.0)
    for result in (switches, samples):
        figures = values(result)
        assert figures["agreement"] == pytest.approx(1.0 - 4.5 / 100.0)
        assert figures["delay"] == pytest.approx(3.5)
        assert figures["false_changes"] == pytest.approx(0.01)
    listed = score(
        [0.0, 30.0, 100.0],
        [0, 1, 1],
        stated,
        statement_times=times,
    )

    assert values(listed)["false_per_1000"] == pytest.approx(1000.0 / 200)


def test_an_early_statement_is_neither_false_nor_late_and_an_unfinished_switch_is_no_miss():
    early = values(
        score(
            np.arange(8),
            [0, 0, 0, 0, 1, 1, 1, 1],
            [0, 0, 0, 1, 1, 1, 1, 1],
            per=1.0,
        )
    )
    assert (early["delay"], early["false_changes"]) == (0.0, 0.0)
    never = values(
        score(
            np.arange(8),
            [0, 0, 0, 0, 1, 1, 1, 1],
            np.zeros(8),
            per=1.0,
        )
    )
    assert np.isnan(never["misses"])
    assert never["full_delay"] == 3.0


def test_what_is_not_known_is_not_scored_and_nothing_stated_is_not_right():
    truth = ["a", "a", None, "", "a", "b", "b", "b"]
    scores = score(
        np.arange(8.0),
        truth,
        [None, "a", "b", "b", "a", "a", np.nan, "b"],
        per=1.0,
    )

    assert scores.scores["statements"].of("scored", 0).tolist() == [5.0]
    figures = values(scores)
    # 1-2 and 4-5.
    assert figures["agreement"] == pytest.approx(2 / 5)
    assert figures["delay"] == 2.0
    # b is stated where nothing is scored.
    assert figures["false_changes"] == 0.0
    late = values(
        score(
            [0.0, 10.0],
            ["a", "a"],
            ["a"],
            statement_times=[4.0],
        )
    )
    assert late["agreement"] == pytest.approx(0.6)


def tracks(count, switches, late, seed=0):
    """Times, truth and statements that are late by as many samples."""
    generator = np.random.default_rng(seed)
    steps = generator.integers(1, 3, (count, switches + 1)).cumsum(1) % 3
    truth = np.repeat(steps, 10, axis=1)
    times = [np.arange(truth.shape[1], dtype=float)] * count
    return (
        times,
        list(truth),
        [np.concatenate([np.repeat(modes[:1], late), modes[:-late]]) for modes in truth],
    )


def test_differences_are_paired_over_tracks():
    times, truth, slow = tracks(9, 8, 4)
    fast = tracks(9, 8, 1)[2]
    fast[0] = slow[0]
    result = score(times, truth, {"fast": fast, "slow": slow})

    assert result.unit == "tracks"
    less = result.differences["slow"]["delay"]
    assert less.value == pytest.approx(8 / 9 * 3.0)
    assert 0.0 < less.low < less.value < less.high <= 3.0
    same = score(
        times,
        truth,
        {"fast": fast, "again": fast},
    ).differences["again"]["delay"]
    assert (same.low, same.value, same.high) == (0.0, 0.0, 0.0)
    data = result.as_json()
    assert data["less_first"]["slow"]["delay"]["value"] == less.value
    assert data["figures"]["fast"]["delay"]["low"] <= data["figures"]["fast"]["delay"]["high"]


def test_a_single_track_has_intervals_over_blocks_if_it_is_long():
    times, truth, stated = tracks(1, 100, 2)
    stated[0][500:510] = (truth[0][500:510] + 1) % 3
    whole = score(times[0], truth[0], stated[0])

    assert whole.unit == "20 blocks"
    assert whole.estimates["statements"]["false_changes"].high > 0.0
    counts = whole.scores["statements"]
    assert counts.of("switches", 0).sum() == 100
    assert counts.of("scored", 0).sum() == times[0][-1]
    short = score(*(values[0] for values in tracks(1, 15, 2)))
    assert short.unit == ""
    assert np.isnan(short.estimates["statements"]["delay"].low)
    assert short.as_json()["figures"]["statements"]["delay"] == {
        "value": 2.0,
        "low": None,
        "high": None,
    }


def test_times_may_be_dates():
    start = datetime.datetime(2026, 1, 1)
    dates = [start + datetime.timedelta(seconds=5 * k) for k in range(6)]
    expected = values(
        score(
            np.arange(0, 30, 5),
            list("aabbbb"),
            list("aaabbb"),
        )
    )
    zoned = [date.replace(tzinfo=datetime.UTC) for date in dates]
    for times in (
        dates,
        zoned,
        np.array(dates, "datetime64[us]"),
        [date.isoformat() for date in dates],
    ):
        assert values(
            score(
                times,
                list("aabbbb"),
                list("aaabbb"),
            )
        ) == pytest.approx(
            expected,
            nan_ok=True,
        )


@pytest.mark.parametrize("nothing", [None, "", float("nan")])
def test_a_detector_that_never_states_anything_misses_all(nothing):
    truth = list("AABBCCAA")
    result = score(
        np.arange(8.0),
        truth,
        {"silent": [nothing] * 8, "right": truth},
    )
    figures = values(result, "silent")

    assert (
        figures["agreement"],
        figures["misses"],
        figures["false_changes"],
        figures["changes_per_switch"],
    ) == (0, 1, 0, 0)
    assert np.isnan(figures["delay"])
    assert result.differences["right"]["misses"].value == -1.0
