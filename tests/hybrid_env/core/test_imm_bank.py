"""The probabilities of the IMM bank equal enumeration, and are finite for extreme options."""

import itertools
import math

import numpy as np
import pytest

from hybrid_env import HybridTrackQuickestEnv, HybridTrackQuickestVectorEnv, QuickestOptions
from hybrid_env.core.memory import LANES
from hybrid_env.live import LiveTracks


def test_probabilities_equal_enumeration_where_mixing_is_exact():
    # An object at rest, whose filters agree in all modes: only the transition matrix moves the
    # probabilities.
    env = HybridTrackQuickestEnv(
        speed=1e-9,
        process_variance=0.0,
        initial_error=0,
        hazard=0.1,
    )
    env.reset(seed=1)
    start = (0.7, 0.2, 0.1)
    env.world.bank.hypotheses["log_probability"][0, :, 0] = np.log(start)
    histories = {(mode,): probability for mode, probability in enumerate(start)}
    for _ in range(6):
        *_, info = env.step(0)
        histories = {
            (*history, mode): probability * (0.9 if mode == history[-1] else 0.05)
            for (history, probability), mode in itertools.product(histories.items(), range(3))
        }
        total = [
            sum(p for history, p in histories.items() if history[-1] == mode) for mode in range(3)
        ]
        np.testing.assert_allclose(
            np.exp(info["log_probability"]),
            total,
            rtol=0,
            atol=1e-8,
        )


@pytest.mark.parametrize("sigmas", [100.0, 1e5])
def test_probabilities_and_estimates_are_finite_after_outliers(sigmas):
    track = LiveTracks(QuickestOptions())
    track.begin(np.array([0.0, 2.0, 0.0, 0.0]), 0.02 * np.eye(4))
    generator = np.random.default_rng(0)
    for k in range(200):
        scale = sigmas if k % 10 == 5 else 1.0
        track.measure(generator.normal(0, scale * math.sqrt(0.1), 2))
        assert np.isfinite(track.world.bank.hypotheses["log_probability"]).all()
        np.testing.assert_allclose(track.probabilities().sum(), 1, rtol=1e-12)
        assert np.isfinite(track.estimate()).all()
        assert (np.diag(track.covariance()) > 0).all()


EXTREME = [
    {
        "speed": 1e9,
        "radii": (1e12,),
        "measurement_variance": 1e18,
    },
    {
        "speed": 1e-9,
        "tau": 1e-9,
        "measurement_variance": 1e-18,
        "radii": (1e-12, 1e-6),
    },
    {
        "speed": 300.0,
        "radii": (1.0,),
        "measurement_variance": 1e-9,
    },
    {
        "process_variance": 1e18,
        "measurement_variance": 1e18,
        "tau": 1e-9,
    },
    {
        "process_variance": 0.0,
        "initial_error": 0,
        "measurement_variance": (1e-6, 1e3),
    },
    {"noise": "outliers 0.9", "measurement_variance": (1e3, 1e-3)},
    {"hazard": 0.0, "noise": "outliers 0.3"},
    {"hazard": 2 / 3},
]


@pytest.mark.parametrize("options", EXTREME, ids=str)
def test_extreme_options_give_finite_rows_inside_the_space(options):
    env = HybridTrackQuickestVectorEnv(LANES + 1, **options)
    rows, _ = env.reset(seed=1)
    for k in range(700):
        assert env.observation_space.contains(rows), k
        rows, rewards, *_ = env.step(np.full(LANES + 1, k % 3))
        assert np.isfinite(rewards).all()
