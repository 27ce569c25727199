"""Deciders that filter the measurements again agree with banks that have the same prior."""

import numpy as np
from scipy.special import softmax

from baselines.rules.anchor_prior import fit_anchor_prior
from baselines.rules.refiltering import RefilteringDecider
from hybrid_env import HybridTrackVectorEnv, Layout

TRACKS = 19


def declare_at_20(rows):
    layout = Layout.of_rows(rows)
    late = layout.read(rows, "ticks") >= 19.5
    return np.where(
        late,
        layout.read(rows, "log_ratio").argmax(-1) + 1,
        0,
    )


def test_kept_covariance_equals_the_bank_that_keeps_its_covariance():
    env = HybridTrackVectorEnv(
        TRACKS,
        reset_covariance=False,
        autoreset_mode="SameStep",
        radii=(3.0, 8.0),
        measurement_variance=1.0,
    )
    decider = RefilteringDecider(
        env.options,
        bank="published",
        prior=None,
    )
    rows, _ = env.reset(seed=5)
    start = np.ones(TRACKS, np.bool_)
    state = None
    for _ in range(100):
        _, state = decider.predict(
            decider.observe(env.world),
            state,
            start,
        )
        expected = softmax(env.world.layout.read(rows, "log_ratio"), axis=-1)
        # Smaller ones are clipped in the observation.
        large = expected > 1e-12
        np.testing.assert_allclose(
            state.posterior[large],
            expected[large],
            rtol=2e-2,
            atol=1e-4,
        )
        rows, _, start, _, _ = env.step(declare_at_20(rows))


def test_a_mixture_is_recovered_and_mirrored():
    rng = np.random.default_rng(0)
    n = 20_000
    types = rng.integers(3, size=n)
    correct = rng.random(n) < 0.8
    deviation = np.where(
        rng.random(n) < 0.25,
        10.0,
        1.0,
    ) * np.where(
        correct,
        1.0,
        3.0,
    )
    errors = rng.normal(size=(n, 4)) * deviation[:, None]
    errors[:, 2] += (
        np.where(
            types == 1,
            5.0,
            np.where(
                types == 2,
                -5.0,
                0.0,
            ),
        )
        * ~correct
    )
    prior = fit_anchor_prior(
        errors,
        types,
        correct,
    )
    weight, mean, covariance = prior.after(np.array([0, 1, 2]), np.full(3, 0.5))

    np.testing.assert_allclose(
        2 * weight,
        np.tile([0.75, 0.25], (3, 2)),
        atol=0.04,
    )
    expected = np.tile([1.0, 100.0, 9.0, 900.0], (3, 1))
    np.testing.assert_allclose(
        covariance[..., 0, 0],
        expected,
        rtol=0.2,
    )
    np.testing.assert_allclose(
        mean[:, 2, 2],
        [0.0, 5.0, -5.0],
        atol=0.4,
    )
    np.testing.assert_allclose(
        mean[:, 0],
        0.0,
        atol=0.1,
    )
