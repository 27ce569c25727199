"""Tracking of recordings of objects of any size, with and without known switches."""

import numpy as np
import pytest
from recorded_tracks import LENGTHS, OBJECTS, PIECES, TRUE_MODES, drive

from agents.recordings.tracking import track_recording
from hybrid_env.simulation import simulate

CAR = OBJECTS["car"]
TRUE = np.repeat([2, 1, 0, 1], PIECES)
TIMES, DRIVE = drive()


@pytest.mark.parametrize(
    ("name", "runs", "seed", "least"),
    # 28 pieces, each right with a probability of 0.97: fewer than 24 are right with a probability
    # of 1e-3; and 560 pieces, with a standard error of at most 0.9 %.
    [
        *((name, 2, 1, 24 / 28) for name in ("readme", "aircraft")),
        *(pytest.param(name, 40, 7, 0.95, marks=pytest.mark.study) for name in OBJECTS),
    ],
)
def test_pieces_of_known_lengths_are_right_at_any_scale(name, runs, seed, least):
    target = OBJECTS[name]
    known = {"lengths": LENGTHS, "radii": (target.radius,)}
    right = [
        track_recording(target.times(len(run)), run, **known).pieces[:, 2] == TRUE_MODES
        for run in target.simulate(runs, seed).measurements
    ]
    assert np.mean(right) >= least


def test_a_car_is_tracked_without_any_option():
    free = track_recording(TIMES, DRIVE)
    assert (free.modes == TRUE).mean() > 0.98
    assert (free.modes[:20] == TRUE[:20]).all()
    begins = TIMES[np.cumsum(PIECES[:-1])]
    assert (free.moments[1:, 0] <= begins).all()
    assert (begins <= free.moments[1:, 1]).all()
    assert free.model.radii == pytest.approx((200.0,), rel=0.03)
    assert free.warnings == []


def test_a_drift_of_the_positions_is_found_and_is_no_turn():
    """Errors of a GPS remember earlier ones: their steps here are 1.5 times the white noise."""
    steps = np.random.default_rng(3).normal(0.0, 1.5 * CAR.measurement_variance**0.5, (220, 2))
    drifting = track_recording(TIMES, DRIVE + np.cumsum(steps, axis=0))

    assert "drift_variance" in drifting.model.estimated
    assert drifting.model.drift_variance == pytest.approx(2.25 * CAR.measurement_variance, rel=0.5)
    assert (drifting.modes == TRUE).mean() > 0.9
    assert track_recording(TIMES, DRIVE).model.drift_variance == 0.0


def test_the_example_of_the_readme_is_right():
    run = simulate("L60r3 R75r5 S50 L60r10").measurements[0]
    tracked = track_recording(None, run, lengths=(60, 75, 50, 60), radii=(3.0, 5.0, 10.0))
    names = [tracked.mode_names()[mode] for mode in tracked.pieces[:, 2]]

    assert names == ["L 3", "R 5", "S", "L 10"]


# With hindsight a node that is barely kept in one unit may be left out in the other.
@pytest.mark.parametrize(("live", "tolerance"), [(True, 1e-6), (False, 1e-4)])
@pytest.mark.parametrize("options", [{}, {"lengths": PIECES}])
def test_units_change_no_decision(options, live, tolerance):
    length, time = 1000.0, 60.0
    plain = track_recording(TIMES, DRIVE, live=live, **options)
    other = track_recording(time * TIMES, length * DRIVE, live=live, **options)

    np.testing.assert_array_equal(other.pieces, plain.pieces)
    np.testing.assert_allclose(other.probabilities, plain.probabilities, atol=tolerance)
    positions = plain.estimates[:, ::2]
    np.testing.assert_allclose(other.estimates[:, ::2] / length, positions, atol=1e-3)


def test_missing_rows_are_predicted():
    kept = np.random.default_rng(0).random(220) > 0.2
    kept[[0, -1]] = True
    empty = np.where(kept[:, None], DRIVE, np.nan)
    with_rows = track_recording(TIMES, empty)
    without_rows = track_recording(TIMES[kept], DRIVE[kept])

    np.testing.assert_array_equal(with_rows.modes[kept], without_rows.modes)
    assert (with_rows.modes == TRUE).mean() > 0.9
    assert np.isfinite(with_rows.estimates).all()


@pytest.mark.parametrize(("rows", "options"), [(2, {}), (4, {"lengths": (1,)})])
def test_very_short_recordings_have_results(rows, options):
    run = np.random.default_rng(1).normal(0.0, 0.3, (rows, 2)) + np.arange(rows)[:, None]
    tracked = track_recording(None, run, **options)

    assert ((tracked.modes >= 0) & (tracked.modes < tracked.probabilities.shape[1])).all()
    assert np.isfinite(tracked.estimates[-1]).all()
    assert "cannot be checked" in tracked.warnings[0]
