"""Simulated recordings do not depend on the number of runs."""

import numpy as np

from hybrid_env.simulation import simulate


def test_a_run_does_not_depend_on_the_number_of_runs():
    many = simulate("S5 L5r2", runs=20, seed=3)
    few = simulate("S5 L5r2", runs=4, seed=3)

    np.testing.assert_array_equal(many.truth[:4], few.truth)
    np.testing.assert_array_equal(many.measurements[:4], few.measurements)
    assert (many.truth[0] != many.truth[1]).any()
