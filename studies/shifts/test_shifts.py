"""Shifted and random environments, and the differences between deciders in them."""

import pytest

from agents import task_of
from hybrid_env import QuickestOptions
from studies.shifts.worlds import NOMINAL, RHYTHMS, draw_worlds, shifted_worlds


def test_the_quick_form_compares_the_first_decider_with_the_best_other(quick_study):
    _, rows = quick_study("shifts")
    assert [row["world"] for row in rows[::2]] == [NOMINAL, "random world 1"]
    for first, other in zip(rows[::2], rows[1::2], strict=True):
        assert first["best_other"] == "ATE (SPRT)"
        difference = first["reward"]["value"] - other["reward"]["value"]
        assert first["difference"]["value"] == pytest.approx(difference)
        assert first["reward"]["value"] < first["bound"]["value"] + 0.1
    assert rows[0]["threshold"] == rows[0]["nominal_threshold"] == rows[2]["nominal_threshold"]


def test_every_environment_is_a_valid_and_different_one():
    nominal = task_of("HybridTrackPublished-v0").options
    shifted = shifted_worlds(nominal)
    for changes in (*shifted.values(), *draw_worlds(20, 7).values()):
        options = task_of("HybridTrackPublished-v0", changes).options
        assert (options == nominal) == (not changes)
    assert len(shifted) == 25
    habits = shifted_worlds(QuickestOptions())
    assert habits == RHYTHMS
    assert all(task_of("HybridTrackQuickest-v0", changes).options for changes in habits.values())
