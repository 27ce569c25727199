"""Recordings, lengths and hypotheses that are not allowed raise a one-line error."""

import datetime

import numpy as np
import pytest
from hostile_input import refused

from baselines import track_ate

POSITIONS = np.cumsum(np.full((10, 2), 0.2), axis=0)
LARGEST = 2**63 - 1
RAGGED = [[0.0, 1.0], [2.0]]

BAD_LENGTHS = [
    [LARGEST, LARGEST, 12],
    [2**64 + 10],
    [10**400],
    [5, 0, 5],
    [-5, 15],
    [5.0, 5.0],
    [True] * 10,
    [[5], [5]],
    [5, [5]],
    10,
    "10",
    None,
    np.array(10),
    np.ma.masked_array([5, 5], [False, True]),
    datetime.timedelta(seconds=10),
    [2, 3],
    [],
]
"""The first sum wraps to 10 in 64 bits."""


@pytest.mark.parametrize("lengths", BAD_LENGTHS, ids=str)
def test_lengths(lengths):
    assert refused(track_ate, POSITIONS, lengths).startswith("lengths")


BAD_POSITIONS = [
    np.zeros((0, 2)),
    np.zeros((10, 3)),
    np.zeros(10),
    np.full((10, 2), np.nan),
    [["a", "b"]] * 10,
    [[True, False]] * 10,
    np.ma.masked_array(
        POSITIONS,
        np.arange(20).reshape(10, 2) == 3,
    ),
    [[1, 10**400]] * 10,
    np.ones((10, 2), complex),
    [[datetime.timedelta(1)] * 2] * 10,
    np.full((10, 2), np.timedelta64(1, "s")),
    RAGGED,
    "text",
    None,
    Ellipsis,
]


@pytest.mark.parametrize("positions", BAD_POSITIONS, ids=str)
def test_measurements(positions):
    assert refused(track_ate, positions, [10]).startswith("measurements")


@pytest.mark.parametrize(
    "start",
    [RAGGED, [1.0] * 3, [0.0, 1.0], "1234", [0.0, np.nan, 0.0, 0.0], np.zeros((2, 4))],
    ids=str,
)
def test_start(start):
    assert refused(track_ate, POSITIONS, [10], start).startswith("start")


OTHERS = [
    ({"radii": [0.0]}, "radii=[0.0]"),
    ({"tau": 0.0}, "tau=0.0"),
    ({"process_variance": -1.0}, "process_variance=-1.0"),
    ({"measurement_variance": -1.0}, "measurement_variance=-1.0"),
    ({"alpha": 0.0}, "alpha=0.0"),
    ({"alpha": 0.6, "beta": 0.4}, "alpha + beta=1.0"),
    ({"beta": float("nan")}, "beta=nan"),
    ({"undecided": "guess"}, "undecided='guess'"),
    ({"recalculation": "twice"}, "recalculation='twice'"),
    ({"reference": "left"}, "reference='left'"),
    ({"refine_radius": "yes"}, "refine_radius='yes'"),
]


@pytest.mark.parametrize(("arguments", "message"), OTHERS)
def test_other_arguments(arguments, message):
    assert message in refused(track_ate, POSITIONS, [10], **arguments)
