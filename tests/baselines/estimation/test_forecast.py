"""Forecasts of the position."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from kinematic_worlds import draw, mean_bounds
from matrix_filters import move, turn_state
from recorded_tracks import OBJECTS

from baselines.estimation.forecast import forecast
from baselines.estimation.turn_tracks import TurnTracks
from hybrid_env import ArgumentError, QuickestOptions, WorldOptions
from hybrid_env.modes import Stop, Straight, modes_of_radii

ESTIMATE = np.array([1.0, 2.0, -1.0, 0.5])
COVARIANCE = np.diag([0.05, 0.01, 0.04, 0.02]) + 0.005
MODEL = SimpleNamespace(all_modes=modes_of_radii((4.0, 9.0)), tau=0.1, process_variance=0.002)
AHEAD = [1.0, 2.0, 5.0]


def moved_positions(rng, curvature, samples):
    """Positions (samples, 3, 2) after the times of `AHEAD`, tick by tick about a fixed centre."""
    state = draw(rng, ESTIMATE, COVARIANCE, samples).T
    without = np.vstack([state, np.zeros((3, samples))])
    state = turn_state(state, 1.0 / curvature) if curvature else without
    places = []
    for _ in range(50):
        state = move(state, MODEL.tau)
        state[[1, 3]] += np.sqrt(MODEL.process_variance) * rng.normal(size=(2, samples))
        places.append(state[[0, 2]].T)
    return np.stack([places[round(time / MODEL.tau) - 1] for time in AHEAD], axis=1)


@pytest.mark.parametrize(
    "probabilities",
    [[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, 0, 1], [0.5, 0.2, 0.1, 0.15, 0.05]],
)
def test_a_forecast_has_the_moments_of_the_true_motion_in_all_modes(probabilities):
    rng = np.random.default_rng(8)
    samples = 100_000
    curvatures = [0.0, 1 / 4, 1 / 9, -1 / 4, -1 / 9]
    counts = rng.multinomial(samples, probabilities)
    moved = np.concatenate(
        [moved_positions(rng, *each) for each in zip(curvatures, counts, strict=True)]
    )
    means, covariances = forecast(ESTIMATE, COVARIANCE, probabilities, MODEL, AHEAD)
    for k in range(3):
        places = moved[:, k]
        error = np.sqrt(np.diag(covariances[k]) / samples)
        deviations = np.sqrt(np.diag(covariances[k]))
        # Five standard errors, and what is neglected: speed and turn rate are not normal.
        assert (np.abs(places.mean(0) - means[k]) < 5 * error + 0.04 * deviations).all()
        allowed = (5 * np.sqrt(2 / samples) + 0.04) * np.outer(deviations, deviations)
        assert (np.abs(np.cov(places.T) - covariances[k]) < allowed).all()


def test_an_object_that_stands_is_expected_where_it_is():
    model = SimpleNamespace(all_modes=(Straight(), Stop()), tau=0.1, process_variance=0.0)

    means, covariances = forecast(ESTIMATE, COVARIANCE, [0.0, 1.0], model, AHEAD)

    np.testing.assert_allclose(means, [np.array(ESTIMATE)[::2]] * 3)
    np.testing.assert_allclose(covariances, [np.array(COVARIANCE)[::2, ::2]] * 3)


def inside(mean, covariance, place):
    """Whether a place is in the ellipse that holds 95 % of a normal distribution."""
    error = place - mean
    return error @ np.linalg.solve(covariance, error) < -2 * np.log(0.05)


@pytest.mark.parametrize(
    ("name", "mode", "kind"),
    list(zip(OBJECTS, "LRLSR", 2 * [WorldOptions, QuickestOptions] + [WorldOptions], strict=True)),
)
def test_ellipses_of_the_stated_mode_hold_as_much_as_they_state(name, mode, kind):
    world = OBJECTS[name]
    tracks, length, seen = 200, 60, 40
    other = replace(world, radius=1.3 * world.radius)
    run = other.simulate(tracks, 9, "S" + mode, (40, length))
    options = world.options(kind)
    start = np.diag([world.measurement_variance, (0.05 * world.speed) ** 2] * 2)
    # Seconds of the readme's object, and ticks of the others.
    ticks = np.array([10, 20] if name == "readme" else [1, 2, 5])
    held = []
    for points, truth in zip(run.measurements, run.truth, strict=True):
        track = TurnTracks(options)
        begin = draw(np.random.default_rng(len(held)), np.array(world.start), start, 1)[0]
        track.begin(begin, start)
        for k, point in enumerate(points[: 40 + seen]):
            if k in (0, 40):
                track.begin_segment(40 if k == 0 else length)
            track.measure(point)
            stated = "SLR".index(mode if k >= 40 else "S")
            if track.asks:
                track.decide(stated + track.announced)
        means, covariances = track.forecast(ticks * world.tau, stated=True)
        places = truth[40 + seen - 1 + ticks, ::2]
        held.append([inside(*each) for each in zip(means, covariances, places, strict=True)])
    low, high = mean_bounds(0.95, 0.95 * 0.05, tracks)
    for share in np.mean(held, axis=0):
        assert low < share < high


@pytest.mark.parametrize(
    ("name", "value"), [("seconds", [-1.0]), ("probabilities", [0.5, 0.5]), ("estimate", [1, 2, 3])]
)
def test_what_cannot_be_forecast_is_refused(name, value):
    arguments = {
        "estimate": ESTIMATE,
        "covariance": COVARIANCE,
        "probabilities": [1, 0, 0, 0, 0],
        "model": MODEL,
        "seconds": AHEAD,
    }
    with pytest.raises(ArgumentError, match=name):
        forecast(**(arguments | {name: value}))
