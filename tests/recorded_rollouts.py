"""A decider on an environment, tick by tick."""

import copy

import numpy as np

from baselines import rollout


def recorded(env, decider, ticks, seed=3):
    """Return what a decider observes, (T, N, width), its actions (T, N), and its T states after
    them.
    """
    seen, actions, states = [], [], []
    for now in rollout(env, decider, seed):
        if now.step:
            actions.append(now.actions)
            states.append(copy.deepcopy(now.state))
        if now.step == ticks:
            return np.array(seen), np.array(actions), states
        seen.append(now.seen.copy())
