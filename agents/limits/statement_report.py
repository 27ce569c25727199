"""Markdown tables of what limits a statement of the present mode."""

from collections.abc import Callable, Sequence

import numpy as np

from agents.evaluation.operating_curve import Estimate
from agents.limits.statement_study import LAWS, STEPS, THRESHOLD, StatementStep
from agents.limits.steps import reward_cell
from agents.limits.study import NOISE_LEVELS


def statement_steps_markdown(found: Sequence[StatementStep]) -> str:
    """Return three tables for each law of durations, with steps in rows and noise levels in columns."""
    lines = []
    for law in LAWS:
        here = [one for one in found if one.law == law]
        lines += [f"### HybridTrackQuickest-v0, durations {law}", ""]
        lines += [
            "Mean reward of a tick at the tuned threshold; in brackets the gain over the row before, with "
            "its 95 % interval.", "", *_table(here, STEPS, lambda one: reward_cell(one.reward, one.gain)),
            "Mean delay of a switch in ticks (one that is not detected counts until the end of its segment) "
            "/ wrong changes of the statement per 1,000 ticks, at the same thresholds.", "",
            *_table(here, STEPS, _delay_cell),
            "Share of ticks at which the most probable mode is the true one, %, without a threshold.", "",
            *_table(here, [step for step in STEPS if step != THRESHOLD], _right_cell),
        ]  # fmt: skip
    return "\n".join(lines)


def _table(
    found: Sequence[StatementStep], steps: Sequence[str], cell: Callable[[StatementStep], str]
) -> list[str]:
    lines = ["| step | " + " | ".join(f"R = {noise:g}" for noise in NOISE_LEVELS) + " |"]
    lines += ["|---|" + "---|" * len(NOISE_LEVELS)]
    for step in steps:
        cells = [
            cell(one) for noise in NOISE_LEVELS for one in found if (one.step, one.noise) == (step, noise)
        ]
        lines.append(f"| {step} | " + " | ".join(cells) + " |")
    return [*lines, ""]


def _delay_cell(one: StatementStep) -> str:
    return f"{_number(one.delay, 1)} / {_number(one.wrong_changes, 2)}"


def _right_cell(one: StatementStep) -> str:
    share = one.most_probable_right
    return f"{100 * share.value:.1f} [{100 * share.low:.1f}, {100 * share.high:.1f}]"


def _number(estimate: Estimate, digits: int) -> str:
    return f"{estimate.value:.{digits}f}" if np.isfinite(estimate.value) else "-"
