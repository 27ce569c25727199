"""The threshold of a decider that earns most, on episodes that no report uses."""

from agents.evaluation.task import Task, sweep
from baselines.rules import seeds
from baselines.rules.decider import Decider
from baselines.rules.msprt import ALPHAS, FEW_ALPHAS

# Tried, spread over those of the decider; posteriors use `FEW_ALPHAS`.
MOST_THRESHOLDS = 13


def select_threshold(task: Task, decider: Decider, episodes: int) -> float:
    """Return the threshold with the best mean of the goal, among at most 13 of a decider.

    Args:
        task, decider: see `task_of` and `find_decider`.
        episodes: number of episodes to select on, at most 1,000; they have other seeds than those
            of any report.
    """
    thresholds = FEW_ALPHAS if decider.thresholds == ALPHAS else decider.thresholds
    thresholds = thresholds[:: -(-len(thresholds) // MOST_THRESHOLDS)]
    count = min(episodes, seeds.SELECTION_EPISODES)
    scores = sweep(task, decider, count, seeds.SELECTION, thresholds=thresholds)
    return thresholds[task.best(scores)]
