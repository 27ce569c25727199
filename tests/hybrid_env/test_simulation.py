"""Simulated recordings have the specified motion and noise, and do not depend on the number of runs."""

import math

import numpy as np
import pytest
from hostile_input import refused

from hybrid_env.simulation import simulate


def test_a_run_does_not_depend_on_the_number_of_runs():
    many, few = simulate("S5 L5r2", runs=20, seed=3), simulate("S5 L5r2", runs=4, seed=3)
    np.testing.assert_array_equal(many.truth[:4], few.truth)
    np.testing.assert_array_equal(many.measurements[:4], few.measurements)
    assert (many.truth[0] != many.truth[1]).any()


def test_without_process_noise_the_object_follows_its_scheme_exactly():
    run = simulate("S50 L100r5 R100r5", start=(1.0, 1.5, 2.0, 0.0), process_variance=0.0)
    np.testing.assert_allclose(run.truth[0, 49], [1.0 + 7.5, 1.5, 2.0, 0.0], atol=1e-12)
    heading = np.unwrap(np.arctan2(run.truth[0, :, 3], run.truth[0, :, 1]))
    np.testing.assert_allclose(heading[[149, 249]], [3.0, 0.0], atol=1e-10)


def test_noise_has_the_given_variances():
    run = simulate("S2000", runs=5, seed=1, process_variance=0.01, measurement_variance=(0.2, 0.5))
    steps = np.diff(run.truth[:, :, [1, 3]], axis=1)
    assert steps.var() == pytest.approx(0.01, rel=4 * math.sqrt(2 / steps.size))
    errors = run.measurements - run.truth[:, :, [0, 2]]
    np.testing.assert_allclose(errors.var((0, 1)), [0.2, 0.5], rtol=4 * math.sqrt(2 / 10_000))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scheme": "random"}, "scheme='random'"),
        ({"scheme": ""}, "scheme=''"),
        ({"runs": 0}, "runs=0"),
        ({"seed": -1}, "seed=-1"),
        ({"start": (0, 0)}, "start has shape (2,)"),
        ({"tau": 0}, "tau=0"),
        ({"process_variance": -1}, "process_variance=-1"),
        ({"measurement_variance": 0}, "measurement_variance=0"),
    ],
)
def test_an_invalid_argument_raises_a_one_line_error_with_its_name(arguments, message):
    assert message in refused(simulate, **({"scheme": "S5"} | arguments))
