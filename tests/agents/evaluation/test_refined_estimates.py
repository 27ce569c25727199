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


def world(target, decider):
    """Options of the environment of an object; nothing in them depends on its units."""
    variance = target.measurement_variance
    options = {
        "speed": target.speed,
        "tau": target.tau,
        "radii": tuple(target.radius * FACTORS),
        "correctness": "type",
        "measurement_variance": variance,
        "process_variance": target.process_variance,
        "initial_error": (0.3, 0.002 * variance / target.tau**2),
        "reset_covariance": False,
        "delay_cost": 0.01,
    }
    return options | needed_options(decider, "announced")


def errors(name, decider, episodes):
    """Return RMSE and its paired difference, over sqrt(R), of every change."""
    results = {}
    first = None
    for change, options in CHANGES.items():
        task = task_of(
            "hybrid_env:HybridTrackPublished-v0",
            world(OBJECTS[name], decider) | options,
        )
        at_default = find_decider(decider, task.options)
        scores = sweep(task, at_default, episodes, 0, thresholds=(at_default.threshold,))
        first = first or scores
        value, difference = scores.estimate(RMSE), scores.difference(first, RMSE)
        results[change] = (
            np.array([value.value, *vars(difference).values()]) / OBJECTS[name].deviation
        )
    return results


@pytest.mark.parametrize("name", ["walker", "aircraft"])
def test_both_reduce_the_error(name):
    results = errors(name, "ate", 40)
    for change in ("recalculation", "refined radius", "both"):
        assert results[change][3] < 0.0, change

    assert results["both"][0] < 0.5 * results["neither"][0]
