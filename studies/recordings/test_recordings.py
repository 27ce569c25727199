"""Simulated recordings, and the tables of the deciders on them."""

import numpy as np
import pytest
from scipy import stats

from studies.recordings.objects import KINDS, TARGETS, record


def test_the_quick_form_compares_two_deciders(quick_study):
    _, rows = quick_study("recordings")
    threshold, steady = rows[:2]
    assert steady["decider"] == "steady"
    assert steady["below_3"]["value"] == 0.0
    difference = steady["agreement"]["value"] - threshold["agreement"]["value"]
    assert steady["right_less_first"]["value"] == pytest.approx(difference)
    for row in rows:
        assert 0.8 < row["agreement"]["value"] < 1.0
        assert 0.0 < row["position"]["value"] < 1.5
        assert row["within_1"]["value"] <= row["within_3"]["value"] <= 1.0
    assert threshold["within_1"]["value"] < threshold["within_3"]["value"] < 1.0
    assert [row["recordings"] for row in rows[::2]] == [
        "all",
        "aircraft, uniform",
        "walker, missing",
    ]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", TARGETS)
def test_rows_move_as_their_modes_say(name, kind):
    target = TARGETS[name]
    times, positions, modes, states = record(name, kind, 3, 2000)
    assert len(times) == len(positions) == len(modes)
    errors = (positions - states[:, ::2]) / target.deviation
    quartile = stats.t.ppf(0.75, 4.0 if kind == "rough" else np.inf)
    # Five standard errors of a median of 4,000 absolute values.
    assert abs(np.median(np.abs(errors)) - quartile) < 5.0 * 0.8 / np.sqrt(errors.size)
    steps = np.diff(times) / target.tau
    assert (steps.min(), steps.max() > 1.2) == {
        "missing": (pytest.approx(1.0), True),
        "irregular": (pytest.approx(0.5), True),
    }.get(kind, (pytest.approx(1.0), False))
    headings = np.unwrap(np.arctan2(states[:, 3], states[:, 1]))
    turned, same = headings[16:] - headings[:-16], modes[16:] == modes[:-16]
    straight, left, right = (turned[same & (modes[16:] == mode)].mean() for mode in "SLR")
    assert abs(straight) < 0.1
    assert left > 0.2
    assert right < -0.2
