"""Banks that choose their process noise by the evidence."""

import dataclasses

import numpy as np
import pytest

from hybrid_env import HybridTrackQuickestVectorEnv, LiveTracks, QuickestOptions
from studies.simulators.given_tracks import LikeliestNoise


@pytest.mark.parametrize("true", [0.001, 0.1])
def test_the_likeliest_process_noise_is_that_of_the_object(true):
    options = QuickestOptions(ticks=400, radii=(20.0,))
    factors = np.array(LikeliestNoise.factors)
    env = HybridTrackQuickestVectorEnv(20, process_variance=true, radii=(20.0,))
    env.reset(seed=3)
    state = env.world
    banks = [
        LiveTracks(dataclasses.replace(options, process_variance=factor * 0.001), 20)
        for factor in factors.tolist()
    ]
    for bank in banks:
        bank.begin(state.field("estimate"), np.eye(4) * 0.02, state.field("true_mode"))
    chooser = LikeliestNoise(options)
    picked = []
    for _ in range(400):
        for bank in banks:
            bank.measure_all(state.field("measurement"))
        rows = np.stack([bank.world.take_rows() for bank in banks])
        chosen = chooser.choose(rows)
        best = chooser.evidence.argmax(0)
        np.testing.assert_array_equal(chosen, rows[best, np.arange(20)])
        picked.append(factors[best])
        env.step(np.zeros(20, np.int64))
    median = np.median(np.log10(picked[100:]))
    assert median == pytest.approx(np.log10(true / 0.001), abs=0.51)
