"""Types and radii named after switches at unknown moments."""

import numpy as np

from agents.evaluation.curves import Selected
from agents.evaluation.task import gather
from agents.evaluation.tasks import task_of
from baselines.rules.decider import DeciderFamily
from baselines.scoring.statements import IDENTIFICATION, Statements


def test_a_wrong_radius_names_the_type_only():
    # 0 straight, 1 and 2 left, 3 and 4 right.
    task = task_of("HybridTrackQuickestBank-v0", {"radii": (2.0, 5.0)})
    true = np.repeat([0, 1, 3, 0], 10)[:, None]
    stated = np.repeat([0, 2, 3, 0], 10)[:, None]
    late = np.roll(stated, 4, axis=0)
    late[:4] = 0
    families = DeciderFamily("x", "p", (0.1, 0.2), 0.1, lambda threshold: None)
    found = [[task.measured(Statements(true, one))] for one in (stated, late)]
    scores = gather(task, families, families.thresholds, found)
    figures = {
        word: {name: scores.curve(one) for name, one in of.items()}
        for word, of in IDENTIFICATION.items()
    }

    np.testing.assert_allclose(figures["type"]["identified"], 1.0)
    np.testing.assert_allclose(figures["type"]["delay"], [0.0, 4.0])
    np.testing.assert_allclose(figures["mode"]["identified"], 2 / 3)
    np.testing.assert_allclose(
        scores.extra["named_within"][1, :, 3:5],
        [[0.0, 1.0], [0.0, 2 / 3]],
    )
    panels = task.panels({"x": [Selected(scores, 1)]})
    np.testing.assert_allclose(
        panels[3].curves[0].y[3:5],
        [0.0, 200 / 3],
    )
    (table,) = task.further_tables([scores.at(1)], {})
    assert [column._cells[0].split("\n")[0] for column in table.columns] == [
        "x",
        "100.0",
        "4.0",
        "66.7",
        "4.0",
    ]
