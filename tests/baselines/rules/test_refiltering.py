"""Deciders that filter the measurements again agree with banks that have the same prior."""

import numpy as np
import pytest
from random_worlds import unit_scales
from scipy.special import softmax

from baselines.rules.anchor_prior import fit_anchor_prior
from baselines.rules.refiltering import RefilteringDecider, fit_calibrated_anchor
from hybrid_env import HybridTrackVectorEnv, Layout

TRACKS = 19


def run(decider, env, steps, policy, rows_of=lambda rows: rows):
    """Yield rows and posteriors of some steps, with the actions of policy(rows)."""
    rows, _ = env.reset(seed=5)
    start = np.ones(TRACKS, np.bool_)
    state = None
    for _ in range(steps):
        actions, state = decider.predict(rows_of(rows), state, start)
        yield rows, actions, state.posterior.copy()
        rows, _, start, _, _ = env.step(policy(rows))


def declare_at_20(rows):
    layout = Layout.of_rows(rows)
    late = layout.read(rows, "ticks") >= 19.5
    return np.where(
        late,
        layout.read(rows, "log_ratio").argmax(-1) + 1,
        0,
    )


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"radii": (3.0, 8.0), "measurement_variance": 1.0},
    ],
)
def test_kept_covariance_equals_the_bank_that_keeps_its_covariance(options):
    env = HybridTrackVectorEnv(TRACKS, reset_covariance=False, autoreset_mode="SameStep", **options)
    decider = RefilteringDecider(env.options, bank="published", prior=None)
    for rows, _, posterior in run(decider, env, 100, declare_at_20):
        expected = softmax(env.world.layout.read(rows, "log_ratio"), axis=-1)
        # Smaller ones are clipped in the observation.
        large = expected > 1e-12
        np.testing.assert_allclose(
            posterior[large],
            expected[large],
            rtol=2e-2,
            atol=1e-4,
        )


def test_the_first_segment_equals_the_anchor_aware_bank():
    published = HybridTrackVectorEnv(TRACKS, measurement_variance=1.0)
    aware = HybridTrackVectorEnv(TRACKS, measurement_variance=1.0, bank="anchor_aware")
    rows, _ = published.reset(seed=5)
    expected, _ = aware.reset(seed=5)
    decider = RefilteringDecider(published.options, prior=None)
    state = None
    for _ in range(49):
        _, state = decider.predict(rows, state, np.ones(TRACKS, np.bool_))
        posterior = softmax(aware.world.layout.read(expected, "log_ratio"), axis=-1)
        np.testing.assert_allclose(
            state.posterior,
            posterior,
            rtol=2e-2,
            atol=1e-4,
        )
        wait = np.zeros(TRACKS, np.int64)
        rows = published.step(wait)[0]
        expected = aware.step(wait)[0]


SCALED = {
    "radii": (5.0, 9.0),
    "speed": 2.0,
    "tau": 0.1,
    "process_variance": 0.001,
    "measurement_variance": 0.5,
    "initial_error": (0.3, 0.02),
    # The published covariance, the identity, depends on the units.
    "reset_covariance": False,
}


def test_units_change_no_decision():
    decisions = []
    for units in ((1.0, 1.0), (1000.0, 60.0)):
        env = HybridTrackVectorEnv(TRACKS, autoreset_mode="SameStep", **unit_scales(SCALED, *units))
        decider = RefilteringDecider(
            env.options,
            0.03,
            prior=fit_calibrated_anchor(env.options, 100, 7),
        )
        steps = list(run(decider, env, 60, declare_at_20))
        decisions.append(np.array([posterior for _, _, posterior in steps]))

    np.testing.assert_allclose(decisions[1], decisions[0], atol=2e-3)


@pytest.mark.parametrize(
    ("noise", "heavy"),
    [
        ("gaussian", False),
        ("levy 1.5 1 44", True),
    ],
)
def test_robust_filters_learn_whether_tails_are_heavy(noise, heavy):
    env = HybridTrackVectorEnv(TRACKS, noise=noise, **unit_scales(SCALED, 1e4, 1.0))
    prior = fit_calibrated_anchor(env.options, 100, 7, robust=True)
    decider = RefilteringDecider(env.options, robust=True, prior=prior)
    (rows, _), state = env.reset(seed=5), None
    for _ in range(80):
        _, state = decider.predict(rows, state, None)
        rows, *_ = env.step(declare_at_20(rows))
    share = np.exp(state.filters.log_laws[1])

    assert np.median(share) > 0.99 if heavy else np.median(share) < 0.01


def test_a_mixture_is_recovered_and_mirrored():
    rng = np.random.default_rng(0)
    n = 20_000
    types = rng.integers(3, size=n)
    correct = rng.random(n) < 0.8
    deviation = np.where(
        rng.random(n) < 0.25,
        10.0,
        1.0,
    ) * np.where(correct, 1.0, 3.0)
    errors = rng.normal(size=(n, 4)) * deviation[:, None]
    errors[:, 2] += (
        np.where(
            types == 1,
            5.0,
            np.where(types == 2, -5.0, 0.0),
        )
        * ~correct
    )
    prior = fit_anchor_prior(errors, types, correct)
    weight, mean, covariance = prior.after(np.array([0, 1, 2]))

    np.testing.assert_allclose(
        weight,
        np.broadcast_to([0.75, 0.25], (3, 2, 2)),
        atol=0.04,
    )
    expected = np.array([[1.0, 100.0], [9.0, 900.0]])
    np.testing.assert_allclose(
        covariance[..., 0, 0],
        np.broadcast_to(expected, (3, 2, 2)),
        rtol=0.2,
    )
    np.testing.assert_allclose(
        mean[:, 1, 0, 2],
        [0.0, 5.0, -5.0],
        atol=0.4,
    )
    np.testing.assert_allclose(mean[:, 0, 0], 0.0, atol=0.1)
