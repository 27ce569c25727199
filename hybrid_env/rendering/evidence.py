"""What the evidence panel shows, and the names and colours of modes, without matplotlib."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from hybrid_env.checks import reject
from hybrid_env.modes import Mode, modes_of_radii

# Modes of the options of an environment, or the turn radii of the bank [m].
Modes = Sequence[Mode] | Sequence[float]


def listed(modes: Modes) -> tuple[Mode, ...]:
    """Return the modes, also of turn radii [m]."""
    given = [mode for mode in modes if isinstance(mode, Mode)]
    if given:
        return tuple(given)
    return modes_of_radii(tuple(radius for radius in modes if not isinstance(radius, Mode)))


def mode_name(mode: int, modes: Modes) -> str:
    """Return the name of a mode, an index in the bank, in tables and figures: "S", "L r=5 m" or
    "stop". modes: all modes, or the radii of their turns [m].
    """
    return _mode_at(mode, listed(modes)).label


def mode_colour(mode: int, modes: Modes) -> str:
    """Return the colour "#rrggbb" of a mode: straight red, left blue, right green; of several modes
    of a type the first ones, such as the tighter turns, are darker.
    """
    of_bank = listed(modes)
    chosen = _mode_at(mode, of_bank)
    colour = type_colours(of_bank)[chosen.type]
    same = sorted(
        (other for other in of_bank if other.planar.type == chosen.planar.type),
        key=lambda other: abs(other.signed_radius),
    )
    return colour if len(same) == 1 else shade(colour, same.index(chosen) / (len(same) - 1) - 0.5)


def type_colours(modes: Sequence[Mode]) -> dict[str, str]:
    """Return the colour of each type of modes, whatever the height does."""
    # The papers' red, blue and green in the palette of Okabe and Ito.
    type_colours = {"straight": "#d55e00", "left": "#0072b2", "right": "#009e73"}
    planar = {mode.type: mode.planar.type for mode in modes}
    others = dict.fromkeys(of_type for of_type in planar.values() if of_type not in type_colours)
    colours = itertools.cycle(("#cc79a7", "#e69f00", "#56b4e9", "#000000", "#f0e442"))
    type_colours |= dict(zip(others, colours, strict=False))
    return type_colours | {name: type_colours[of_type] for name, of_type in planar.items()}


def legend_colours(modes: Modes) -> dict[str, str]:
    """Return the colours of a legend by their names: those of the modes, or of their types if there
    are more than nine.
    """
    of_bank = listed(modes)
    if len(of_bank) <= 9:
        return {mode.label: mode_colour(h, of_bank) for h, mode in enumerate(of_bank)}
    colours = type_colours(of_bank)
    several = {"left": "left turns, darker is tighter", "right": "right turns, darker is tighter"}
    return {
        several.get(of_type, of_type): colours[of_type]
        for of_type in dict.fromkeys(mode.type for mode in of_bank)
    }


def shade(colour: str, amount: float) -> str:
    """Mix a colour "#rrggbb" with black (amount -1 .. 0) or with white (amount 0 .. 1)."""
    parts = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    mixed = (c * (1.0 + amount) if amount < 0.0 else c + (1.0 - c) * amount for c in parts)
    return "#" + "".join(f"{round(255 * c):02x}" for c in mixed)


def _mode_at(mode: int, modes: Sequence[Mode]) -> Mode:
    """Return the mode of an index in the bank."""
    if not 0 <= mode < len(modes):
        raise reject("mode", mode, f"an integer from 0 to {len(modes) - 1}")
    return modes[mode]


@dataclass(frozen=True, kw_only=True)
class EvidencePanel:
    """What the evidence panel shows: label, limits and scale of the vertical axis, and below."""

    label: str
    limits: tuple[float, float]
    scale: Literal["linear", "logit"] = "linear"
    # A curve for each hypothesis, for each type of motion, or a single one; hypotheses that
    # share a curve must have the same evidence.
    curves: Literal["hypothesis", "type", "single"] = "hypothesis"
    # Levels of the evidence at which a decision is made, drawn as dashed lines, by their names.
    thresholds: Mapping[str, float] = field(default_factory=dict)
    # Title of the thresholds.
    legend: str = ""
    # Whether true and stated modes are drawn below the curves, for unknown switch moments: there
    # are then no decisions, and the evidence does not begin anew at a switch.
    ribbons: bool = False

    def colours(self, modes: Modes) -> dict[int, str]:
        """Return the colour of each curve by the index of the first hypothesis of the curve."""
        of_bank = listed(modes)
        if self.curves == "single":
            return {0: "#404040"}
        if self.curves == "type":
            colours = type_colours(of_bank)
            types = [mode.type for mode in of_bank]
            return {types.index(of_type): colours[of_type] for of_type in dict.fromkeys(types)}
        return {mode: mode_colour(mode, of_bank) for mode in range(len(of_bank))}


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
    source: str, by_type: bool = False, alpha: float | None = None
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
