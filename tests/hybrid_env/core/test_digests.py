"""Observations and rewards are bit for bit reproducible: digests of 2,000 steps of nine tracks.

A change of the kernel that intentionally changes numbers must update these digests.
"""

import hashlib

import numpy as np
import pytest

from hybrid_env import ENVIRONMENTS, HybridTrackQuickestVectorEnv, HybridTrackVectorEnv

BANK = tuple(float(radius) for radius in range(1, 11))
DIGESTS = [
    pytest.param(
        {},
        "3606773566ce64340b8cd8d79c8209cfd184160a3089c7e09050e1b80d65a68b",
        id="default",
    ),
    pytest.param(
        {
            "measurement_variance": (0.05, 0.2),
            "noise": "outliers 0.1",
            "radii": (3.0, 8.0),
        },
        "7dfc38ec40d304a3b3b0f689c143b3204d914f5c3c723dbac68766ffb4fb14bc",
        id="two noises, outliers",
    ),
    pytest.param(
        {
            "radii": BANK,
            "correctness": "type",
            "delay_cost": 0.01,
        },
        "7ac5fac3a66d702b4381bbe49ab713de8cc4a91e7fd13167f592e10d98fbc0d1",
        id="21 hypotheses",
    ),
    pytest.param(
        {"bank": "anchor_aware"},
        "82b4671b3c1ac61df7e49b64602cf413181303b81775e42a37111d4807903ef1",
        id="anchor-aware",
    ),
    pytest.param(
        {
            "bank": "anchor_aware",
            "radii": BANK,
            "correctness": "type",
            "measurement_variance": 1.0,
        },
        "a325df21adaaa52e7fef00ab8e0bf72d44497eaf0f074a94a01a27de56cc51d2",
        id="anchor-aware, 21 hypotheses",
    ),
    pytest.param(
        {"bank": "oracle", "measurement_variance": 0.01},
        "873b41c83c900a5bcae787e64de7654652f0602489d9efb46e1bab677dc71a69",
        id="oracle",
    ),
    pytest.param(
        {
            "scheme": "L50r3 R75r5 S50 L20r3",
            "radii": (3.0, 5.0),
            "undecided": "keep",
            "initial_error": 0,
            "heading": 0.3,
        },
        "9631cd0d1f6c1b57dd455c4568da70167d28dfd6bcb8f1c20100a805952d63df",
        id="fixed scheme",
    ),
    pytest.param(
        {
            "reset_covariance": False,
            "speed": 7.0,
            "tau": 0.05,
            "process_variance": 0.01,
            "actions": "best",
        },
        "e3915817cf9a6938acc9de6c8b3c8da7b351d83cce9e551cb653229f5b8aacdc",
        id="kept covariance",
    ),
    pytest.param(
        {"bank": "anchor_aware", "evidence": 0.95},
        "d714b3d8b2fb0f90ae6beae4a37bd6811491b506c8cb8350bb0afe3bb7a01033",
        id="evidence",
    ),
    pytest.param(
        dict(ENVIRONMENTS["HybridTrackBank-v0"]),
        "f012dafd6cf1d3df8bc507f91be0cfc0b816ec94a8adfc0bd4d764e8776bd35e",
        id="types that follow the bank",
    ),
]


def digest_of(env, steps, waits=True):
    """Return the SHA-256 digest of the observations and rewards of random actions. waits: whether
    a track waits in most steps.
    """
    generator = np.random.default_rng(7)
    rows, _ = env.reset(seed=11)
    digest = hashlib.sha256(rows.tobytes())
    first = 1 if waits else 0
    for _ in range(steps):
        acts = generator.random(9) < 1 / 15 if waits else True
        actions = generator.integers(first, env.single_action_space.n, 9)
        rows, rewards, *_ = env.step(np.where(acts, actions, 0))
        digest.update(rows.tobytes())
        digest.update(rewards.tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize(("options", "digest"), DIGESTS)
def test_observations_and_rewards_have_the_recorded_digest(options, digest):
    assert digest_of(HybridTrackVectorEnv(9, **options), 2000) == digest


QUICKEST_DIGESTS = [
    pytest.param(
        {},
        "c011e5cb83613cd37f5d765d058ab082a310780f6608a15c5703e7a307d466af",
        id="default",
    ),
    pytest.param(
        {
            "radii": (3.0, 8.0),
            "measurement_variance": (0.05, 0.2),
            "durations": "uniform 20-40",
            "start": "random",
            "ticks": 300,
            "noise": "outliers 0.1",
            "hazard": 0.05,
        },
        "557f846bc4361152a1231915def61bbf0badc153b4365910f6b6c22a84eb6ff1",
        id="other options",
    ),
]


@pytest.mark.parametrize(("options", "digest"), QUICKEST_DIGESTS)
def test_rows_and_rewards_with_unknown_switch_moments_have_the_recorded_digest(options, digest):
    assert digest_of(HybridTrackQuickestVectorEnv(9, **options), 1300, waits=False) == digest
