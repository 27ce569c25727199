"""Missed measurements and several sensors."""

import numpy as np
import pytest

from hybrid_env import HybridTrackVectorEnv, Sensor


def test_fused_errors_have_the_stated_variance():
    sensors = [
        Sensor(variance=0.4, period=2),
        Sensor(variance=0.1, position=(0.0, 50.0), range=50.1),
    ]
    env = HybridTrackVectorEnv(
        4000, tick_info=True, scheme="S9", sensors=sensors, heading=0.0, process_variance=0.0
    )
    _, info = env.reset(seed=1)
    for k in range(9):
        error = info["measurement"] - info["truth"][:, [0, 2]]
        ratio = env.world.field("noise")[:, 0]
        # Both sensors, or the second one alone, relative to a variance of 0.1.
        np.testing.assert_allclose(ratio, 1 / (0.1 / 0.4 + 1) if k % 2 == 0 else 1.0)
        white = error / np.sqrt(0.1 * ratio)[:, None]
        assert white.var() == pytest.approx(1.0, abs=5 * np.sqrt(2 / white.size))
        info = env.step(np.zeros(4000, np.int64))[4]
