import dataclasses

import numpy as np
import pytest

import hybrid_env
from baselines.recordings.likeliest_noise import FACTORS, LikeliestNoise
from hybrid_env.live import LiveTracks
from hybrid_env.quickest_options import QuickestOptions


def test_the_likeliest_process_noise_is_that_of_the_object():
    """With an object of the model, rows are mostly those of the bank that is options its process
    noise.
    """
    options = QuickestOptions(ticks=600, radii=(20.0,))
    for true in (0.001, 0.01, 0.1):
        env = hybrid_env.HybridTrackQuickestVectorEnv(40, process_variance=true, radii=(20.0,))
        env.reset(seed=3)
        banks = [
            LiveTracks(
                dataclasses.replace(options, radii=(20.0,), process_variance=factor * 0.001),
                40,
            )
            for factor in FACTORS
        ]
        state = env.world
        chooser = LikeliestNoise(banks[0].options)
        for bank in banks:
            bank.begin(
                state.field("estimate"),
                np.eye(4) * 0.02,
                state.field("true_mode"),
            )
        picked = []
        for tick in range(500):
            for bank in banks:
                bank.measure_all(state.field("measurement"))
            rows = np.stack([bank.world.take_rows() for bank in banks])
            chosen = chooser.choose(rows)
            if tick > 100:
                picked.append(chooser.evidence.argmax(0))
            assert all(
                (chosen[k] == rows[:, k]).all(1).any()
                for k in range(
                    0,
                    40,
                    13,
                )
            )
            env.step(np.zeros(40, np.int64))
        median = np.median(np.log10(np.array(FACTORS)[np.array(picked)]))
        assert median == pytest.approx(np.log10(true / 0.001), abs=0.51)
