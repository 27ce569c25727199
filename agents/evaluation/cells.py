"""Estimates with their intervals as cells of tables and words of lines."""

import numpy as np

from agents.evaluation.operating_curve import Estimate


def estimate_cell(estimate: Estimate, scale: float, digits: int, undefined: str, sign: str = "") -> str:
    """Return the value of an estimate, and below it the half width of its confidence interval.

    Args:
        estimate: of a figure.
        scale: factor on the figure.
        digits: after the decimal point.
        undefined: text for an infinite value.
        sign: "+" shows the sign of the value.
    """
    if not np.isfinite(estimate.value):
        return undefined
    value = f"{scale * estimate.value:{sign}.{digits}f}"
    if not np.isfinite(estimate.high):
        return f"{value}\n[bright_black]> {scale * estimate.low:.{digits}f}[/]"
    return f"{value}\n[bright_black]±{scale * (estimate.high - estimate.low) / 2:.{digits}f}[/]"


def signed(estimate: Estimate, digits: int) -> str:
    """Return the value of a difference with its confidence interval, all with their signs."""
    return f"{estimate.value:+.{digits}f} [{estimate.low:+.{digits}f}, {estimate.high:+.{digits}f}]"


def interval(estimate: Estimate, digits: int, undefined: str) -> str:
    """Return the value of an estimate, and below it the bounds of its confidence interval."""
    if not np.isfinite(estimate.value):
        return undefined
    low, high = estimate.low, estimate.high
    return f"{estimate.value:.{digits}f}\n[bright_black]{low:.{digits}f} to {high:.{digits}f}[/]"
