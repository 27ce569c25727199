"""The palette of the deciders: distinct colours, also with colour blindness, and apart from the
modes.
"""

import itertools

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from agents.evaluation.registry import SHIPPED
from agents.figures.decider_colours import (
    AGENT_STYLES,
    FURTHER_STYLES,
    decider_style,
    decider_styles,
    name_without_seed,
    rule_styles,
)
from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules
from hybrid_env.rendering.evidence import TYPE_COLOURS, mode_colour

RADII = tuple(map(float, range(1, 11)))
STYLES = {
    task: {kind.title: rule_styles()[kind.title] for kind in rules(task).values() if kind.colour}
    | AGENT_STYLES
    for task in (ANNOUNCED, UNKNOWN)
}
"""Styles of the deciders that may share a figure, by task and title."""
PALETTE = sorted({style.colour for styles in STYLES.values() for style in styles.values()})
COLOURS = sorted({*PALETTE, *(style.colour for style in FURTHER_STYLES)})
VISION = {
    "normal": np.eye(3),
    # Machado, Oliveira and Fernandes 2009, severity 1.
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
}


RGB_TO_CONES = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
CONES_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def oklab(colour, vision):
    """Perceptual coordinates (Ottosson 2020) of a colour, in hundredths; 2 is just noticeable."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(
        rgb <= 0.04045,
        rgb / 12.92,
        ((rgb + 0.055) / 1.055) ** 2.4,
    )
    return (
        100.0
        * CONES_TO_LAB
        @ np.cbrt(RGB_TO_CONES @ np.clip(np.array(VISION[vision]) @ linear, 0.0, 1.0))
    )


def difference(one, other, vision="normal"):
    return float(np.linalg.norm(oklab(one, vision) - oklab(other, vision)))


def test_perceptual_difference_of_black_and_white_is_100():
    assert difference("#000000", "#ffffff") == pytest.approx(100.0, abs=0.01)


@pytest.mark.parametrize("task", STYLES)
def test_every_rule_and_common_agent_has_a_style_of_its_own(task):
    titles = {kind.title for kind in rules(task).values()}
    assert titles - set(STYLES[task]) <= {
        "ATE (SPRT), robust",
        "MSPRT, robust",
        "MSPRT, true anchor",
        "TEASER",
    } | {
        "MSPRT, published bank",
        "SPRT",
    }
    styles = STYLES[task].values()
    assert (
        len({style.colour for style in styles})
        == len({style.marker for style in styles})
        == len(styles)
    )
    assert all(decider_style(title) == style for title, style in STYLES[task].items())
    assert {SHIPPED, "ppo", "anchor"} <= set(STYLES[task])


@pytest.mark.parametrize("vision", VISION)
def test_deciders_are_distinguishable(vision):
    for one, other in itertools.combinations(PALETTE, 2):
        assert difference(one, other, vision) > 10.0, (one, other)


@pytest.mark.parametrize("colour", COLOURS)
def test_no_decider_has_the_colour_of_a_mode(colour):
    modes = [mode_colour(mode, RADII) for mode in range(2 * len(RADII) + 1)]
    for mode in (*TYPE_COLOURS, *modes):
        assert difference(colour, mode) > 8.0, mode


@pytest.mark.parametrize("vision", ["protanopia", "deuteranopia"])
def test_no_decider_has_the_colour_of_a_mode_type_with_colour_blindness(vision):
    for colour, mode in itertools.product(PALETTE, TYPE_COLOURS):
        assert difference(colour, mode, vision) > 5.5, (colour, mode)


def test_training_seeds_and_default_run_folders_have_the_style_of_their_recipe():
    for name in (
        "ppo seed 3",
        "ppo-seed3",
        "HybridTrackPublished-v0-ppo-seed0",
        "HybridTrackPublishedBank-v0-ppo-seed12",
    ):
        assert decider_style(name) == AGENT_STYLES["ppo"]
    assert name_without_seed("anchor seed 1") == "anchor"
    assert name_without_seed("seed") == "seed"


@pytest.mark.parametrize("task", STYLES)
def test_styles_of_one_figure_differ(task):
    known = STYLES[task]
    names = [*known, "ppo seed 1", "ppo seed 2", *(f"agent {number}" for number in range(12))]
    styles = decider_styles(names)

    assert list(styles) == names
    assert len(set(styles.values())) == len(names)
    assert all(styles[name] == style for name, style in known.items())
    assert len(decider_styles(f"agent {number}" for number in range(40))) == 40
