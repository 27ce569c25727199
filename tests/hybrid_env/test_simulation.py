"""Simulated recordings do not depend on the number of runs."""

import numpy as np
import pytest
from hostile_input import refused

from hybrid_env.simulation import simulate


def test_a_run_does_not_depend_on_the_number_of_runs():
    many = simulate("S5 L5r2", runs=20, seed=3)
    few = simulate("S5 L5r2", runs=4, seed=3)

    np.testing.assert_array_equal(many.truth[:4], few.truth)
    np.testing.assert_array_equal(many.measurements[:4], few.measurements)
    assert (many.truth[0] != many.truth[1]).any()


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
