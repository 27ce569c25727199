"""The random numbers that the environment draws, read back from the motion of its objects."""

import math

import numpy as np

from hybrid_env import HybridTrackVectorEnv

Q, R = 0.5, 2.0


def drawn_noise(ticks, tracks, seed=1, **options):
    """Return the draws of objects on a straight line, (ticks, 4, tracks): of velocities and
    measurements.

    The first two of a tick are independent draws of N(0, 1); the others are the errors of the
    measured coordinates over sqrt(R). Track i has seed `seed` + i.
    """
    options |= {"scheme": f"S{ticks + 1}", "process_variance": Q, "measurement_variance": R}
    env = HybridTrackVectorEnv(tracks, tick_info=True, **options)
    _, info = env.reset(seed=seed)
    wait = np.zeros(tracks, np.int64)
    drawn = np.empty((ticks, 4, tracks))
    for k in range(ticks):
        before = info["truth"]
        info = env.step(wait)[4]
        truth = info["truth"]
        drawn[k, :2] = (truth - before)[:, [1, 3]].T / math.sqrt(Q)
        drawn[k, 2:] = (info["measurement"] - truth[:, [0, 2]]).T / math.sqrt(R)
    return drawn
