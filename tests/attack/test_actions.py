"""Actions of every type to every environment: refused in one line, or the step of an integer."""

import operator

import gymnasium as gym
import numpy as np
import pytest
import torch
from hostile_input import LONGEST, VALUES, counts

from hybrid_env.registration import ENVIRONMENTS


class Index:
    """An integer to Python, and nothing to Gymnasium."""

    def __init__(self, value):
        self.value = value

    def __index__(self):
        return self.value

    def __repr__(self):
        return "first line\nsecond line" * 100


OTHERS = [
    torch.tensor(1),
    torch.tensor(1.0),
    torch.tensor([1, 0, 2]),
    torch.zeros(3, requires_grad=True),
    Index(1),
    Index(9),
    Index(-1),
    Index(10**30),
    [Index(1)] * 3,
    np.timedelta64(1, "s"),
    np.ones(3, "m8[s]"),
    "a\nb",
    "abc",
    b"1",
    [[1, 2], [3]],
    np.array(1),
    np.array([1]),
    np.zeros((3, 1), int),
    np.zeros(4, int),
    np.ma.masked_array([1, 1, 1], [0, 1, 0]),
    object(),
    len,
    1j,
]
TYPES = [
    bool,
    int,
    float,
    complex,
    np.int8,
    np.uint8,
    np.int16,
    np.int64,
    np.uint64,
    np.float32,
    np.bool_,
    np.array,
    str,
    Index,
    torch.tensor,
]
NUMBERS = [*range(-3, 25), 127, 255, 2**31, 2**32, 2**62, 2**63 - 1, -(2**31), -(2**63)]


def one_action(generator, count):
    """Any value, more often one near the action space."""
    choice = generator.random()
    if choice < 0.1:
        return VALUES[generator.integers(len(VALUES))]
    if choice < 0.2:
        return OTHERS[generator.integers(len(OTHERS))]
    number = (
        int(generator.integers(count))
        if choice < 0.6
        else NUMBERS[generator.integers(len(NUMBERS))]
    )
    try:
        return TYPES[generator.integers(len(TYPES))](number)
    except OverflowError:
        return number


def several(generator, count):
    """Any value, more often three actions, of which all or one are hostile."""
    choice = generator.random()
    if choice < 0.2:
        return one_action(generator, count)
    if choice < 0.6:
        return [one_action(generator, count) for _ in range(3)]
    found = generator.integers(0, count, 3).astype(
        generator.choice(["i1", "i4", "i8", "u1", "u8", "f4", "O"])
    )
    if choice < 0.7:
        found[generator.integers(3)] = generator.integers(0, 100)
    return torch.tensor(found) if choice > 0.9 and found.dtype != object else found


def meant(action):
    """The integer of an action, or None."""
    try:
        return operator.index(action)
    except TypeError:
        return None


def all_meant(actions):
    """The integers of an array of actions, or None."""
    try:
        array = np.asarray(actions)
    except (TypeError, ValueError, RuntimeError):
        return None
    return array.tolist() if array.shape == (3,) and array.dtype.kind in "iu" else None


def attack_actions(envs, draw, read, generator, cases):
    """Step an environment by hostile actions, and a second one by the integers that they mean."""
    env, other = envs
    count = env.unwrapped.world.options.action_count
    refused = 0
    done = True
    for _ in range(cases):
        if np.all(done):
            seed = int(generator.integers(2**31))
            assert np.array_equal(env.reset(seed=seed)[0], other.reset(seed=seed)[0])
        action = draw(generator, count)
        integers = read(action)
        if integers is None or not all(0 <= one < count for one in np.atleast_1d(integers)):
            with pytest.raises(gym.error.InvalidAction) as found:
                env.step(action)
            assert "\n" not in str(found.value)
            assert len(str(found.value)) <= LONGEST
            refused += 1
            continue
        row, reward, done, _, _ = env.step(action)
        expected = other.step(
            integers if isinstance(integers, int) else np.array(integers, np.int64)
        )
        assert np.array_equal(row, expected[0])
        assert np.array_equal(reward, expected[1])
        assert np.array_equal(done, expected[2])
    assert 0.2 * cases < refused < 0.9 * cases


@pytest.mark.parametrize("cases", counts(1_000))
@pytest.mark.parametrize("env_id", ENVIRONMENTS)
def test_hostile_actions(env_id, cases):
    generator = np.random.default_rng(1)
    attack_actions(
        [gym.make(env_id).unwrapped for _ in range(2)],
        one_action,
        meant,
        generator,
        cases,
    )
    attack_actions(
        [gym.make_vec(env_id, 3) for _ in range(2)],
        several,
        all_meant,
        generator,
        cases,
    )
