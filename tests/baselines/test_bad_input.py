"""Recordings, lengths and hypotheses that are not allowed raise a one-line error."""

import numpy as np
import pytest
from hostile_input import refused

from baselines import track_ate

POSITIONS = np.cumsum(np.full((10, 2), 0.2), axis=0)
MASKED = np.ma.masked_array(POSITIONS, np.arange(20).reshape(10, 2) == 3)
REFUSED = [
    # Its first sum wraps to 10 in 64 bits.
    {"lengths": [2**63 - 1, 2**63 - 1, 12]},
    {"measurements": MASKED},
    {"start": [1.0] * 3},
    {"undecided": "guess"},
]


@pytest.mark.parametrize("given", REFUSED, ids=str)
def test_an_argument_that_is_not_allowed_is_named(given):
    arguments = {"measurements": POSITIONS, "lengths": [10]} | given
    assert refused(track_ate, **arguments).startswith(next(iter(given)))
