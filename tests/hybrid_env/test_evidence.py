"""A declaration counts from a posterior on; before, it waits. The mask says which declarations
count.
"""

import gymnasium as gym
import numpy as np
import pytest

import hybrid_env
from hybrid_env import (
    HybridTrackEnv,
    HybridTrackVectorEnv,
)
from hybrid_env.registration import BANK_RADII

TRACKS, EVIDENCE = 16, 0.9
RADII = {
    3: (5.0,),
    5: (3.0, 8.0),
    21: BANK_RADII,
}
EVIDENT_IDS = [
    env_id for env_id, options in hybrid_env.ENVIRONMENTS.items() if "evidence" in options
]
WORLDS = [
    (3, "exact", "anchor_aware", "all", 0.0),
    (21, "type", "anchor_aware", "types", 0.0),
    (5, "type", "published", "all", 0.4),
    (5, "exact", "published", "best", 0.0),
]


def posteriors(log_likelihood, correctness):
    """Posteriors of the hypotheses, or of straight, left and right: (..., M) or (..., 3), with
    equal priors.
    """
    likelihood = np.exp(log_likelihood - log_likelihood.max(-1, keepdims=True))
    posterior = likelihood / likelihood.sum(-1, keepdims=True)
    if correctness == "exact":
        return posterior
    side = posterior.shape[-1] // 2
    sides = np.split(posterior[..., 1:], [side], axis=-1)
    return np.stack(
        [posterior[..., 0], *(turns.sum(-1) for turns in sides)],
        axis=-1,
    )


def expected_mask(env, info):
    """The mask by the log-likelihoods in `info`."""
    largest = posteriors(info["log_likelihood"], env.options.correctness).max(-1)
    mask = np.ones(
        (*np.shape(largest), env.options.action_count),
        np.int8,
    )
    mask[..., 1:] = (largest >= env.options.evidence)[..., None]
    return mask


@pytest.mark.parametrize(("hypotheses", "correctness", "bank", "actions", "missed"), WORLDS)
def test_a_declaration_before_the_evidence_waits(hypotheses, correctness, bank, actions, missed):
    options = {
        "radii": RADII[hypotheses],
        "correctness": correctness,
        "bank": bank,
        "actions": actions,
        "missed": missed,
        "measurement_variance": 0.01,
    }
    limited, free = (
        HybridTrackVectorEnv(
            TRACKS,
            tick_info=True,
            evidence=evidence,
            **options,
        )
        for evidence in (EVIDENCE, 0.0)
    )
    generator = np.random.default_rng(5)
    done = np.zeros(TRACKS, bool)
    waited = declared = 0
    (row, info), (other_row, other_info) = limited.reset(seed=3), free.reset(seed=3)

    assert row.tobytes() == other_row.tobytes()
    for _ in range(250):
        mask = expected_mask(limited, info)
        np.testing.assert_array_equal(info["action_mask"], mask)
        np.testing.assert_array_equal(limited.action_masks(), mask == 1)
        assert other_info["action_mask"].all()
        given = generator.integers(
            0,
            limited.single_action_space.n,
            TRACKS,
        )
        counted = (
            given
            * np.take_along_axis(
                mask,
                given[:, None],
                axis=1,
            )[:, 0]
        )
        waited, declared = waited + (given > counted).sum(), declared + (counted[~done] > 0).sum()
        row, rewards, done, _, info = limited.step(given)
        other_row, other_rewards, other_done, _, other_info = free.step(counted)
        assert row.tobytes() == other_row.tobytes()
        np.testing.assert_array_equal(rewards, other_rewards)
        np.testing.assert_array_equal(done, other_done)
        for name in set(info) - {"action_mask"}:
            np.testing.assert_array_equal(
                info[name],
                other_info[name],
                err_msg=name,
            )
    assert waited > 100
    assert declared > 20


@pytest.mark.parametrize("env_id", EVIDENT_IDS)
def test_the_mask_of_a_single_environment_is_of_the_kind_that_spaces_sample_by(env_id):
    env = gym.make(env_id).unwrapped
    _, info = env.reset(seed=1)
    masked = 0
    for _ in range(300):
        mask = info["action_mask"]
        assert (mask.dtype, mask.shape) == (np.int8, (env.action_space.n,))
        np.testing.assert_array_equal(mask, expected_mask(env, info))
        assert env.action_masks().dtype == np.bool_
        np.testing.assert_array_equal(env.action_masks(), mask == 1)
        action = env.action_space.sample(mask=mask)
        assert mask[action] == 1
        masked += not mask.all()
        *_, done, _, info = env.step(action)
        if done:
            _, info = env.reset()

    assert 0 < masked < 300


@pytest.mark.parametrize("action", [0, 1, 3])
@pytest.mark.parametrize("undecided", ["likeliest", "keep"])
def test_a_masked_declaration_on_the_last_tick_is_a_forced_decision(undecided, action):
    env = HybridTrackEnv(
        scheme="L4r5 S4",
        evidence=1.0 - 1e-9,
        undecided=undecided,
        bank="anchor_aware",
    )
    _, info = env.reset(seed=2)
    for tick in range(1, 5):
        assert (info["tick"], info["segment"]) == (tick, 0)
        assert info["action_mask"].tolist() == [1, 0, 0, 0]
        likeliest = info["log_likelihood"].argmax()
        _, reward, done, _, info = env.step(action)

    assert not done
    assert info["forced"]
    assert info["ticks"] == info["decided_length"] == 4
    assert info["decided_mode"] == (0 if undecided == "keep" else likeliest)
    assert reward == pytest.approx((1.0 if info["decided_mode"] == 1 else -1.0) - 0.02)


@pytest.mark.parametrize("radii", RADII.values(), ids=RADII)
@pytest.mark.parametrize("action", [1, 2, 3])
def test_a_declared_type_stands_for_its_likeliest_hypothesis(radii, action):
    env = HybridTrackVectorEnv(
        50,
        tick_info=True,
        radii=radii,
        actions="types",
        correctness="type",
    )
    assert env.single_action_space.n == 4
    n = len(radii)
    first, last = {
        1: (0, 1),
        2: (1, n + 1),
        3: (n + 1, 2 * n + 1),
    }[action]
    _, info = env.reset(seed=4)
    for _ in range(7):
        *_, info = env.step(np.zeros(50, np.int64))
    expected = first + info["log_likelihood"][:, first:last].argmax(1)
    *_, info = env.step(np.full(50, action))
    np.testing.assert_array_equal(info["decided_mode"], expected)
    assert n == 1 or action == 1 or len(set(expected)) > 1
