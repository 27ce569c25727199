"""Modes, laws of the noise and texts of every kind: each is refused in one line, or the world that
it makes has rows inside the observation space.
"""

import functools

import numpy as np
import pytest
from hostile_input import accepted, counts
from own_modes import SCALES, every_mode
from random_worlds import random_options

from hybrid_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv, parse_scheme
from hybrid_env.checks import ArgumentError
from hybrid_env.durations import parse_durations
from hybrid_env.modes import LinearMode, parse_modes
from hybrid_env.sensors import parse_sensors

PIECES = [" ", "\t", "a", "1", "+", ",", ";", "-", "!", ".", "S1", "9 straight", "left 5", "stop"]
PIECES += ["uniform 5-9", "geometric 75", " or ", "turn rate 0.2", "0.4", " at ", " period 5", "r5"]
PARSERS = parse_modes, parse_scheme, parse_durations, lambda text: parse_sensors([text])


def grow(seed):
    """Step a world with a random linear mode."""
    generator = np.random.default_rng(seed)
    n = generator.choice([4, 6])
    sizes = 10.0 ** generator.uniform(-6.0, 15.0, 3)
    entries = generator.normal(size=(n, n)) * (generator.random((n, n)) < 0.3) * sizes[0]
    if generator.random() < 0.5:
        entries = np.triu(entries, 1)
    mode = LinearMode(
        generator.choice([0.0, 1.0, 1.02, -1.0]) * np.eye(n) + entries,
        generator.choice([0.0, sizes[1]]) * generator.normal(size=n),
        generator.choice([0.0, sizes[2]]) * np.diag(generator.random(n)),
        name="own",
    )
    kind = generator.choice([HybridTrackVectorEnv, HybridTrackQuickestVectorEnv])
    tau = float(10.0 ** generator.normal())
    env = accepted(lambda: kind(8, modes=("straight", mode), tau=tau))
    if env is None:
        return
    rows, _ = env.reset(seed=seed)
    for _ in range(200):
        assert env.observation_space.contains(rows), seed
        rows, *_ = env.step(generator.integers(0, 2, 8))


@pytest.mark.parametrize("cases", counts(60, 1_000))
def test_rows_of_modes_that_grow_are_inside_the_space(cases):
    for kind in (HybridTrackVectorEnv, HybridTrackQuickestVectorEnv):
        # Its code is compiled.
        kind(1, modes="straight, stop")
    for seed in range(cases):
        grow(seed)


def scattered_mode(generator, tau):
    """Draw a linear mode with entries of any size in units of a tick."""
    units = tau ** np.array([0.0, 1.0, 0.0, 1.0])
    size = 10.0 ** generator.uniform(-6.0, 3.0)
    entries = generator.normal(size=(4, 4)) * (generator.random((4, 4)) < 0.3) * size
    F = generator.choice([0.0, 1.0, -1.0]) * np.eye(4) + np.triu(entries, 1)
    return LinearMode(F * units / units[:, None], name="scattered")


def scattered_world(generator, own_modes, announced):
    """Return a world of random options; with modes of one's own None if it is refused."""
    options = random_options(generator)
    if own_modes:
        scale = generator.choice(list(SCALES))
        kind = HybridTrackVectorEnv if announced else HybridTrackQuickestVectorEnv
        names = "noise", "missed", *(("follow", "initial_error") if announced else ())
        try:
            mode = scattered_mode(generator, SCALES[scale]["tau"])
            options = {name: options[name] for name in names} | SCALES[scale]
            return kind(8, bank_info=True, modes=(*every_mode(scale), mode), **options)
        except ArgumentError:
            return None
    return HybridTrackVectorEnv(8, bank_info=True, **options)


def check_covariances(seed):
    """Check the covariances of every filter of a random world in 40 ticks."""
    generator = np.random.default_rng(seed)
    env = scattered_world(generator, seed % 4 == 3, seed % 8 < 4)
    if env is None:
        return
    env.reset(seed=seed)
    for k in range(40):
        waits = generator.random(8) < 0.9
        actions = np.where(waits, 0, generator.integers(0, env.single_action_space.n, 8))
        *_, info = env.step(actions)
        P = info["covariances"]
        np.testing.assert_array_equal(P, np.swapaxes(P, 2, 3))
        variances = np.diagonal(P, 0, 2, 3)
        assert (variances >= 0.0).all(), (seed, k)
        units = np.sqrt(np.where(variances > 0.0, variances, 1.0))
        correlations = P / units[..., None] / units[..., None, :]
        assert np.linalg.eigvalsh(correlations).min() > -1e-9, (seed, k)


@pytest.mark.parametrize("cases", counts(8, 1_000))
def test_covariances_of_every_filter_are_positive_semidefinite(cases):
    for seed in range(24, 24 + cases):
        check_covariances(seed)


@pytest.mark.parametrize("cases", counts(60, 1_000))
def test_long_texts_are_read_or_refused_at_once(cases):
    for seed in range(cases):
        generator = np.random.default_rng(seed)
        pieces = generator.choice(PIECES, (2, 4)).tolist()
        middle = "".join(pieces[0][: generator.integers(1, 5)])
        text = pieces[1][0] + middle * int(10.0 ** generator.uniform(2.0, 4.5)) + pieces[1][1]
        for parse in PARSERS:
            accepted(functools.partial(parse, text))
