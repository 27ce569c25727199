"""Objects whose process noise is drawn for every episode."""

import numpy as np
import pytest

from hybrid_env import ArgumentError, HybridTrackVectorEnv, WorldOptions


def process_variances(episodes=1, **options):
    """Return the variance of the velocity changes of 400 straight objects in each episode."""
    env = HybridTrackVectorEnv(400, scheme="S80", tick_info=True, **options)
    _, info = env.reset(seed=3)
    waits = np.zeros(400, np.int64)
    variances = []
    for _ in range(episodes):
        states = [info["truth"]]
        for _ in range(79):
            info = env.step(waits)[-1]
            states.append(info["truth"])
        variances.append(np.diff(states, axis=0)[..., 1::2].var((0, 2)))
        # A wait ends the episode, and the next step begins another one.
        for _ in range(2):
            info = env.step(waits)[-1]
    return np.array(variances)


def test_every_episode_has_a_process_noise_of_its_own():
    smallest, largest = 1e-4, 1e-2
    drawn = np.log10(process_variances(2, object_variance=(smallest, largest)))

    # The variance of 158 numbers has a standard deviation of 11 %.
    assert drawn.min() == pytest.approx(-4.0, abs=0.15)
    assert drawn.max() == pytest.approx(-2.0, abs=0.15)
    assert drawn.mean() == pytest.approx(-3.0, abs=0.1)
    assert abs(np.corrcoef(drawn)[0, 1]) < 0.15


@pytest.mark.parametrize("value", [(0.02, 0.01), (0.0, 0.01), (0.1,) * 3, -1.0, "much"])
def test_other_values_are_refused(value):
    with pytest.raises(ArgumentError, match="object_variance"):
        WorldOptions(object_variance=value)
