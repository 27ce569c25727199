"""Table of `hybridtrack evaluate --shifted`."""

import io

from given_scores import ANNOUNCED, announced_scores
from rich.console import Console

from agents.evaluation.worlds import NOMINAL
from agents.studies.shifts import Shift, shift_table

DECIDERS = (
    "shipped", "ATE (SPRT)", "MSPRT", "MSPRT, kept covariance", "calibrated anchor",
    "calibrated anchor, robust filters",
)  # fmt: skip


def result(world: str, decider: str, accuracy: float) -> Shift:
    scores = announced_scores(decider, [accuracy], [0])
    return Shift(world, ANNOUNCED, scores, scores)


def printed(results: list[Shift]) -> str:
    text = io.StringIO()
    Console(file=text, width=80).print(shift_table(results, "Title"))
    return text.getvalue()


def test_six_deciders_fit_into_80_columns() -> None:
    worlds = (NOMINAL, "first estimate 3 times as wrong")
    text = printed([result(w, name, 0.75 + k / 32) for k, name in enumerate(DECIDERS) for w in worlds])
    assert "…" not in text
    row = next(line for line in text.splitlines() if line.startswith("nominal"))
    assert row.split()[1:] == ["+0.500", "+0.562", "+0.625", "+0.688", "+0.750", "+0.812", "-0.312"]
    assert text.count("±0.000") == 2 * len(DECIDERS) + 2


def test_names_are_printed_as_they_are() -> None:
    assert "s[/b]" in printed([result(NOMINAL, "s[/b]", 0.75)])
