"""Names and colours of modes."""

from itertools import pairwise

import numpy as np
import pytest

from hybrid_env.rendering.evidence import TYPE_COLOURS, mode_colour, mode_name

RADII = tuple(float(radius) for radius in range(1, 11))


def brightness(colour):
    return np.sum([int(colour[k : k + 2], 16) for k in (1, 3, 5)])


def test_names_show_the_type_and_the_radius():
    assert [mode_name(mode, (5.0,)) for mode in range(3)] == ["S", "L r=5 m", "R r=5 m"]
    assert [mode_name(mode, (3.0, 4.5)) for mode in (1, 2, 3, 4)] == [
        "L r=3 m", "L r=4.5 m", "R r=3 m", "R r=4.5 m",
    ]  # fmt: skip


def test_every_mode_has_its_own_colour_and_tighter_turns_are_darker():
    assert tuple(mode_colour(mode, (5.0,)) for mode in range(3)) == TYPE_COLOURS
    assert len({mode_colour(mode, RADII) for mode in range(21)}) == 21
    left = [brightness(mode_colour(mode, RADII)) for mode in range(1, 11)]
    assert all(tighter < wider for tighter, wider in pairwise(left))
    assert mode_colour(1, (9.0, 2.0)) == mode_colour(2, (2.0, 9.0))


@pytest.mark.parametrize("mode", [-1, 3])
@pytest.mark.parametrize("function", [mode_name, mode_colour])
def test_a_mode_outside_the_bank_is_an_error(function, mode):
    with pytest.raises(ValueError, match=rf"mode={mode} is not allowed: expected an integer from 0 to 2"):
        function(mode, (5.0,))
