import dataclasses
from pathlib import Path

import numpy as np
import pytest

from agents import load_recipe
from agents.training.runs import make_run
from hybrid_env import QuickestOptions
from studies.simulators.training import inexact_paths

CARS = "straight 20 + geometric 40, turns 5 + geometric 10"
OPTIONS = QuickestOptions(ticks=300, radii=(3.0,), durations=CARS)


@pytest.mark.parametrize(
    ("law", "slowest", "fastest"), [("25 + geometric 50", 0.84, 1.16), (CARS, 0.0, 1.31)]
)
def test_aircraft_keep_their_speed_and_cars_brake(law, slowest, fastest):
    options = dataclasses.replace(OPTIONS, durations=law)
    modes = np.random.default_rng(1).integers(0, 3, (6, 200)).repeat(50, 0)
    positions, _ = inexact_paths(options, modes, np.random.default_rng(2))
    speeds = np.hypot(*np.diff(positions, axis=0).T).T / 0.2

    assert slowest <= speeds.min() + 1e-9
    assert speeds.max() < fastest
    turning, straight = speeds[modes[1:] > 0].mean(), speeds[modes[1:] == 0].mean()
    assert (turning < 0.85 * straight) == (law == CARS)
    assert (speeds.min() < 1e-9) == (law == CARS)


def test_paths_do_not_depend_on_units():
    length, speed = 1000.0, 1000.0 / 7.0
    other = dataclasses.replace(
        OPTIONS,
        tau=OPTIONS.tau * length / speed,
        speed=OPTIONS.speed * speed,
        radii=(3.0 * length,),
    )
    modes = np.random.default_rng(1).integers(0, 3, (6, 20)).repeat(50, 0)
    positions, scaled = (
        inexact_paths(options, modes, np.random.default_rng(2))[0] for options in (OPTIONS, other)
    )

    np.testing.assert_allclose(scaled, length * positions, rtol=1e-9, atol=1e-6)


def test_rows_of_objects_that_move_otherwise_than_told_are_finite():
    recipe = load_recipe(
        str(Path(__file__).with_name("robust.yml")),
        "HybridTrackQuickest-v0",
        ("worlds=1", "heavy_tails=1", "n_envs=2", "batch_size=4", "ticks=20"),
    )
    run = make_run("HybridTrackQuickest-v0", {}, recipe, 0, steps=80)
    [batch] = run.batches()

    assert batch.inputs.shape == (20, 4, 2, 26)
    assert np.isfinite(batch.inputs.numpy()).all()
