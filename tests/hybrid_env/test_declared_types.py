"""With `actions="types"` a decision names straight, left or right."""

import numpy as np
import pytest

from hybrid_env import HybridTrackVectorEnv
from hybrid_env.registration import BANK_RADII


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
