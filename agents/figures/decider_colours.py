"""The colour and the marker of each decider, the same in every figure.

The palette stays apart from the colours of the motion modes (`hybrid_env.rendering.evidence`), and
its colours stay apart from each other with red-green colour blindness.
"""

import re
import zlib
from collections.abc import Iterable


def decider_styles(names: Iterable[str]) -> dict[str, tuple[str, str]]:
    """Styles of the deciders of one figure, "#rrggbb" and a marker of Matplotlib, by their names in
    tables: a name always gets the same style, and the next one of another colour where an earlier
    name of the figure has it.

    Training seeds of one recipe share a style, and so do default run folders
    ("HybridTrack-v0-ppo-seed0") with their recipe.
    """
    colours = ("#000000", "#6900ff", "#d2b400", "#a0a0a0", "#c80f82", "#00e196", "#0000b4")
    every = [(colour, marker) for marker in "os^DXv>p*8" for colour in colours]
    styles: dict[str, tuple[str, str]] = {}
    for name in names:
        recipe = re.sub(r"^.*-v\d+-|[ -]seed ?\d+$", "", name)
        start = zlib.crc32(recipe.encode()) % len(every)
        used = [colour for colour, _ in styles.values()]
        # The first one of those that are used least.
        styles[name] = min(
            every[start:] + every[:start],
            key=lambda style: (used.count(style[0]), style in styles.values()),
        )
    return styles
