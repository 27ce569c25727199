"""Figures, tables and JSON of a comparison, from scores with given means."""

import pytest
from given_scores import ANNOUNCED, UNKNOWN, announced_scores, comparison, unknown_scores

ATE = announced_scores("ATE (SPRT)", [0.7, 0.9, 0.96, 0.985], [15, 20, 26, 32])
PPO = announced_scores("ppo", [0.6, 0.95, 0.99, 1.0], [5, 12, 16, 30])
IMM = unknown_scores(
    "IMM threshold", [16.0, 8.0, 4.0, 1.0], [12, 14, 16, 20], [0.7, 0.75, 0.76, 0.74]
)
BEAM = unknown_scores("beam", [15.0, 7.0, 3.0, 0.7], [11, 13, 15, 19], [0.71, 0.76, 0.78, 0.75])
CUSUM = unknown_scores("CUSUM", [40.0, 20.0, 6.0, 3.0], [13, 15, 19, 30], [0.5, 0.6, 0.7, 0.68])
UNKNOWN_RESULT = comparison(UNKNOWN, IMM, BEAM, CUSUM)


def test_differences_are_to_the_best_rule_and_ratios_to_the_first():
    first, beam, _ = UNKNOWN_RESULT.entries

    assert UNKNOWN_RESULT.best_rule is beam
    assert beam.less(beam) is None
    assert first.less(beam).value == pytest.approx(0.76 - 0.78)
    # 16 + 2 / 3 of 4 at 2 changes of the reference; 15 + 1 / 2.3 of 4 of the beam.
    name = "full_delay_at_equal_wrong_changes"
    ratio = UNKNOWN_RESULT.against["beam"][name]
    assert ratio.value == pytest.approx((15.0 + 4.0 / 2.3) / (16.0 + 8.0 / 3.0))
    # It is never as seldom wrong.
    assert name not in UNKNOWN_RESULT.against["CUSUM"]


def test_the_error_at_the_time_of_the_reference_is_interpolated():
    result = comparison(ANNOUNCED, ATE, PPO, agents=1)
    reference, ppo = result.at_levels.values()
    # At 20 ticks.
    assert reference["equal_time_error"].value == pytest.approx(0.1)
    assert ppo["equal_time_error"].value == pytest.approx(0.01 * 10 / 14)
    assert ppo["ticks_at_95"].value == pytest.approx(12.0)
    paired = result.against["ppo"]
    assert paired["ticks_at_98"].value == pytest.approx((12 + 4 * 0.75) - (26 + 6 * 0.8))
