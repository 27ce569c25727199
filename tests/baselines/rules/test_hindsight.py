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


def test_gradual_turns_begin_when_the_curvature_does():
    # 20 m/s and 2 m: a car, each second.
    options = QuickestOptions(
        speed=20.0, radii=(200.0,), tau=1.0, measurement_variance=4.0, durations="geometric 40"
    )
    known = {"tau": 1.0, "process_variance": 1e-3, "measurement_variance": 4.0}
    begins = [40, 80, 120, 160]
    errors = {False: [], True: []}
    held = []
    for gradual, seed in itertools.product(errors, range(5)):
        first = "4r400 {0}36r200" if gradual else "40r200"
        scheme = "S40 {L} S40 {R} S40".format(**{k: k + first.format(k) for k in "LR"})
        simulated = simulate(scheme, seed=seed, start=(0.0, 20.0, 0.0, 0.0), **known)
        result = smooth_modes(simulated.measurements[0], options)
        assert result.pieces[:, 2].tolist() == [0, 1, 0, 2, 0]
        errors[gradual] += (result.pieces[1:, 0] - begins).tolist()
        low, high = result.moments[1:].T
        held += ((low <= begins) & (begins <= high)).tolist()
    assert np.abs(errors[False]).max() <= 1
    assert np.abs(errors[True]).max() <= 3
    assert np.mean(np.abs(errors[True])) < 1.0
    # Forty begins; three standard errors below .95.
    assert np.mean(held) > 0.84


def test_gradual_turns_of_many_pieces_begin_when_the_curvature_does():
    """Of so many pieces not all are asked how they begin."""
    options = QuickestOptions(
        speed=20.0, radii=(200.0,), tau=1.0, measurement_variance=4.0, durations="geometric 40"
    )
    scheme = " ".join(f"{side}4r400 {side}36r200 S40" for side in "LR" * 70)
    known = {"tau": 1.0, "process_variance": 1e-3, "measurement_variance": 4.0}
    z = simulate(scheme, seed=0, start=(0.0, 20.0, 0.0, 0.0), **known).measurements[0]
    result = smooth_modes(z, options, process_share=0.3)

    begins = np.arange(0, len(z), 40)
    assert len(result.pieces) == len(begins) == 280
    assert (np.abs(result.pieces[:, 0] - begins) <= 2).mean() > 0.9
    low, high = result.moments.T
    # The probability of each is 0.95.
    assert ((low <= begins) & (begins <= high)).mean() > 0.9
    assert (high - low).max() <= 20


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
