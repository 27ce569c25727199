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
        {}, "56ca39acb9d6da25257db8524892229ded054f926e517dace08637971adb3bdc", id="default"
    ),
    pytest.param(
        {"measurement_variance": (0.05, 0.2), "noise": "outliers 0.1", "radii": (3.0, 8.0)},
        "6b0be7f4e80051f30622a26d9e31733e51a7b1185a1192c0230fe45f7f35db4b",
        id="two noises, outliers",
    ),
    pytest.param(
        {"radii": BANK, "correctness": "type", "delay_cost": 0.01},
        "9af89618a39c4981e8c1ec8ca2f295bb5469469853ba3205287172c5beac1831",
        id="21 hypotheses",
    ),
    pytest.param(
        {"bank": "anchor_aware"},
        "753dbab1cb74451e10c1201c0b9a7280eea8032dee3ceb309c472d4c53feae79",
        id="anchor-aware",
    ),
    pytest.param(
        {"bank": "anchor_aware", "radii": BANK, "correctness": "type", "measurement_variance": 1.0},
        "e5c850512fbfb4fcb31324f17d808335f40ed3f94e5169dc3a10b82c22893d1e",
        id="anchor-aware, 21 hypotheses",
    ),
    pytest.param(
        {"bank": "oracle", "measurement_variance": 0.01},
        "43b6fa21c005ec6d2a7d3a1c55c5cdf5d12a4a8832ef6f8b61e15afc633497df",
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
        "89d8f0789b27fce797b3407932460999d28ec591f8093075c909f97f1afb06c1",
        id="fixed scheme",
    ),
    pytest.param(
        {"reset_covariance": False, "speed": 7.0, "tau": 0.05, "process_variance": 0.01},
        "8ff830a2b3dc316079521233ab0e7b70d44591fe646f3effbf163e6c8456fbf3",
        id="kept covariance",
    ),
    pytest.param(
        {"bank": "anchor_aware", "evidence": 0.95},
        "c8ff35647e0aa481f837c7479f26a4de29bc9acda891608a077772f2adbd5d4f",
        id="evidence",
    ),
    pytest.param(
        ENVIRONMENTS["HybridTrackBank-v0"] | {"decide_every": 1, "evidence": 0.95},
        "fdce2214f376fd532904e5d6a98cde8c57c4d7ad6442016c568764020698340f",
        id="types that follow the bank",
    ),
    pytest.param(
        ENVIRONMENTS["HybridTrackRoad-v0"] | {"decide_every": 1},
        "34de7e7c816a03f586e1b7b258ba5d52288db8afdcd72cb8ded5152762f0f3d2",
        id="drawn process noise",
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
        {}, "4bcac9d72774f4b61a2e9e1c7ec09628d72aeda690dfce7f3e838ecbd329df94", id="default"
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
        "2023cc5ca5a724d1bf855a71f8187b9b4eb5541a98673d2fc5917bd1c6214ae4",
        id="other options",
    ),
    pytest.param(
        ENVIRONMENTS["HybridTrackQuickestRoad-v0"],
        "eec56c238b7381a67840f460bf0761a45049bcba676a21e4cd35debd9d586726",
        id="drawn process noise",
    ),
]


@pytest.mark.parametrize(("options", "digest"), QUICKEST_DIGESTS)
def test_rows_and_rewards_with_unknown_switch_moments_have_the_recorded_digest(options, digest):
    assert digest_of(HybridTrackQuickestVectorEnv(9, **options), 1300, waits=False) == digest
