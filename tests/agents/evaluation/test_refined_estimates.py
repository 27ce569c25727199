"""What recalculated estimates and a refined radius bring, for objects from a walker to an
aircraft.
"""

import numpy as np
import pytest
from recorded_tracks import OBJECTS

from agents.evaluation.registry import find_decider, needed_options
from agents.evaluation.task import sweep
from agents.evaluation.tasks import task_of
from baselines.scoring.decisions import RMSE

# Of the radii of bank and object.
FACTORS = np.array([0.5, 0.7, 1.0, 1.4, 2.0])
CHANGES = {
    "neither": {},
    "recalculation": {"recalculation": True},
    "refined radius": {"refine_radius": True},
    "both": {"recalculation": True, "refine_radius": True},
}


def world(one, decider):
    """Options of the environment of an object; nothing in them depends on its units."""
    variance = one.measurement_variance
    options = {
        "speed": one.speed,
        "tau": one.tau,
        "radii": tuple(one.radius * FACTORS),
        "correctness": "type",
        "measurement_variance": variance,
        "process_variance": one.process_variance,
        "initial_error": (0.3, 0.002 * variance / one.tau**2),
        "reset_covariance": False,
        "delay_cost": 0.01,
    }
    return options | needed_options(decider, "announced")


def errors(name, decider, episodes):
    """Return RMSE and its paired difference, over sqrt(R), of every change."""
    found = {}
    first = None
    for change, options in CHANGES.items():
        task = task_of(
            "hybrid_env:HybridTrackPublished-v0",
            world(OBJECTS[name], decider) | options,
        )
        family, threshold = find_decider(decider, task.options)
        scores = sweep(task, family, episodes, 0, lambda share: None, (threshold,))
        first = first or scores
        value, difference = scores.estimate(RMSE), scores.difference(first, RMSE)
        found[change] = (
            np.array([value.value, *vars(difference).values()]) / OBJECTS[name].deviation
        )
    return found


@pytest.mark.parametrize("name", ["walker", "aircraft"])
def test_both_reduce_the_error(name):
    found = errors(name, "ate", 40)
    for change in ("recalculation", "refined radius", "both"):
        assert found[change][3] < 0.0, change

    assert found["both"][0] < 0.5 * found["neither"][0]


@pytest.mark.study
@pytest.mark.parametrize("decider", ["ate", "msprt", "msprt-aware"])
@pytest.mark.parametrize("name", OBJECTS)
def test_table_of_the_errors(name, decider):
    found = errors(name, decider, 1000)
    cells = [
        f"{value:.2f}" if change == "neither" else f"{value:.2f} ({low:+.2f} to {high:+.2f})"
        for change, (value, _, low, high) in found.items()
    ]
    print(f"\n| `{decider}` | {name} | {' | '.join(cells)} |")

    assert found["both"][3] < 0.0
