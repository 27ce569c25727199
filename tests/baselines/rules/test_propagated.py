"""Deciders that filter the measurements again agree with banks that have the same prior."""

import numpy as np
from scipy.special import softmax

from baselines import rollout
from baselines.rules.propagated import RefilteringDecider
from hybrid_env import HybridTrackVectorEnv

TRACKS = 19


def test_kept_covariance_equals_the_bank_that_keeps_its_covariance():
    env = HybridTrackVectorEnv(
        TRACKS,
        reset_covariance=False,
        autoreset_mode="SameStep",
        radii=(3.0, 8.0),
        measurement_variance=1.0,
    )
    decider = RefilteringDecider(env.options, bank="published", propagates=False)
    rows = None
    for now in rollout(env, decider, 5):
        if now.step:
            expected = softmax(env.world.layout.read(rows, "log_ratio"), axis=-1)
            # Smaller ones are clipped in the observation.
            large = expected > 1e-12
            posterior = now.state[0].posterior[0]
            np.testing.assert_allclose(posterior[large], expected[large], rtol=2e-2, atol=1e-4)
        if now.step == 100:
            break
        rows = now.observation.copy()
