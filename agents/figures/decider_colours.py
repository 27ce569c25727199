"""The colour and the marker of each decider, the same in every figure.

The palette stays apart from the colours of the motion modes (`hybrid_env.rendering.evidence`), and
its colours stay apart from each other with red-green colour blindness.
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


STYLES = tuple(
    DeciderStyle(colour, marker)
    for marker in "os^DXv>p*8"
    for colour in ("#000000", "#6900ff", "#d2b400", "#a0a0a0", "#c80f82", "#00e196", "#0000b4")
)


def decider_styles(names: Iterable[str]) -> dict[str, DeciderStyle]:
    """Styles of the deciders of one figure by their names in tables: a name always gets the same
    style, and the next one of another colour where an earlier name of the figure has it.

    Training seeds of one recipe share a style, and so do default run folders
    ("HybridTrack-v0-ppo-seed0") with their recipe.
    """
    styles: dict[str, DeciderStyle] = {}
    for name in names:
        recipe = re.sub(r"^.*-v\d+-|[ -]seed ?\d+$", "", name)
        start = zlib.crc32(recipe.encode()) % len(STYLES)
        colours = [style.colour for style in styles.values()]
        # The first one of those that are used least.
        styles[name] = min(
            (*STYLES[start:], *STYLES[:start]),
            key=lambda style: (colours.count(style.colour), style in styles.values()),
        )
    return styles
