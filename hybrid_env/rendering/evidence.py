"""What the evidence panel shows, and the names and colours of modes, without matplotlib."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from hybrid_env.checks import FloatArray, reject
from hybrid_env.core.banks.bank import mode_type

TYPE_COLOURS = ("#d55e00", "#0072b2", "#009e73")
"""Straight, left and right: the papers' red, blue and green in the palette of Okabe and Ito."""

DEFAULT_ALPHA = 0.001
SINGLE_COLOUR = "#404040"
# Limit of the axis, unless a threshold needs more.
RATIO_LIMIT = 15.0
# Lower limit of the axis of posterior probabilities, unless a threshold needs more.
POSTERIOR_LIMIT = 0.001
# Limit of an axis, relative to the threshold.
AXIS_MARGIN = 1.15


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


@dataclass(frozen=True)
class Threshold:
    """A level of the evidence at which a decision is made, (T,) by ticks since the switch; the
    last one holds on.
    """

    levels: FloatArray
    name: str = ""


@dataclass(frozen=True, kw_only=True)
class EvidencePanel:
    """What the evidence panel shows: label, limits and scale of the vertical axis, and below."""

    label: str
    limits: tuple[float, float]
    scale: Literal["linear", "logit"] = "linear"
    # Of each hypothesis, of straight motion, left and right turns, or a single one; those that
    # share a curve must have the same evidence.
    curves: Literal["hypothesis", "type", "single"] = "hypothesis"
    # Drawn as dashed lines.
    thresholds: tuple[Threshold, ...] = ()
    # Of the thresholds.
    legend: str = ""
    # Whether true and stated modes are drawn below the curves, for unknown switch moments: there
    # are then no decisions, and the evidence does not begin anew at a switch.
    ribbons: bool = False

    def colours(self, radii: Sequence[float]) -> dict[int, str]:
        """Return the colour of each curve by the index of the first hypothesis of the curve."""
        if self.curves == "single":
            return {0: SINGLE_COLOUR}
        if self.curves == "type":
            return dict(zip((0, 1, len(radii) + 1), TYPE_COLOURS, strict=True))
        return {mode: mode_colour(mode, radii) for mode in range(2 * len(radii) + 1)}


def ratio_limits(threshold: float) -> tuple[float, float]:
    """Return symmetric limits for an axis of log-likelihood ratios that contain a threshold."""
    limit = max(RATIO_LIMIT, AXIS_MARGIN * threshold)
    return -limit, limit


def sprt_panel(alpha: float) -> EvidencePanel:
    """Return the panel of log-likelihood ratios to the active mode, with the thresholds of the
    SPRT at an alpha.
    """
    upper = math.log((1.0 - alpha) / alpha)
    return EvidencePanel(
        label="log-likelihood ratio to the active mode",
        limits=ratio_limits(upper),
        thresholds=(Threshold(np.array([upper]), "A"), Threshold(np.array([-upper]), "B")),
        legend=f"A, B at alpha = {alpha:g}",
    )


def posterior_panel(
    source: str,
    by_type: bool = False,
    alpha: FloatArray | None = None,
) -> EvidencePanel:
    """Return the panel of posterior probabilities with the threshold 1 - alpha. alpha: (T,)
    threshold on the posterior error probability at each tick; None draws none.
    """
    limit = 1.0 - POSTERIOR_LIMIT
    thresholds: tuple[Threshold, ...] = ()
    legend = ""
    if alpha is not None:
        thresholds = (Threshold(1.0 - alpha),)
        legend = f"1 - alpha at alpha = {alpha[0]:g}" if len(alpha) == 1 else "stopping boundary"
        odds = ((1.0 - alpha.max()) / alpha.max()) ** AXIS_MARGIN
        limit = max(limit, odds / (1.0 + odds))
    return EvidencePanel(
        label=f"posterior probability ({source})",
        limits=(1.0 - limit, limit),
        scale="logit",
        curves="type" if by_type else "hypothesis",
        thresholds=thresholds,
        legend=legend,
    )


def probability_panel(source: str = "", threshold: float = 0.0) -> EvidencePanel:
    """Return the panel of the probabilities of the modes, for unknown switch moments. threshold:
    smallest probability of a mode to which the statement changes; 0 draws none.
    """
    return EvidencePanel(
        label=f"probability ({source})" if source else "probability",
        limits=(-0.36, 1.05),
        thresholds=(Threshold(np.array([threshold])),) if threshold > 0.0 else (),
        legend=f"threshold {threshold:g}" if threshold > 0.0 else "",
        ribbons=True,
    )
