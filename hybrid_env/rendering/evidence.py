"""What the evidence panel shows, and the names and colours of modes, without matplotlib."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from hybrid_env.checks import reject
from hybrid_env.core.banks.bank import mode_type

TYPE_COLOURS = ("#d55e00", "#0072b2", "#009e73")
"""Straight, left and right: the papers' red, blue and green in the palette of Okabe and Ito."""


def mode_name(mode: int, radii: Sequence[float]) -> str:
    """Return the name of a mode, an index in the bank of some radii [m]: "S", "L r=5 m" or "R
    r=5 m".
    """
    kind = _type_of(mode, radii)
    return "S" if kind == 0 else f"{'SLR'[kind]} r={radii[(mode - 1) % len(radii)]:g} m"


def mode_colour(mode: int, radii: Sequence[float]) -> str:
    """Return the colour "#rrggbb" of a mode: straight red, left blue, right green; tighter turns
    are darker.
    """
    kind = _type_of(mode, radii)
    if kind == 0 or len(radii) == 1:
        return TYPE_COLOURS[kind]
    rank = sum(radius < radii[(mode - 1) % len(radii)] for radius in radii)
    return shade(TYPE_COLOURS[kind], rank / (len(radii) - 1) - 0.5)


def legend_colours(radii: Sequence[float]) -> dict[str, str]:
    """Return the colours of a legend by their names: those of the modes, or of their types if there
    are more than nine.
    """
    modes = range(2 * len(radii) + 1)
    if len(modes) > 9:
        names = ("straight", "left turns, darker is tighter", "right turns, darker is tighter")
        return dict(zip(names, TYPE_COLOURS, strict=True))
    return {mode_name(mode, radii): mode_colour(mode, radii) for mode in modes}


def shade(colour: str, amount: float) -> str:
    """Mix a colour "#rrggbb" with black (amount -1 .. 0) or with white (amount 0 .. 1)."""
    parts = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    mixed = (c * (1.0 + amount) if amount < 0.0 else c + (1.0 - c) * amount for c in parts)
    return "#" + "".join(f"{round(255 * c):02x}" for c in mixed)


def _type_of(mode: int, radii: Sequence[float]) -> int:
    if not 0 <= mode <= 2 * len(radii):
        raise reject("mode", mode, f"an integer from 0 to {2 * len(radii)}")
    return mode_type(mode, len(radii))


@dataclass(frozen=True, kw_only=True)
class EvidencePanel:
    """What the evidence panel shows: label, limits and scale of the vertical axis, and below."""

    label: str
    limits: tuple[float, float]
    scale: Literal["linear", "logit"] = "linear"
    # Of each hypothesis, of straight motion, left and right turns, or a single one; those that
    # share a curve must have the same evidence.
    curves: Literal["hypothesis", "type", "single"] = "hypothesis"
    # Levels of the evidence at which a decision is made, drawn as dashed lines, by their names.
    thresholds: Mapping[str, float] = field(default_factory=dict)
    # Of the thresholds.
    legend: str = ""
    # Whether true and stated modes are drawn below the curves, for unknown switch moments: there
    # are then no decisions, and the evidence does not begin anew at a switch.
    ribbons: bool = False

    def colours(self, radii: Sequence[float]) -> dict[int, str]:
        """Return the colour of each curve by the index of the first hypothesis of the curve."""
        if self.curves == "single":
            return {0: "#404040"}
        if self.curves == "type":
            return dict(zip((0, 1, len(radii) + 1), TYPE_COLOURS, strict=True))
        return {mode: mode_colour(mode, radii) for mode in range(2 * len(radii) + 1)}


def ratio_limits(threshold: float) -> tuple[float, float]:
    """Return symmetric limits for an axis of log-likelihood ratios that contain a threshold."""
    limit = max(15.0, 1.15 * threshold)
    return -limit, limit


def sprt_panel(alpha: float = 0.001) -> EvidencePanel:
    """Return the panel of log-likelihood ratios to the active mode, with the thresholds of the
    SPRT at an alpha.
    """
    upper = math.log((1.0 - alpha) / alpha)
    return EvidencePanel(
        label="log-likelihood ratio to the active mode",
        limits=ratio_limits(upper),
        thresholds={"A": upper, "B": -upper},
        legend=f"A, B at alpha = {alpha:g}",
    )


def posterior_panel(
    source: str,
    by_type: bool = False,
    alpha: float | None = None,
) -> EvidencePanel:
    """Return the panel of posterior probabilities with the threshold 1 - alpha on the posterior of
    a declaration; None draws none.
    """
    limit = 0.999 if alpha is None else max(0.999, 1.0 - 0.3 * alpha)
    return EvidencePanel(
        label=f"posterior probability ({source})",
        limits=(1.0 - limit, limit),
        scale="logit",
        curves="type" if by_type else "hypothesis",
        thresholds={} if alpha is None else {"": 1.0 - alpha},
        legend="" if alpha is None else f"1 - alpha at alpha = {alpha:g}",
    )


def probability_panel(source: str = "", threshold: float = 0.0) -> EvidencePanel:
    """Return the panel of the probabilities of the modes, for unknown switch moments. threshold:
    smallest probability of a mode to which the statement changes; 0 draws none.
    """
    return EvidencePanel(
        label=f"probability ({source})" if source else "probability",
        limits=(-0.36, 1.05),
        thresholds={"": threshold} if threshold > 0.0 else {},
        legend=f"threshold {threshold:g}" if threshold > 0.0 else "",
        ribbons=True,
    )
