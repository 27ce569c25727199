"""Laws of the durations of segments, and the segments that the environment draws from them."""

from dataclasses import dataclass

import numpy as np
import pytest
from hostile_input import refused

from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions
from hybrid_env.durations import (
    DurationLaw,
    duration_probabilities,
    parse_durations,
    remaining_probabilities,
)
from hybrid_env.limits import Ticks

LAWS = ["25 + geometric 50", "geometric 75", "uniform 50-100", "uniform 7-7", "geometric 1"]


@pytest.mark.parametrize("text", LAWS)
def test_a_law_is_its_text_and_its_probabilities_sum_to_1(text):
    law = parse_durations(text)
    assert str(law) == text
    assert parse_durations(law) == law == parse_durations(f" {text} ")
    ticks = np.arange(1, 3001)
    probabilities = duration_probabilities(law, 3000)
    np.testing.assert_allclose(probabilities.sum(), 1, rtol=1e-12)
    np.testing.assert_allclose(
        probabilities @ ticks,
        law.mean_duration,
        rtol=1e-12,
    )
    # The law of the remaining ticks is stationary: one tick later the same, after switches
    # included.
    remaining = remaining_probabilities(law, 3000)
    np.testing.assert_allclose(remaining.sum(), 1, rtol=1e-12)
    later = np.append(remaining[1:], 0) + remaining[0] * probabilities
    np.testing.assert_allclose(later, remaining, atol=1e-15)


@dataclass(frozen=True)
class RegularDurations(DurationLaw):
    """A law that only this file has: all segments have the same duration."""

    form = r"every (?P<each>[0-9]+)"

    each: Ticks

    @property
    def mean_duration(self):
        """The duration of every segment [ticks]."""
        return float(self.each)

    def survival(self, ticks):
        """Return 1 up to the duration, and 0 from it on, (ticks + 1,)."""
        return (np.arange(ticks + 1) < self.each).astype(float)

    def __str__(self):
        return f"every {self.each}"


def test_a_subclass_is_a_law_that_a_text_can_name():
    probabilities = QuickestOptions(durations="every 9").duration_laws
    np.testing.assert_array_equal(probabilities, np.eye(600)[[8] * 4])
    text = "straight every 9 or geometric 3, turns every 7"
    assert str(parse_durations(text)) == text


@pytest.mark.parametrize("value", ["", "geometric 0.5", "uniform 100-50", "uniform 5-" + "9" * 19])
def test_other_values_are_refused_in_one_line(value):
    refused(QuickestOptions, durations=value)


@pytest.mark.parametrize("text", LAWS[:3])
def test_the_environment_draws_durations_and_modes_from_the_law(text):
    tracks = 2000
    ticks = 400
    env = HybridTrackQuickestVectorEnv(
        tracks,
        tick_info=True,
        durations=text,
        ticks=ticks,
        start="random",
    )
    _, info = env.reset(seed=1)
    modes = [info["true_mode"]]
    segments = [info["segment"]]
    for _ in range(ticks - 1):
        *_, info = env.step(np.zeros(tracks, np.int64))
        modes.append(info["true_mode"])
        segments.append(info["segment"])
    modes, segments = np.array(modes), np.array(segments)
    switched = np.diff(segments, axis=0) == 1

    np.testing.assert_array_equal(
        switched,
        np.diff(modes, axis=0) != 0,
    )
    # Switches are stationary: as many in every part of the episode.
    law = parse_durations(text)
    expected = tracks * 50 / law.mean_duration
    for part in np.split(
        switched[:-1].sum(1)[: ticks - 50],
        (ticks - 50) // 50,
    ):
        assert abs(part.sum() - expected) < 6 * np.sqrt(expected)
    # Every mode follows each of the two others equally often.
    before = modes[:-1][switched]
    after = modes[1:][switched]
    counts = np.array(
        [((before == i) & (after == j)).sum() for i in range(3) for j in range(3) if i != j]
    )
    assert (abs(counts - counts.mean()) < 6 * np.sqrt(counts.mean())).all()
    # First segments, and second ones that begin early enough, have their laws.
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
