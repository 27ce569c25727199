"""The flag --error of evaluate, play and track."""

import pytest

from agents.evaluation.registry import ErrorArguments
from agents.recordings.tracking import TrackingArguments
from agents.studies.evaluate_command import Evaluate
from hybrid_env.checks import ArgumentError


def test_a_rate_is_the_ending_of_the_name():
    assert ErrorArguments().at_error("shipped:0.1") == "shipped:0.1"
    assert ErrorArguments(error="2%").at_error("shipped") == "shipped:2%"


@pytest.mark.parametrize(
    ("error", "decider", "named"),
    [("0.02", "ate", "error='0.02'"), ("auto", "ate", "error='auto'"), ("2%", "ate:1e-6", "decider='ate:1e-6'"),
     ("60%", "ate", r"decider='ATE \(SPRT\):60%'"), ("2/1000", "ate", r"decider='ATE \(SPRT\):2/1000'")],
)  # fmt: skip
def test_what_is_no_rate_is_refused(error, decider, named):
    with pytest.raises(ArgumentError, match=f"^{named} is not allowed"):
        Evaluate(deciders=(decider,), error=error, episodes=1, jobs=1).run()


def test_a_recording_is_decided_at_a_rate():
    asked = TrackingArguments(lengths=(50,), error="2%", radii=(5.0,))
    asked.check_tracking()
    with pytest.raises(ArgumentError, match="expected a rate"):
        TrackingArguments(error="2").check_tracking()
