"""Arguments of rules that are out of range are refused in one line that names them."""

from functools import partial

import pytest
from hostile_input import refused

from baselines.rules.beam import BeamDecider
from baselines.rules.change_detection import CusumDecider, ShiryaevRobertsDecider
from baselines.rules.fixed_time import FixedTimeDecider
from baselines.rules.msprt import GapDecider, MSPRTDecider
from baselines.rules.refiltering import KeptCovarianceDecider
from baselines.rules.restarted import GLRDecider, MeanRatioDecider
from baselines.rules.sprt import SPRTDecider
from baselines.rules.threshold import ThresholdDecider
from hybrid_env import QuickestOptions, WorldOptions

NAN = float("nan")
RESTARTED = {
    "threshold": [0.0],
    "margin": [-1.0],
    "window": [0, 10_001],
    "bank": ["oracle", 1],
}
REFUSED = [
    (SPRTDecider, {"alpha": [0.0, 1.0, -0.1, "x"], "beta": [0.9999, 1.0, "x"]}),
    (FixedTimeDecider, {"ticks": [0, -3, 2.5, True, "soon"]}),
    (MSPRTDecider, {"alpha": [0.0, -1.0, 1.5, NAN, 1e-14, "small", True], "by": ["radius"]}),
    (GapDecider, {"gap": [0.0, -2.0, 30.0, float("inf"), None]}),
    (
        partial(KeptCovarianceDecider, WorldOptions()),
        {"alpha": [0.0, 1.5, NAN, "0.1"]},
    ),
    (ThresholdDecider, {"threshold": [1.1], "release": [-0.1]}),
    (CusumDecider, {"threshold": [0.0]}),
    (ShiryaevRobertsDecider, {"threshold": [NAN]}),
    (partial(GLRDecider, QuickestOptions()), RESTARTED),
    (partial(MeanRatioDecider, QuickestOptions()), RESTARTED),
    (
        partial(BeamDecider, QuickestOptions()),
        {
            "branches": [2],
            "threshold": [2.0],
            "durations": ["often"],
        },
    ),
]
CASES = [
    (rule, name, value) for rule, bad in REFUSED for name, values in bad.items() for value in values
]


@pytest.mark.parametrize(("rule", "name", "value"), CASES)
def test_arguments_out_of_range_are_refused(rule, name, value):
    assert f"{name}=" in refused(rule, **{name: value})
