"""Types and radii named after switches at unknown moments."""

import numpy as np

from agents.evaluation.curves import panels
from agents.evaluation.report import Result
from agents.evaluation.task import sweep, task_of
from baselines.rules.threshold import ThresholdDecider
from baselines.scoring.statements import IDENTIFICATION, Statements


def test_a_wrong_radius_names_the_type_only(monkeypatch):
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
    figures = {
        word: {name: scores.curve(statistic) for name, statistic in of.items()}
        for word, of in IDENTIFICATION.items()
    }

    np.testing.assert_allclose(figures["type"]["identified"], 1.0)
    np.testing.assert_allclose(figures["type"]["delay"], [0.0, 4.0])
    np.testing.assert_allclose(figures["mode"]["identified"], 2 / 3)
    np.testing.assert_allclose(scores.extra["named_within"][1, :, 3:5], [[0.0, 1.0], [0.0, 2 / 3]])
    shown = panels(task, {"x": [Result(task, scores, 1)]})
    np.testing.assert_allclose(shown[3].curves[0].y[3:5], [0.0, 200 / 3])
    further = [*task.estimates(scores, 1).values()][-4:]
    np.testing.assert_allclose([figure.value for figure in further], [1.0, 4.0, 2 / 3, 4.0])
