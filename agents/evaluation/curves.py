"""Operating curves: what the figure of a comparison shows of each task; `agents.figures` draws it.

Deciders that differ only in their training seed are drawn as one curve, the mean of theirs, with
their range as the band. The other bands are 95 % bootstrap confidence intervals over episodes.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from agents.figures.curves import Curve
from agents.figures.decider_colours import decider_styles
from baselines.scoring.scores import Scores, Statistic
from hybrid_env.checks import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Selected:
    """Scores of a decider, and the threshold selected for it."""

    # At all its thresholds, or at the selected one.
    scores: Scores
    # Index of the threshold that was selected on other episodes.
    chosen: int


# Deciders by name; those of one name differ only in their training seed.
Groups = Mapping[str, Sequence[Selected]]


def chosen(groups: Groups, statistic: Statistic) -> Iterator[float]:
    """Return a statistic of every decider at its selected threshold."""
    return (
        float(one.scores.curve(statistic)[one.chosen]) for group in groups.values() for one in group
    )


def means(group: Sequence[Selected], statistic: Statistic) -> FloatArray:
    """Return the mean of a statistic over training seeds at each threshold, (K,)."""
    return np.asarray(np.mean([one.scores.curve(statistic) for one in group], axis=0))


def curves(groups: Groups, x: Statistic, y: Statistic, above: tuple[float, float]) -> list[Curve]:
    """Return one curve for each name, of the points whose x is above the first number; y is at
    least the second.
    """
    styles = decider_styles(groups)
    found = []
    several_banks = len({group[0].scores.bank for group in groups.values()}) > 1
    for name, group in groups.items():
        places = means(group, x)
        shown = np.flatnonzero(places > above[0])
        if shown.size:
            points = zip(*(chosen({name: group}, statistic) for statistic in (x, y)), strict=True)
            selected = [
                (place, max(value, above[1])) for place, value in points if place > above[0]
            ]
            title = name if len(group) == 1 else f"{name}, {len(group)} seeds"
            title += f", {group[0].scores.bank.replace('_', '-')} bank" if several_banks else ""
            line, band = (
                np.maximum(of, above[1]) for of in (means(group, y)[shown], _band(group, y, shown))
            )
            found.append(
                Curve(title, styles[name], places[shown], line, bounds=band, selected=selected)
            )
    return found


def _band(group: Sequence[Selected], statistic: Statistic, shown: IntArray) -> FloatArray:
    """Return (2, K) bounds of a statistic: over training seeds, or over episodes for a single
    decider.
    """
    if len(group) > 1:
        values = np.array([one.scores.curve(statistic) for one in group])[:, shown]
        return np.array([values.min(0), values.max(0)])
    estimates = [group[0].scores.estimate(statistic, index) for index in shown.tolist()]
    return np.array([[one.low, one.high] for one in estimates]).reshape(-1, 2).T
