"""Climbs and descents: where the rate changes, and how accurately it is known."""

import numpy as np
import pytest
from scipy.signal import lfilter

from baselines.recordings.altitude import vertical_motion

RATES = np.repeat([0.0, 5.0, 0.0, -3.0], 200)
TRUE = np.cumsum(RATES)
WORDS = ["level", "climb", "level", "descend"]


@pytest.mark.parametrize("unit", [1.0, 1e-3, 3e5])
@pytest.mark.parametrize("kind", ["white", "memory", "steps of 25 feet", "exact"])
def test_pieces_and_rates_are_found_in_any_unit(kind, unit):
    generator = np.random.default_rng(2)
    measured = {
        "white": TRUE + 3.0 * generator.normal(size=len(TRUE)),
        # Errors of an altimeter that change slowly.
        "memory": TRUE + lfilter([1.0], [1.0, -0.95], generator.normal(size=len(TRUE))),
        "steps of 25 feet": np.round(TRUE / 7.62) * 7.62,
        "exact": TRUE,
    }[kind]
    found = vertical_motion(0.5 * unit * np.arange(len(TRUE)), unit * measured, [(0, len(TRUE))])
    assert found.words() == WORDS
    np.testing.assert_allclose(found.pieces[1:, 0], [200, 400, 600], atol=6)
    np.testing.assert_allclose(found.of_pieces[:, 0], [0.0, 10.0, 0.0, -6.0], atol=0.15)
    # The line is nearer to the truth than the measurements are.
    errors = [np.sqrt(np.mean((each - TRUE) ** 2)) for each in (found.altitudes / unit, measured)]
    assert errors[0] <= 0.9 * errors[1] + 0.5 * (kind != "white")


def test_deviations_of_the_rates_are_true():
    times, squares = np.arange(len(TRUE)) * 1.0, []
    for seed in range(60):
        noise = 4.0 * np.random.default_rng(seed).normal(size=len(TRUE))
        found = vertical_motion(times, TRUE + noise, [(0, len(TRUE))])
        assert found.words() == WORDS
        errors = found.of_pieces[:, 0] - RATES[::200]
        squares.append((errors / found.of_pieces[:, 1]) ** 2)
    # The mean of 240 squares of standard normal numbers, of which neighbours are correlated.
    assert 0.7 < np.mean(squares) < 1.4


def test_missing_altitudes_and_gaps_are_between_and_outside_of_pieces():
    measured = TRUE + 2.0 * np.random.default_rng(1).normal(size=len(TRUE))
    measured[[5, 300, 301]] = np.nan
    # A receiver without an altitude.
    measured[[20, 250, 600]] = -9999.0
    found = vertical_motion(np.arange(len(TRUE)) * 1.0, measured, [(0, 390), (410, 800)])
    assert np.isfinite(found.altitudes[[5, 300]]).all()
    assert np.isnan(found.altitudes[390:410]).all()
    assert found.words() == ["level", "climb", "level", "descend"]
