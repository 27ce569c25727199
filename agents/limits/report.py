"""Markdown tables of the attainable decision times."""

from collections.abc import Sequence

import numpy as np

from agents.evaluation.operating_curve import Estimate
from agents.limits.study import (
    BANKS,
    CALIBRATION_TICKS,
    NOISE_LEVELS,
    BankCalibration,
    RuleResult,
    TypeAccuracy,
)


def _cell(estimate: Estimate, digits: int) -> str:
    if not np.isfinite(estimate.value):
        return "not reached"
    return f"{estimate.value:.{digits}f} [{estimate.low:.{digits}f}, {estimate.high:.{digits}f}]"


def rules_markdown(found: Sequence[RuleResult]) -> str:
    """Decision times and rewards, one row per bank and rule, one column per noise level."""
    lines = []
    for env_id in dict.fromkeys(one.env_id for one in found):
        results = [one for one in found if one.env_id == env_id]
        lines += [f"### {env_id.rpartition(':')[2]}", ""]
        lines += [
            "Mean decision time in ticks at 95 % / at 98 % accuracy; mean reward per segment at the best "
            "threshold.", "",
        ]  # fmt: skip
        lines += ["| bank | rule | " + " | ".join(f"R = {noise:g}" for noise in NOISE_LEVELS) + " |"]
        lines += ["|---|---|" + "---|" * len(NOISE_LEVELS)]
        for bank in BANKS:
            for rule in dict.fromkeys(one.rule for one in results):
                cells = []
                for noise in NOISE_LEVELS:
                    for one in results:
                        if (one.bank, one.rule, one.noise) == (bank, rule, noise):
                            times = f"{_cell(one.time_95, 1)} / {_cell(one.time_98, 1)}"
                            cells.append(f"{times}; {_cell(one.reward, 3)}")
                lines.append(f"| {bank.replace('_', '-')} | {rule} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def calibration_markdown(found: Sequence[BankCalibration]) -> str:
    """Accuracy and mean posterior by bank, noise level and tick."""
    heads = [f"after {tick} ticks" for tick in CALIBRATION_TICKS]
    lines = [
        "### Calibration of the banks: accuracy / mean posterior of the most probable hypothesis, %", "",
        "HybridTrack-v0, no decisions; in brackets the largest calibration error (mean posterior minus "
        "accuracy in a bin of the posterior).", "",
        "| bank | R | " + " | ".join(heads) + " |", "|---|---|" + "---|" * len(heads),
    ]  # fmt: skip
    for bank, noise in dict.fromkeys((one.bank, one.noise) for one in found):
        cells = []
        for one in found:
            if (one.bank, one.noise) == (bank, noise):
                at = one.calibration
                cells.append(f"{100 * at.right:.1f} / {100 * at.stated:.1f} ({100 * at.worst:+.1f})")
        lines.append(f"| {bank} | {noise:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def type_accuracy_markdown(found: Sequence[TypeAccuracy]) -> str:
    """Type accuracy of the gap rule on the scheme of Golubkov 2018."""
    lines = [
        "### The gap rule at ln 99 on the scheme of Golubkov 2018", "",
        "| bank | R | type accuracy, % | mean ticks |", "|---|---|---|---|",
    ]  # fmt: skip
    for one in found:
        percent = Estimate(100 * one.accuracy.value, 100 * one.accuracy.low, 100 * one.accuracy.high)
        bank = one.bank.replace("_", "-")
        lines.append(f"| {bank} | {one.noise:g} | {_cell(percent, 1)} | {one.ticks:.1f} |")
    return "\n".join(lines) + "\n"
