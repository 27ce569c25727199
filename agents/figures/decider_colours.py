"""The colour and the marker of each decider, the same in every figure.

The palette contains purples, pinks, yellows, greys, two greens and one dark blue. It stays apart
from the colours of the motion modes (`hybrid_env.rendering.evidence`), and its colours stay apart
from each other with red-green colour blindness.
"""

import functools
import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass

from baselines.rules.decider import ANNOUNCED, UNKNOWN, rules

SEED_SUFFIX = r"[ -]seed ?\d+$"


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

_FURTHER_COLOURS = ("#690f96", "#f5a0b4", "#969600", "#4b4b4b")
_FURTHER_MARKERS = (">", "p", "*", "8")
FURTHER_STYLES = tuple(
    DeciderStyle(colour, _FURTHER_MARKERS[(index + shift) % len(_FURTHER_MARKERS)])
    for shift in range(len(_FURTHER_MARKERS))
    for index, colour in enumerate(_FURTHER_COLOURS)
)
"""Styles of all other deciders."""


@functools.cache
def rule_styles() -> dict[str, DeciderStyle]:
    """Styles of the classical rules by their titles; rules of different tasks may share one."""
    kinds = [kind for task in (ANNOUNCED, UNKNOWN) for kind in rules(task).values() if kind.colour]
    return {kind.title: DeciderStyle(kind.colour, kind.marker) for kind in kinds}


def name_without_seed(name: str) -> str:
    """Name of a decider without the seed of its training: "ppo seed 1" and "ppo-seed1" become
    "ppo".
    """
    return re.sub(SEED_SUFFIX, "", name)


def decider_style(name: str) -> DeciderStyle:
    """Style of one decider by its name in tables.

    Training seeds of one recipe share a style, and so do default run folders
    ("HybridTrack-v0-ppo-seed0") with their recipe. An unknown name always gets the same style.
    """
    recipe = re.sub(r"^.*-v\d+-", "", name_without_seed(name))
    known = AGENT_STYLES | rule_styles()
    return known.get(recipe) or FURTHER_STYLES[zlib.crc32(recipe.encode()) % len(FURTHER_STYLES)]


def decider_styles(names: Iterable[str]) -> dict[str, DeciderStyle]:
    """Styles of the deciders of one figure.

    Each decider has its style of `decider_style`. Where an earlier name has the same style, the
    next free one of `FURTHER_STYLES` is used instead.
    """
    styles: dict[str, DeciderStyle] = {}
    for name in names:
        style = decider_style(name)
        free = [further for further in FURTHER_STYLES if further not in styles.values()]
        if style in styles.values() and free:
            start = zlib.crc32(name.encode()) % len(FURTHER_STYLES)
            style = next(
                (further for further in FURTHER_STYLES[start:] if further in free),
                free[0],
            )
        styles[name] = style
    return styles
