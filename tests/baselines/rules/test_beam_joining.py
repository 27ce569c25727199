"""A small beam that joins histories of nearly the same age is close to a large one."""

import numpy as np
import pytest

from baselines.rules.adaptive_beam import AdaptiveBeamDecider
from baselines.rules.beam import BeamDecider
from hybrid_env import HybridTrackQuickestVectorEnv

TRACKS = 8


def posteriors(deciders, ticks, **options):
    """Probabilities of the modes of each decider on the same tracks (ticks, TRACKS, M), and its
    last state.
    """
    env = HybridTrackQuickestVectorEnv(TRACKS, ticks=ticks, **options)
    env.reset(seed=3)
    made = [make(env.options) for make in deciders]
    states = [None] * len(made)
    found = [[] for _ in made]
    for _ in range(ticks):
        seen = made[0].observe(env.world)
        for k, one in enumerate(made):
            states[k] = one.predict(seen, states[k])[1]
            found[k].append(np.exp(states[k].log_probability))
        env.step(np.zeros(TRACKS, np.int64))
    return np.array(found), states


@pytest.mark.parametrize("kind", [BeamDecider, AdaptiveBeamDecider])
def test_sixteen_joined_histories_are_closer_to_many_than_sixteen_of_the_most_probable(kind):
    deciders = [
        lambda options: kind(options, branches=160),
        lambda options: kind(options, branches=16, joined=True),
        lambda options: kind(options, branches=16),
    ]
    (many, joined, omitted), _ = posteriors(deciders, 200, measurement_variance=1.0)
    errors = [np.abs(few - many).sum(-1).mean() for few in (joined, omitted)]

    assert errors[0] < 0.25 * errors[1]
