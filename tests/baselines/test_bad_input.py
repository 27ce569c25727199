"""Recordings, lengths and hypotheses that are not allowed raise a one-line error."""

import datetime

import numpy as np
import pytest
from hostile_input import refused

from baselines import track_ate
from baselines.papers.golubkov2018 import filter_known_modes
from baselines.papers.golubkov2020 import detect_switch

POSITIONS = np.cumsum(np.full((10, 2), 0.2), axis=0)
LARGEST = 2**63 - 1
RAGGED = [[0.0, 1.0], [2.0]]

BAD_LENGTHS = [
    [LARGEST, LARGEST, 12],  # a sum that wraps to 10 in 64 bits
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
]


@pytest.mark.parametrize("lengths", BAD_LENGTHS, ids=str)
def test_lengths(lengths):
    assert refused(track_ate, POSITIONS, lengths).startswith("lengths")
    assert refused(filter_known_modes, POSITIONS, lengths, [0.0] * 3).startswith("lengths")


BAD_POSITIONS = [
    np.zeros((0, 2)), np.zeros((10, 3)), np.zeros(10), np.full((10, 2), np.nan),
    np.ma.masked_array(POSITIONS, np.arange(20).reshape(10, 2) == 3), [[1, 10**400]] * 10, [["a", "b"]] * 10,
    [[True, False]] * 10, [[datetime.timedelta(1)] * 2] * 10, np.full((10, 2), np.timedelta64(1, "s")),
    np.ones((10, 2), complex), RAGGED, "text", None, Ellipsis,
]  # fmt: skip


@pytest.mark.parametrize("positions", BAD_POSITIONS, ids=str)
def test_measurements(positions):
    for call in (
        lambda: track_ate(positions, [10]),
        lambda: filter_known_modes(positions, [10], [0.0]),
        lambda: detect_switch(positions),
    ):
        assert refused(call).startswith("measurements")


@pytest.mark.parametrize("tested", [0, 3, "1", [1, "2"], RAGGED, [[1]], np.array([[1]]), 1.0, {1: 2}, []], ids=str)
def test_tested_hypotheses(tested):
    assert refused(detect_switch, POSITIONS, tested=tested).startswith("tested")


@pytest.mark.parametrize("start", [RAGGED, [1.0] * 3, "1234", [0.0, np.nan, 0.0, 0.0], np.zeros((2, 4))], ids=str)
def test_start(start):
    assert refused(track_ate, POSITIONS, [10], start).startswith("start")
