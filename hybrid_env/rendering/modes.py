"""Names and colours of modes."""

from collections.abc import Sequence

from hybrid_env.checks import reject
from hybrid_env.core.banks.bank import mode_type

TYPE_COLOURS = ("#d55e00", "#0072b2", "#009e73")
"""Straight, left and right: the papers' red, blue and green in the palette of Okabe and Ito."""


def mode_name(mode: int, radii: Sequence[float]) -> str:
    """Return the name of a mode: "S", "L r=5 m" or "R r=5 m".

    Args:
        mode: index of the hypothesis in the bank, 0 .. 2 n.
        radii: (n,) turn radii of the bank [m].

    Raises:
        ArgumentError: the mode is not in the bank.
    """
    kind = _type_of(mode, radii)
    return "S" if kind == 0 else f"{'SLR'[kind]} r={radii[(mode - 1) % len(radii)]:g} m"


def mode_colour(mode: int, radii: Sequence[float]) -> str:
    """Return the colour "#rrggbb" of a mode: straight red, left blue, right green; tighter turns are darker.

    Args:
        mode: index of the hypothesis in the bank, 0 .. 2 n.
        radii: (n,) turn radii of the bank [m].

    Raises:
        ArgumentError: the mode is not in the bank.
    """
    kind = _type_of(mode, radii)
    if kind == 0 or len(radii) == 1:
        return TYPE_COLOURS[kind]
    rank = sum(radius < radii[(mode - 1) % len(radii)] for radius in radii)
    return shade(TYPE_COLOURS[kind], rank / (len(radii) - 1) - 0.5)


def shade(colour: str, amount: float) -> str:
    """Mix a colour "#rrggbb" with black (amount -1 .. 0) or with white (amount 0 .. 1)."""
    parts = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    mixed = (c * (1.0 + amount) if amount < 0.0 else c + (1.0 - c) * amount for c in parts)
    return "#" + "".join(f"{round(255 * c):02x}" for c in mixed)


def _type_of(mode: int, radii: Sequence[float]) -> int:
    if not 0 <= mode <= 2 * len(radii):
        raise reject("mode", mode, f"an integer from 0 to {2 * len(radii)}")
    kind: int = mode_type(mode, len(radii))
    return kind
