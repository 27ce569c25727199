"""Modes and moments of whole recordings."""

import itertools

import numpy as np
import pytest

from baselines import smooth_modes
from baselines.rules.hindsight import choose_modes
from hybrid_env import QuickestOptions, simulate
from hybrid_env.checks import ArgumentError

OPTIONS = QuickestOptions(measurement_variance=0.01, durations="geometric 60", start="random")


def seen(scheme, seed, **changed):
    """Measurements (T, 2)."""
    return simulate(scheme, seed=seed, **{"measurement_variance": 0.01} | changed).measurements[0]


@pytest.mark.parametrize("cost", [0.3, 1.5])
def test_the_chosen_modes_have_the_largest_sum(cost):
    rng = np.random.default_rng(3)
    for _ in range(20):
        probabilities = rng.dirichlet([0.4] * 3, 6)

        def value(modes, of=probabilities):
            return of[range(6), modes].sum() - cost * np.count_nonzero(np.diff(modes))

        best = max(map(value, itertools.product(range(3), repeat=6)))
        assert value(choose_modes(probabilities, np.ones(6), cost)) == pytest.approx(best, abs=1e-4)


def test_pieces_begin_where_the_object_switches():
    z = seen("S70 L60r5 R70r5", 4)
    z[[20, 21, 75, 131]] = np.nan
    result = smooth_modes(z, OPTIONS)

    assert result.pieces[:, 2].tolist() == [0, 1, 2]
    assert np.abs(result.pieces[:, 0] - [0, 70, 130]).max() <= 2
    low, high = result.moments.T
    assert (low <= result.pieces[:, 0]).all()
    assert (result.pieces[:, 0] <= high).all()
    assert (high - low)[1:].max() < 20
    np.testing.assert_allclose(result.probabilities.sum(1), 1.0)
    # The first rows, of which a live rule knows nothing yet.
    assert result.probabilities[:30, 0].min() > 0.7


@pytest.mark.parametrize(
    ("turn", "pairs", "mean"),
    [
        ("{0}40r200", 10, 0.1),
        ("{0}4r400 {0}36r200", 10, 1.0),
        # Of so many pieces not all are asked how they begin.
        ("{0}4r400 {0}36r200", 70, 1.0),
    ],
)
def test_turns_begin_when_the_curvature_does(turn, pairs, mean):
    # 20 m/s and 2 m: a car, each second.
    options = QuickestOptions(
        speed=20.0, radii=(200.0,), tau=1.0, measurement_variance=4.0, durations="geometric 40"
    )
    known = {"tau": 1.0, "process_variance": 1e-3, "measurement_variance": 4.0}
    scheme = " ".join(f"{turn.format(side)} S40" for side in "LR" * pairs)
    z = simulate(scheme, seed=0, start=(0.0, 20.0, 0.0, 0.0), **known).measurements[0]
    result = smooth_modes(z, options)

    begins = np.arange(0, len(z), 40)
    assert result.pieces[:, 2].tolist() == [1, 0, 2, 0] * pairs
    assert np.abs(result.pieces[:, 0] - begins).mean() < mean
    low, high = result.moments.T
    # Three standard errors below .95.
    least = 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / len(begins))
    assert ((low <= begins) & (begins <= high)).mean() > least


def test_an_outlier_is_no_switch_with_a_robust_likelihood():
    clean = seen("S120", 7)
    z = clean.copy()
    z[50] += [0.0, 3.0]
    robust = QuickestOptions(**vars(OPTIONS) | {"likelihood": "student_t 4"})
    without, result = (smooth_modes(points, robust) for points in (clean, z))
    assert len(result.pieces) == 1
    assert np.abs(result.estimates - without.estimates).max() < 0.1
    normal = smooth_modes(z, OPTIONS)
    assert np.abs(normal.estimates - without.estimates).max() > 0.15


def test_measurements_that_cannot_begin_a_track_are_refused():
    without_sensor = np.full((5, 9), np.nan)
    without_sensor[:, :5] = [0.0, 0.0, 1.0, 0.0, 1.0]
    for given, reason in (([[np.nan, np.nan], [1.0, 2.0]], "first row"), (without_sensor, "")):
        with pytest.raises(ArgumentError, match=f"measurements.*{reason}"):
            smooth_modes(given, OPTIONS)
