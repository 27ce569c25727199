"""What a decider declares in the episodes of the environment with announced switches."""

import numpy as np

from baselines.rules.rollout import rollout
from hybrid_env import HybridTrackVectorEnv


def declared(decider, episodes, seed=0, **options):
    """Return reward, correct, ticks and forced of the K segments of each episode, (E, K), by name."""
    env = HybridTrackVectorEnv(episodes, tick_info=False, **options)
    found = {name: np.zeros((episodes, env.options.segments)) for name in ("correct", "ticks", "forced")}
    count, unfinished = np.zeros(episodes, np.int64), np.ones(episodes, np.bool_)
    for now in rollout(env, decider, seed, unfinished):
        if "_decided_mode" not in now.info:
            continue
        new = np.flatnonzero(now.info["_decided_mode"] & unfinished)
        for name, array in found.items():
            array[new, count[new]] = now.info[name][new]
        count[new] += 1
        unfinished[:] = count < env.options.segments
        if not unfinished.any():
            break
    reward = np.where(found["correct"], 1.0, -1.0) - env.options.delay_cost * found["ticks"]
    return found | {"reward": reward}
