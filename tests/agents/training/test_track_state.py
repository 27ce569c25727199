"""The arrays of the tracks hold their whole state."""

import numpy as np
import pytest
from agents.training.track_state import check_tracks, track_arrays

from hybrid_env.vector_env import HybridTrackVectorEnv


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_tracks_with_copied_arrays_continue_with_equal_rows(bank, mode):
    first, second = (HybridTrackVectorEnv(11, bank=bank, autoreset_mode=mode) for _ in range(2))
    first.reset(seed=1)
    second.reset(seed=2)
    generator = np.random.default_rng(0)
    actions = generator.integers(4, size=(400, 11)) * (generator.random((400, 11)) < 0.1)
    for row in actions[:150]:
        first.step(row)
    arrays = track_arrays(first)
    for name, array in track_arrays(second).items():
        array[...] = arrays[name]
    check_tracks(second)
    for row in actions[150:]:
        for one, other in zip(first.step(row)[:3], second.step(row)[:3], strict=True):
            np.testing.assert_array_equal(one, other)
