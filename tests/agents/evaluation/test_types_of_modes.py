"""Types of modes stated after switches at unknown moments."""

import numpy as np

from agents.evaluation.task import sweep, task_of
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.statements import Statements


def test_a_wrong_radius_states_the_right_type(monkeypatch):
    # 0 straight, 1 and 2 left, 3 and 4 right.
    task = task_of("HybridTrackQuickestBank-v0", {"radii": (2.0, 5.0)})
    true = np.repeat([0, 1, 3, 0], 10)[:, None]
    stated = np.repeat([0, 2, 3, 0], 10)[:, None]
    late = np.roll(stated, 4, axis=0)
    late[:4] = 0
    decider = ThresholdDecider().changed(title="x", thresholds=(0.1, 0.2))
    recorded = [task.measured(Statements(true, statements)) for statements in (stated, late)]
    monkeypatch.setattr(type(task), "record", lambda *_: [recorded.pop(0)])
    scores = sweep(task, decider, 1, 0)
    values = {metric.name: scores.curve(metric.statistic).tolist() for metric in task.shown}

    assert values["missed"] == [1 / 3, 1 / 3]
    assert values["type_missed"] == [0.0, 0.0]
    assert values["type_delay"] == [0.0, 4.0]
