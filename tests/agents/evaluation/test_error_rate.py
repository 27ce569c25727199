"""The flag --error of evaluate, play and track."""

from agents.evaluation.registry import ErrorArguments


def test_a_rate_is_the_ending_of_the_name():
    assert ErrorArguments().at_error("shipped:0.1") == "shipped:0.1"
    assert ErrorArguments(error="2%").at_error("shipped") == "shipped:2%"
