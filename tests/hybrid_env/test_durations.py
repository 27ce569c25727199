"""Laws of the durations of segments, and the segments that the environment draws from them."""

from dataclasses import dataclass

import numpy as np
import pytest

from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions
from hybrid_env.durations import (
    DurationLaw,
    duration_probabilities,
    parse_durations,
    remaining_probabilities,
)


@pytest.mark.parametrize("text", ["25 + geometric 50", "uniform 30-40 or uniform 80-90"])
def test_a_law_is_its_text_and_its_probabilities_sum_to_1(text):
    law = parse_durations(text)
    assert str(law) == text
    ticks = np.arange(1, 3001)
    probabilities = duration_probabilities(law, 3000)
    np.testing.assert_allclose(probabilities.sum(), 1, rtol=1e-12)
    np.testing.assert_allclose(probabilities @ ticks, law.mean_duration, rtol=1e-12)
    # The law of the remaining ticks is stationary: one tick later the same, after switches
    # included.
    remaining = remaining_probabilities(law, 3000)
    np.testing.assert_allclose(remaining.sum(), 1, rtol=1e-12)
    later = np.append(remaining[1:], 0) + remaining[0] * probabilities
    np.testing.assert_allclose(later, remaining, atol=1e-15)


@dataclass(frozen=True)
class Always(DurationLaw):
    """A law as a user writes it: one duration [ticks]."""

    ticks: int = 7

    @property
    def mean_duration(self):
        """Expected duration [ticks]."""
        return float(self.ticks)

    def survival(self, ticks):
        """Return the probabilities of longer durations."""
        return (np.arange(ticks + 1) < self.ticks).astype(float)


def test_a_law_of_the_user_is_drawn_and_hinders_no_text():
    env = HybridTrackQuickestVectorEnv(8, ticks=60, tick_info=True, durations=Always())
    modes, segments, _ = timeline(env, 60, 1)

    assert set(segments_of(modes, segments)[:, 2]) == {7}
    assert str(parse_durations("uniform 5-9")) == "uniform 5-9"


def timeline(env, ticks, seed):
    """Return modes and segments of all ticks, (T, N), and the first info."""
    _, first = env.reset(seed=seed)
    recorded = [(first["true_mode"], first["segment"])]
    for _ in range(ticks - 1):
        *_, info = env.step(np.zeros(env.num_envs, np.int64))
        recorded.append((info["true_mode"], info["segment"]))
    return *np.moveaxis(np.array(recorded), 1, 0), first


def segments_of(modes, segments):
    """Return the mode, the next mode and the length of all complete segments after the first."""
    complete = []
    for mode, number in zip(modes.T, segments.T, strict=True):
        starts = np.flatnonzero(np.diff(number)) + 1
        complete += zip(mode[starts[:-1]], mode[starts[1:]], np.diff(starts), strict=True)
    return np.array(complete)


@pytest.mark.parametrize("text", ["25 + geometric 50", "uniform 50-100"])
def test_the_environment_draws_durations_from_the_law(text):
    ticks = 300
    env = HybridTrackQuickestVectorEnv(
        1000, tick_info=True, durations=text, ticks=ticks, start="random"
    )
    modes, segments, _ = timeline(env, ticks, 1)
    np.testing.assert_array_equal(np.diff(segments, axis=0) == 1, np.diff(modes, axis=0) != 0)
    # First segments, and second ones that begin early enough, have their laws.
    law = parse_durations(text)
    first = (segments == 0).sum(0)
    second = (segments == 1).sum(0)[first < 100]
    for lengths, probabilities in (
        (first, remaining_probabilities(law, ticks)),
        (second, duration_probabilities(law, ticks)),
    ):
        for limit in (30, 60, 90):
            share = probabilities[:limit].sum()
            deviation = np.sqrt(lengths.size * share * (1 - share)) + 1
            assert abs((lengths <= limit).sum() - lengths.size * share) < 5 * deviation


def test_a_drawn_law_and_order_are_those_of_the_episode():
    tracks = 30
    ticks = 2000
    env = HybridTrackQuickestVectorEnv(
        tracks, ticks=ticks, tick_info=True, durations="drawn", transitions="drawn"
    )
    modes, segments, info = timeline(env, ticks, 1)

    np.testing.assert_allclose(info["transitions"].sum(2), 1.0)
    for track in range(tracks):
        switches = segments_of(modes[:, [track]], segments[:, [track]])
        expected = info["transitions"][track][switches[:, 0], switches[:, 1]]
        assert (expected > 0).all()
    assert len({str(law) for law in info["law"]}) == tracks


def test_a_fixed_order_and_laws_by_mode_are_followed():
    order = "0 0.9 0.1, 0.2 0 0.8, 1 0 0"
    law = "straight uniform 20-30, turns uniform 5-6 or uniform 9-9"
    env = HybridTrackQuickestVectorEnv(
        200, tick_info=True, ticks=500, durations=law, transitions=order
    )
    drawn = segments_of(*timeline(env, 500, 2)[:2])
    counts = np.zeros((3, 3))
    np.add.at(counts, (drawn[:, 0], drawn[:, 1]), 1)
    expected = env.options.next_mode_matrix

    np.testing.assert_allclose(counts / counts.sum(1, keepdims=True), expected, atol=0.03)
    assert set(drawn[drawn[:, 0] == 0, 2]) == set(range(20, 31))
    turns = drawn[drawn[:, 0] > 0, 2]
    assert set(turns) == {5, 6, 9}
    assert abs((turns == 9).mean() - 0.5) < 0.03
    assert QuickestOptions(transitions=expected.tolist()).transitions == env.options.transitions
