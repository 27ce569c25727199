"""Random worlds inside the allowed ranges: every row is finite and in the observation space,
episodes end.

A failure prints the arguments of `random_worlds.soak`, which repeats it with them.
"""

import numpy as np
import pytest
from random_worlds import CHOICES, random_options, soak

from hybrid_env import Sensor


@pytest.mark.parametrize(
    ("worlds", "ticks"),
    [
        pytest.param(12, 5_000, id="quick"),
        # 10^8 ticks.
        pytest.param(330, 310_000, id="study", marks=pytest.mark.study),
    ],
)
def test_rows_rewards_and_ends_of_random_worlds(worlds, ticks):
    done = 0
    banks = set()
    for seed in range(worlds):
        options = random_options(np.random.default_rng(seed))
        done += soak(options, 256, ticks, seed)
        banks.add(options["bank"])

    assert done >= worlds * ticks
    assert banks == set(CHOICES["bank"])


EDGES = {
    "many segments": {"scheme": "random 1000000x1-3"},
    "one long segment": {"scheme": "S100000 L100000r5 R100000r5"},
    "many radii": {"radii": np.geomspace(0.01, 1e6, 300), "speed": 0.1},
    "fast turn, loud": {"speed": 5e3, "measurement_variance": 1e6, "scheme": "random 1000x1-50"},
    "exact": {
        "process_variance": 0.0,
        "initial_error": 0,
        "measurement_variance": 1e-18,
        "radii": 10.0,
    },
    "process noise": {"process_variance": 1e18},
    "first estimate": {"initial_error": (1e12, 1e14)},
    "outliers": {"noise": "outliers 0.999999", "measurement_variance": 100.0},
    "heavy tails": {"noise": "student_t 1", "missed": 0.5},
    "no measurements": {"missed": 0.999999, "scheme": "random 1000x50-3000"},
    "far sensors": {
        "sensors": [Sensor(variance=1e-6, range=3.0), Sensor(variance=1e6, period=7, range=40.0)]
    },
    "huge tick": {"tau": 1e9, "speed": 1e-7},
}


@pytest.mark.parametrize("name", EDGES)
def test_rows_rewards_and_ends_of_extreme_worlds(name):
    for bank in ("published", "anchor_aware"):
        soak({"bank": bank, "follow": "bank"} | EDGES[name], 16, 1_000, seed=1)
