"""Steps of information with gains that add up."""

import numpy as np
import pytest

from studies.limits.study import STEPS


@pytest.mark.parametrize("flags", [[], ["--unknown"]])
def test_the_quick_form_writes_its_files(flags, quick_study):
    _, rows = quick_study("limits", *flags)
    rewards = [row["reward"]["value"] for row in rows["steps"]]
    gains = [row["gain"] and row["gain"]["value"] for row in rows["steps"]]
    assert np.diff(rewards) == pytest.approx(gains[1:])
    steps = [row["step"] for row in rows["steps"]]
    if flags:
        assert len(rewards) == 4
        return
    assert steps == list(STEPS)
    *below, bound = rows["bound"][:4]
    assert bound["step"] == "bound"
    for row in below:
        assert row["gain"]["value"] == pytest.approx(
            row["reward"]["value"] - bound["reward"]["value"]
        )
    # The more a bank knows of the anchor, the sooner the MSPRT decides.
    times = [row["time_95"]["value"] for row in rows["rules"] if row["rule"] == "MSPRT"]
    assert times == sorted(times, reverse=True)
