"""Deciders that filter the measurements again agree with banks that have the same prior."""

import numpy as np
from scipy.special import softmax

from baselines.rules.propagated import RefilteringDecider
from hybrid_env import HybridTrackVectorEnv, Layout

TRACKS = 19


def declare_at_20(rows):
    layout = Layout.of_rows(rows)
    late = layout.read(rows, "ticks") >= 19.5
    return np.where(late, layout.read(rows, "log_ratio").argmax(-1) + 1, 0)


def test_kept_covariance_equals_the_bank_that_keeps_its_covariance():
    env = HybridTrackVectorEnv(
        TRACKS,
        reset_covariance=False,
        autoreset_mode="SameStep",
        radii=(3.0, 8.0),
        measurement_variance=1.0,
    )
    decider = RefilteringDecider(env.options, bank="published", propagates=False)
    rows, _ = env.reset(seed=5)
    start = np.ones(TRACKS, np.bool_)
    state = None
    for _ in range(100):
        _, state = decider.predict(decider.observe(env.world), state, start)
        expected = softmax(env.world.layout.read(rows, "log_ratio"), axis=-1)
        # Smaller ones are clipped in the observation.
        large = expected > 1e-12
        np.testing.assert_allclose(
            state[0].posterior[0][large], expected[large], rtol=2e-2, atol=1e-4
        )
        rows, _, start, _, _ = env.step(declare_at_20(rows))
