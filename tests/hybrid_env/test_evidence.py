"""A declaration counts from a posterior on; before, it waits. The mask says which declarations
count.
"""

import itertools

import gymnasium as gym
import numpy as np
import pytest
from hostile_input import refused

import hybrid_env
from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    WorldOptions,
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
WORLDS = list(
    itertools.product(
        RADII,
        ("exact", "type"),
        ("published", "anchor_aware"),
        ("all", "types", "best"),
        (0.0, 0.4),
    )
)


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
        [posterior[..., 0], *(one.sum(-1) for one in sides)],
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
        HybridTrackVectorEnv(TRACKS, tick_info=True, evidence=one, **options)
        for one in (EVIDENCE, 0.0)
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
        given = generator.integers(0, limited.single_action_space.n, TRACKS)
        counted = given * np.take_along_axis(mask, given[:, None], axis=1)[:, 0]
        waited, declared = waited + (given > counted).sum(), declared + (counted[~done] > 0).sum()
        row, rewards, done, _, info = limited.step(given)
        other_row, other_rewards, other_done, _, other_info = free.step(counted)
        assert row.tobytes() == other_row.tobytes()
        np.testing.assert_array_equal(rewards, other_rewards)
        np.testing.assert_array_equal(done, other_done)
        for name in set(info) - {"action_mask"}:
            np.testing.assert_array_equal(info[name], other_info[name], err_msg=name)
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


@pytest.mark.parametrize("env_id", EVIDENT_IDS)
def test_the_spaces_of_a_vector_environment_sample_by_its_masks(env_id):
    env = gym.make_vec(env_id, 5)
    _, info = env.reset(seed=1)
    env.action_space.seed(0)
    for _ in range(100):
        actions = env.action_space.sample(mask=tuple(info["action_mask"]))
        assert env.action_masks()[np.arange(5), actions].all()
        *_, info = env.step(actions)


@pytest.mark.parametrize("env_id", tuple(hybrid_env.ENVIRONMENTS))
@pytest.mark.parametrize("masked", [True, False])
def test_random_policies_pass_the_passive_checker(env_id, masked):
    env = gym.make(env_id)
    assert "PassiveEnvChecker" in str(env)
    _, info = env.reset(seed=0)
    env.action_space.seed(0)
    for _ in range(400):
        action = env.action_space.sample(mask=info["action_mask"] if masked else None)
        *_, done, truncated, info = env.step(action)
        assert not truncated
        if done:
            _, info = env.reset()


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


@pytest.mark.parametrize("correctness", ["exact", "type"])
@pytest.mark.parametrize("make", [HybridTrackEnv, HybridTrackVectorEnv])
def test_without_evidence_every_declaration_counts(make, correctness):
    env = make(evidence=0, correctness=correctness, bank="anchor_aware")
    _, info = env.reset(seed=0)

    assert np.all(info["action_mask"] == 1)
    assert env.action_masks().all()
    action = 2 if make is HybridTrackEnv else np.array([2])
    *_, info = env.step(action)
    assert (
        np.ravel(info["ticks"])[0],
        np.ravel(info["decided_mode"])[0],
        np.ravel(info["forced"])[0],
    ) == (1, 1, False)


@pytest.mark.parametrize("make", [HybridTrackQuickestEnv, HybridTrackQuickestVectorEnv])
def test_with_unknown_switches_every_statement_counts(make):
    env = make()
    _, info = env.reset(seed=0)
    for _ in range(20):
        assert info["action_mask"].dtype == np.int8
        assert info["action_mask"].all()
        assert env.action_masks().all()
        *_, info = env.step(1 if make is HybridTrackQuickestEnv else np.array([1]))


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


OTHER_VALUES = [1, 1.0, -0.1, np.nan, np.inf, "x", "0.95", None, True, [0.95], 95]


@pytest.mark.parametrize("evidence", OTHER_VALUES, ids=str)
@pytest.mark.parametrize("make", [HybridTrackEnv, HybridTrackVectorEnv, WorldOptions])
def test_other_values_of_evidence_are_refused_in_one_line(make, evidence):
    message = refused(make, evidence=evidence)
    assert message.startswith("evidence=")
    assert message.endswith("expected a probability from 0 to 1 - 1e-9")
