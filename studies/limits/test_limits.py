"""Steps of information: the same episodes, thresholds from others, gains that add up."""

import json

import numpy as np
import pytest

from baselines import ThresholdDecider, measure_statements, record_statements
from studies.limits import study
from studies.limits.study import BEAM, IMM, LAGS, LATER, STEPS, THRESHOLD


def test_every_step_is_reported_with_a_threshold_from_other_tracks(monkeypatch):
    seen = []
    original = study.sweep

    def counted(task, family, tracks, seed):
        seen.append((tracks, seed))
        return original(task, family, tracks, seed)

    monkeypatch.setattr(study, "sweep", counted)
    rows = study.unknown_steps("uniform 50-100", 0.1, 20, 7)

    assert set(seen) == {
        (50, study.SELECTION),
        (20, 7),
    }
    steps = {row["step"]: row for row in rows}
    assert next(iter(steps)) == IMM
    assert steps[IMM]["threshold"] == 0.0
    tuned = steps[THRESHOLD]
    world = {"durations": "uniform 50-100", "measurement_variance": 0.1}
    metrics = measure_statements(
        record_statements(
            ThresholdDecider(tuned["threshold"]),
            20,
            7,
            **world,
        )
    )
    assert tuned["reward"].value == pytest.approx(metrics.reward.mean())
    right = {step: row["most_probable_right"].value for step, row in steps.items()}
    assert right[BEAM] < right[LATER[LAGS[0]]] < right[LATER[LAGS[-1]]]
    assert rows[-1]["delay"].value < steps[BEAM]["delay"].value


@pytest.mark.parametrize("flags", ["--quick", "--quick --unknown"])
def test_the_quick_form_writes_its_files(flags, tmp_path, run_study):
    printed = run_study("limits", *flags.split(), "--jobs", "1", "--out", str(tmp_path))
    rows = json.loads((tmp_path / "limits.json").read_text())

    assert (tmp_path / "limits.md").read_text() in printed
    assert (tmp_path / "limits.png").exists()
    rewards = [row["reward"]["value"] for row in rows["steps"]]
    gains = [row["gain"] and row["gain"]["value"] for row in rows["steps"]]
    assert gains[0] is None
    assert np.diff(rewards) == pytest.approx(gains[1:])
    if "--unknown" in flags:
        assert "later ticks" in printed
        return
    assert [row["step"] for row in rows["steps"]] == list(STEPS)
    # The more a bank knows of the anchor, the sooner the MSPRT decides.
    times = [row["time_95"]["value"] for row in rows["rules"] if row["rule"] == "MSPRT"]
    assert times == sorted(times, reverse=True)
