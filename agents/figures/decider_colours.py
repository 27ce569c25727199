"""The colour and the marker of each decider, the same in every figure.

The palette contains purples, pinks, yellows, greys, two greens and one dark blue. It stays apart
from the colours of the motion modes (`hybrid_env.rendering.evidence`), and its colours stay apart
from each other with red-green colour blindness.
"""

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class DeciderStyle:
    """Appearance of a decider in figures."""

    # "#rrggbb"
    colour: str
    # A Matplotlib marker.
    marker: str


AGENT_STYLES = {
    "ppo": DeciderStyle("#d2b400", "^"),
    "anchor": DeciderStyle("#b469ff", "<"),
    "shipped": DeciderStyle("#000000", "v"),
}
"""Styles of the most common agents, by name."""

FURTHER_STYLES = tuple(
    DeciderStyle(colour, marker)
    for markers in (">p*8", "p*8>", "*8>p", "8>p*")
    for colour, marker in zip(("#690f96", "#f5a0b4", "#969600", "#4b4b4b"), markers, strict=True)
)
"""Styles of all other deciders."""


RULE_STYLES = {
    "fixed time": DeciderStyle("#a0a0a0", "s"),
    "ML at the end": DeciderStyle("#2d0069", "X"),
    "MSPRT": DeciderStyle("#c80f82", "D"),
    "MSPRT of types": DeciderStyle("#ff87f0", "d"),
    "MSPRT, anchor-aware": DeciderStyle("#3c000f", "*"),
    "gap rule": DeciderStyle("#695a00", "P"),
    "MSPRT, kept P": DeciderStyle("#0000b4", ">"),
    "calibrated anchor": DeciderStyle("#00e196", "p"),
    "calibrated anchor, robust": DeciderStyle("#0f961e", "8"),
    "ATE (SPRT)": DeciderStyle("#6900ff", "o"),
    "beam, adaptive": DeciderStyle("#0f961e", "8"),
    "beam": DeciderStyle("#c80f82", "D"),
    "beam, geometric": DeciderStyle("#00e196", "p"),
    "beam, default law": DeciderStyle("#3c000f", "*"),
    "CUSUM": DeciderStyle("#a0a0a0", "s"),
    "Shiryaev-Roberts": DeciderStyle("#ff87f0", "d"),
    "GLR": DeciderStyle("#0000b4", ">"),
    "detector 2020": DeciderStyle("#695a00", "P"),
    "IMM threshold": DeciderStyle("#6900ff", "o"),
}
"""Styles of the classical rules by their titles; rules of different tasks may share one."""


def name_without_seed(name: str) -> str:
    """Name of a decider without the seed of its training: "ppo seed 1" and "ppo-seed1" become
    "ppo".
    """
    return re.sub(r"[ -]seed ?\d+$", "", name)


def decider_style(name: str) -> DeciderStyle:
    """Style of one decider by its name in tables.

    Training seeds of one recipe share a style, and so do default run folders
    ("HybridTrack-v0-ppo-seed0") with their recipe. An unknown name always gets the same style.
    """
    recipe = re.sub(r"^.*-v\d+-", "", name_without_seed(name))
    known = AGENT_STYLES | RULE_STYLES
    return known.get(recipe) or FURTHER_STYLES[zlib.crc32(recipe.encode()) % len(FURTHER_STYLES)]


def decider_styles(names: Iterable[str]) -> dict[str, DeciderStyle]:
    """Styles of the deciders of one figure.

    Each decider has its style of `decider_style`. Where an earlier name has the same style, the
    next free one of `FURTHER_STYLES` is used instead.
    """
    styles: dict[str, DeciderStyle] = {}
    for name in names:
        style = decider_style(name)
        start = zlib.crc32(name.encode()) % len(FURTHER_STYLES)
        choice = (style, *FURTHER_STYLES[start:], *FURTHER_STYLES)
        styles[name] = next((other for other in choice if other not in styles.values()), style)
    return styles
