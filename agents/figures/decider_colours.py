"""The colour and the marker of each decider, the same in every figure.

The palette contains purples, pinks, yellows, greys, two greens and one dark blue. It stays apart from the
colours of the motion modes (`hybrid_env.rendering.modes`), and its colours stay apart from each other with
red-green colour blindness.
"""

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

SEED_SUFFIX = r"[ -]seed ?\d+$"


@dataclass(frozen=True)
class DeciderStyle:
    """Appearance of a decider in figures.

    Attributes:
        colour: "#rrggbb".
        marker: a Matplotlib marker.
    """

    colour: str
    marker: str


STYLES = {
    "ATE (SPRT)": DeciderStyle("#6900ff", "o"),
    "fixed time": DeciderStyle("#a0a0a0", "s"),
    "MSPRT": DeciderStyle("#c80f82", "D"),
    "MSPRT of types": DeciderStyle("#ff87f0", "d"),
    "MSPRT, kept P": DeciderStyle("#0000b4", ">"),
    "MSPRT, anchor-aware": DeciderStyle("#3c000f", "*"),
    "calibrated anchor": DeciderStyle("#00e196", "p"),
    "calibrated anchor, robust": DeciderStyle("#0f961e", "8"),
    "gap rule": DeciderStyle("#695a00", "P"),
    "ML at the end": DeciderStyle("#2d0069", "X"),
    "Bayes risk": DeciderStyle("#780f3c", "h"),
    "ppo": DeciderStyle("#d2b400", "^"),
    "anchor": DeciderStyle("#b469ff", "<"),
    "shipped": DeciderStyle("#000000", "v"),
}
"""Styles of the classical rules and of the most common agents, by name."""

STATEMENT_STYLES = {
    "IMM threshold": DeciderStyle("#6900ff", "o"),
    "CUSUM": DeciderStyle("#a0a0a0", "s"),
    "Shiryaev-Roberts": DeciderStyle("#ff87f0", "d"),
    "GLR": DeciderStyle("#0000b4", ">"),
    "detector 2020": DeciderStyle("#695a00", "P"),
    "beam": DeciderStyle("#c80f82", "D"),
    "beam, geometric": DeciderStyle("#00e196", "p"),
}
"""Styles of the rules for unknown switch moments, which share no figure with those of `STYLES` but agents."""

_FURTHER_COLOURS = ("#690f96", "#f5a0b4", "#969600", "#4b4b4b")
_FURTHER_MARKERS = (">", "p", "*", "8")
FURTHER_STYLES = tuple(
    DeciderStyle(colour, _FURTHER_MARKERS[(index + shift) % len(_FURTHER_MARKERS)])
    for shift in range(len(_FURTHER_MARKERS))
    for index, colour in enumerate(_FURTHER_COLOURS)
)
"""Styles of all other deciders."""


def name_without_seed(name: str) -> str:
    """Name of a decider without the seed of its training: "ppo seed 1" and "ppo-seed1" become "ppo"."""
    return re.sub(SEED_SUFFIX, "", name)


def decider_style(name: str) -> DeciderStyle:
    """Style of one decider.

    Args:
        name: as in tables. Training seeds of one recipe share a style, and so do default run folders
            ("HybridTrack-v0-ppo-seed0") with their recipe. An unknown name always gets the same style.
    """
    recipe = re.sub(r"^.*-v\d+-", "", name_without_seed(name))
    known = STYLES | STATEMENT_STYLES
    return known.get(recipe) or FURTHER_STYLES[zlib.crc32(recipe.encode()) % len(FURTHER_STYLES)]


def decider_styles(names: Iterable[str]) -> dict[str, DeciderStyle]:
    """Styles of the deciders of one figure.

    Each decider has its style of `decider_style`. Where an earlier name has the same style, the next free one
    of `FURTHER_STYLES` is used instead.
    """
    styles: dict[str, DeciderStyle] = {}
    for name in names:
        style = decider_style(name)
        free = [further for further in FURTHER_STYLES if further not in styles.values()]
        if style in styles.values() and free:
            start = zlib.crc32(name.encode()) % len(FURTHER_STYLES)
            style = next((further for further in FURTHER_STYLES[start:] if further in free), free[0])
        styles[name] = style
    return styles
