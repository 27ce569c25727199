"""Names and colours of modes."""

from collections.abc import Sequence

from matplotlib.colors import to_hex

from hybrid_env.checks import reject
from hybrid_env.core.published_bank import mode_type

TYPE_COLOURS = ("#d55e00", "#0072b2", "#009e73")
"""Straight, left, right: the papers' red, blue and green from the palette of Okabe and Ito."""


def mode_name(mode: int, radii: Sequence[float]) -> str:
    """Name of a hypothesis: "S", "L r=5 m" or "R r=5 m".

    Args:
        mode: index into the bank, 0 .. 2 n.
        radii: (n,) turn radii of the bank [m].

    Raises:
        ValueError: the bank has no such mode.
    """
    kind = _type_of(mode, radii)
    return "S" if kind == 0 else f"{'SLR'[kind]} r={radii[(mode - 1) % len(radii)]:g} m"


def mode_colour(mode: int, radii: Sequence[float]) -> str:
    """Colour "#rrggbb" of a hypothesis: red straight, blue left, green right, darker for a tighter turn.

    Args:
        mode: index into the bank, 0 .. 2 n.
        radii: (n,) turn radii of the bank [m].

    Raises:
        ValueError: the bank has no such mode.
    """
    kind = _type_of(mode, radii)
    if kind == 0 or len(radii) == 1:
        return TYPE_COLOURS[kind]
    rank = sum(radius < radii[(mode - 1) % len(radii)] for radius in radii)
    return shade(TYPE_COLOURS[kind], rank / (len(radii) - 1) - 0.5)


def shade(colour: str, amount: float) -> str:
    """A colour "#rrggbb" mixed with black (amount -1 .. 0) or with white (0 .. 1)."""
    red, green, blue = (
        c * (1.0 + amount) if amount < 0.0 else c + (1.0 - c) * amount
        for c in (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    )
    return to_hex((red, green, blue))


def _type_of(mode: int, radii: Sequence[float]) -> int:
    if not 0 <= mode <= 2 * len(radii):
        raise reject("mode", mode, f"an integer from 0 to {2 * len(radii)}")
    kind: int = mode_type(mode, len(radii))
    return kind
