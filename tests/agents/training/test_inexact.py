import dataclasses

import numpy as np
import pytest

from agents.training.inexact import inexact_paths, inexact_travel
from baselines import GivenTracks
from hybrid_env.quickest_options import QuickestOptions

CARS = "straight 20 + geometric 40, turns 5 + geometric 10"
OPTIONS = QuickestOptions(ticks=300, radii=(3.0,), durations=CARS)


def test_without_spread_the_motion_is_that_told():
    modes = np.repeat([0, 1, 2, 0], 20)[:, None] * np.ones(5, np.int64)
    positions, first = inexact_paths(OPTIONS, modes, np.random.default_rng(0), 0.0)
    moved = np.diff(
        positions,
        axis=0,
        prepend=np.zeros((1, 5, 2)),
    )

    assert np.hypot(*moved.T) == pytest.approx(0.2)
    assert np.hypot(first[:, 1], first[:, 3]) == pytest.approx(2.0)
    headings = np.unwrap(
        np.arctan2(moved[..., 1], moved[..., 0]),
        axis=0,
    )
    turned = np.diff(headings, axis=0)
    expected = np.array([0.0, 1.0, -1.0])[modes] * 0.2 / 3.0
    # The middle of a tick is its chord.
    assert turned == pytest.approx(0.5 * (expected[1:] + expected[:-1]), abs=1e-9)


def test_aircraft_keep_their_speed_and_cars_brake():
    paths = {}
    for law in ("25 + geometric 50", CARS):
        options = dataclasses.replace(OPTIONS, durations=law)
        modes = (
            np.random.default_rng(1)
            .integers(0, 3, (6, 200))
            .repeat(
                50,
                0,
            )
        )
        positions, _ = inexact_paths(options, modes, np.random.default_rng(2))
        paths[law] = np.hypot(*np.diff(positions, axis=0).T).T / 0.2, modes[1:]
    speeds, _ = paths["25 + geometric 50"]

    assert speeds.min() > 0.84
    assert speeds.max() < 1.16
    speeds, modes = paths[CARS]
    assert speeds.min() == pytest.approx(0.0, abs=1e-9)
    assert speeds.max() < 1.31
    assert speeds[modes > 0].mean() < 0.85 * speeds[modes == 0].mean()


def test_rows_do_not_depend_on_units():
    metres = 1000.0
    seconds = 7.0
    speed = metres / seconds
    other = dataclasses.replace(
        OPTIONS,
        tau=OPTIONS.tau * seconds,
        speed=OPTIONS.speed * speed,
        radii=(3.0 * metres,),
        process_variance=OPTIONS.process_variance * speed**2,
        measurement_variance=0.1 * metres**2,
        initial_error=(OPTIONS.initial_error[0], OPTIONS.initial_error[1] * speed**2),
    )
    rows = []
    for options in (OPTIONS, other):
        env = GivenTracks(inexact_travel, options, 20, likeliest=True)
        env.reset(seed=5)
        rows.append(np.array([env.step(np.zeros(20, np.int64))[0] for _ in range(200)]))
    scale = np.ones(rows[0].shape[-1])
    scale[env.options.layout_class(3).slices["speed"]] = speed

    assert rows[0] * scale == pytest.approx(rows[1], rel=2e-3, abs=2e-3)
