"""A declaration counts from a posterior on; before, it waits. The mask says which declarations
count.
"""

import numpy as np
import pytest
from scipy import special

from hybrid_env import HybridTrackEnv, HybridTrackVectorEnv
from hybrid_env.registration import BANK_RADII

TRACKS, EVIDENCE = 16, 0.9
WORLDS = [
    {"radii": (5.0,), "bank": "anchor_aware"},
    {"radii": BANK_RADII, "correctness": "type", "actions": "types", "missed": 0.4},
    {"radii": (3.0, 8.0)},
]


def expected_mask(env, log_likelihood):
    """The mask by the posteriors of the hypotheses, or of straight, left and right."""
    posterior = special.softmax(log_likelihood, axis=1)
    if env.options.correctness == "type":
        side = posterior.shape[1] // 2
        posterior = np.add.reduceat(posterior, [0, 1, side + 1], axis=1)
    mask = np.ones((TRACKS, env.options.action_count), np.int8)
    mask[:, 1:] = (posterior.max(1) >= EVIDENCE)[:, None]
    return mask


@pytest.mark.parametrize("options", WORLDS)
def test_a_declaration_before_the_evidence_waits(options):
    limited, free = (
        HybridTrackVectorEnv(
            TRACKS, tick_info=True, evidence=evidence, measurement_variance=0.01, **options
        )
        for evidence in (EVIDENCE, 0.0)
    )
    generator = np.random.default_rng(5)
    done = np.zeros(TRACKS, bool)
    waited = declared = 0
    (rows, info), (other_rows, other_info) = limited.reset(seed=3), free.reset(seed=3)

    np.testing.assert_array_equal(rows, other_rows)
    for _ in range(150):
        mask = expected_mask(limited, info["log_likelihood"])
        np.testing.assert_array_equal(info["action_mask"], mask)
        np.testing.assert_array_equal(limited.action_masks(), mask == 1)
        assert other_info["action_mask"].all()
        given = generator.integers(0, limited.single_action_space.n, TRACKS)
        counted = given * mask[np.arange(TRACKS), given]
        waited, declared = waited + (given > counted).sum(), declared + (counted[~done] > 0).sum()
        *values, info = limited.step(given)
        *others, other_info = free.step(counted)
        np.testing.assert_equal(values, others)
        np.testing.assert_equal(info, other_info | {"action_mask": info["action_mask"]})
        done = values[2]
    assert waited > 100
    assert declared > 10


@pytest.mark.parametrize("undecided", ["likeliest", "keep"])
def test_a_masked_declaration_on_the_last_tick_is_a_forced_decision(undecided):
    env = HybridTrackEnv(
        scheme="L4r5 S4", evidence=1.0 - 1e-9, undecided=undecided, bank="anchor_aware"
    )
    _, info = env.reset(seed=2)
    for _ in range(4):
        assert info["action_mask"].tolist() == [1, 0, 0, 0]
        likeliest = info["log_likelihood"].argmax()
        _, reward, _, _, info = env.step(3)

    assert info["forced"]
    assert info["ticks"] == info["decided_length"] == 4
    assert info["decided_mode"] == (0 if undecided == "keep" else likeliest)
    assert reward == pytest.approx((1.0 if info["decided_mode"] == 1 else -1.0) - 0.02)


@pytest.mark.parametrize(("action", "first", "last"), [(1, 0, 1), (2, 1, 11), (3, 11, 21)])
def test_a_declared_type_stands_for_its_likeliest_hypothesis(action, first, last):
    env = HybridTrackVectorEnv(
        50, tick_info=True, radii=BANK_RADII, actions="types", correctness="type"
    )
    _, info = env.reset(seed=4)
    for _ in range(7):
        *_, info = env.step(np.zeros(50, np.int64))
    expected = first + info["log_likelihood"][:, first:last].argmax(1)
    *_, info = env.step(np.full(50, action))
    np.testing.assert_array_equal(info["decided_mode"], expected)
    assert action == 1 or len(set(expected)) > 1
