"""A law of the measurement noise that a user writes."""

import math
import sys

import gymnasium as gym
import numpy as np
import pytest
from own_noise import Rounded

from hybrid_env import ArgumentError, HybridTrackVectorEnv, OwnNoise, simulate


def test_simulations_draw_such_errors():
    run = simulate("S30", 100, measurement_variance=4.0, noise=Rounded(0.25))
    steps = (run.measurements - run.truth[:, :, ::2]) / (2.0 * 0.25)
    np.testing.assert_allclose(steps, steps.round(), atol=1e-6)
    assert steps.std() == pytest.approx(4.0, rel=0.1)


class Raising(OwnNoise):
    """Raises in one of 10,000 measurements."""

    def draw(self, u):
        """Return both errors."""
        if u[0] > 0.9999:
            raise ValueError("far out")
        return u[0], u[1]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_law_that_raises_in_an_episode_raises_in_its_step(threads, monkeypatch):
    printed = []
    monkeypatch.setattr(sys, "unraisablehook", lambda raised: printed.append(str(raised.exc_value)))
    env = HybridTrackVectorEnv(1000, threads=threads, noise=Raising())
    env.reset(seed=1)

    def run():
        for _ in range(50):
            env.step(np.zeros(1000, int))

    with pytest.raises(ArgumentError, match="noise: `draw` raised the exception"):
        run()
    env.close()
    assert set(printed) == {"far out"}


def law(draw):
    """Return a law with this function, as one without fields."""
    return type("Law", (OwnNoise,), {"draw": draw})()


@pytest.mark.parametrize(
    ("draw", "reason"),
    [
        (lambda self, u: absent(u), "NameError: name 'absent' is not defined"),  # noqa: F821
        (lambda self, u: (self.scale * u[0], u[1]), "'Law' object has no attribute 'scale'"),
        (lambda self, u: u[0], "it returns 0.63"),
        (lambda self, u: (math.log(u[0] - 2.0), 0.0), "ValueError: math domain error"),
        (lambda self, u: (math.inf, 0.0), r"it returns \(inf, 0.0\)"),
        (lambda self, u: (sorted(u, key=abs)[0], 0.0), "TypingError: No implementation"),
    ],
    ids=["name", "field", "shape", "domain", "infinite", "compilation"],
)
def test_a_law_that_cannot_be_drawn_is_refused_in_one_line(draw, reason):
    with pytest.raises(ArgumentError, match=reason) as error:
        gym.make("hybrid_env:HybridTrack-v0", noise=law(draw))

    assert str(error.value).startswith("noise=Law() is not allowed: expected a law that draws two")
    assert "\n" not in str(error.value)
