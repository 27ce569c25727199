"""The figures of a comparison: what each shows of the results; `agents.figures` draws it."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from agents.evaluation.announced import ACCURACY_LEVELS
from agents.evaluation.task import Task
from agents.evaluation.unknown import EQUAL_WRONG_CHANGES
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import DeciderStyle, decider_styles
from agents.figures.tracks import IntArray, recording_figure
from agents.studies.comparison import Comparison, Entry
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import MODE_NAMES, Labels
from baselines.rules.decider import ANNOUNCED, UNKNOWN
from baselines.scoring.scores import Statistic, mean
from baselines.scoring.statements import STATISTICS

FloatArray = NDArray[np.float64]

SIZE = (11.5, 5.2)  # of the figures of curves [in]
ERRORS = (0.5, 0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
RATES = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
NOTE = "Filled markers: thresholds selected on other {}. Arrows: the curve continues outside the axes."
WRONG_CHANGES = mean("wrong_changes")


def comparison_figure(result: Comparison) -> Figure:
    """Return the operating curves of a comparison."""
    figures = {ANNOUNCED: announced_curves, UNKNOWN: unknown_curves}
    return figures[result.plan.task.switches](result)


def announced_curves(result: Comparison) -> Figure:
    """Accuracy and mean reward against mean decision time, one curve per decider.

    The accuracy axis is logarithmic in the error rate, so that 98 % and 99 % are distinguishable. Agents that
    differ only in their training seed are drawn as their mean, with their range as the band. The other bands
    are 95 % bootstrap confidence intervals over episodes. Filled markers are the thresholds selected on other
    episodes. A hollow marker at the right edge means that the decider does not reach the accuracy level.
    """
    groups, task = result.seed_groups, result.plan.task
    styles = decider_styles(groups)
    least = 0.5 / (result.plan.episodes * task.options.segments)

    def error(accuracy: FloatArray) -> FloatArray:
        return np.maximum(1.0 - accuracy, least)  # no error among n segments is drawn as half an error

    errors, rewards = (
        [_group_curve(name, entries, column, of, styles[name]) for name, entries in groups.items()]
        for column, of in (("accuracy", error), ("reward", np.asarray))
    )
    wrong = [max(1.0 - _chosen(entry, "accuracy"), least) for entry in result.entries]
    best, worst = (of(_chosen(entry, "reward") for entry in result.entries) for of in (max, min))
    ticks = Axis("mean decision time, ticks", (0.0, _last_tick(list(groups.values()))))
    left = Panel(
        "Accuracy against mean decision time",
        ticks,
        Axis(
            "accuracy, % of segments",
            (max(0.6, 1.1 * max(wrong)), min(0.8e-3, 0.8 * min(wrong))),
            {error: f"{100 * (1 - error):g}" for error in ERRORS},
            log=True,
            levels=tuple(1.0 - level for level in ACCURACY_LEVELS),
        ),
        errors,
        unreached=_unreached(result, groups, styles),
    )
    limits = min(-0.4 * abs(best), best - 0.5, worst - 0.08), best + 0.08
    right = Panel(
        f"Mean reward per segment, delay cost {task.options.delay_cost:g} per tick",
        ticks,
        Axis("mean reward per segment", limits),
        rewards,
    )
    return curve_figure([[left, right]], SIZE, _title(task), NOTE.format("episodes"))


def _group_curve(
    name: str,
    entries: Sequence[Entry],
    column: str,
    of: Callable[[FloatArray], FloatArray],
    style: DeciderStyle,
) -> Curve:
    """Curve of agents that differ only in their training seed: a function of the means of one figure."""
    points = [(_chosen(entry, "ticks"), float(of(np.array(_chosen(entry, column))))) for entry in entries]
    return Curve(
        name if len(entries) == 1 else f"{name}, {len(entries)} seeds",
        style,
        _means(entries, "ticks"),
        of(_means(entries, column)),
        bounds=of(_band(entries, column)),
        selected=points,
    )


def _title(task: Task) -> str:
    variances = " and ".join(f"{variance:g}" for variance in task.options.variances)
    return f"{task.title}: {task.options.hypotheses} hypotheses, R = {variances} m²"


def _chosen(entry: Entry, column: str) -> float:
    """Mean of a figure at the selected threshold."""
    return float(entry.scores.of(column, entry.chosen).mean())


def _means(entries: Sequence[Entry], column: str) -> FloatArray:
    """Mean of a figure at each threshold, over training seeds."""
    return np.asarray(np.mean([entry.scores.curve(mean(column)) for entry in entries], axis=0))


def _last_tick(groups: Sequence[Sequence[Entry]]) -> float:
    """Limit that shows the selected thresholds and the curves up to an accuracy of 99.8 %."""
    ends = [30.0]
    for entries in groups:
        ticks, accuracy = _means(entries, "ticks"), _means(entries, "accuracy")
        ends.append(float(np.interp(0.998, accuracy, ticks)) if accuracy.max() > 0.9 else float(ticks.max()))
        ends += [_chosen(entry, "ticks") for entry in entries]
    return 1.05 * max(ends)


def _unreached(
    result: Comparison, groups: dict[str, list[Entry]], styles: dict[str, DeciderStyle]
) -> dict[float, tuple[str, list[DeciderStyle]]]:
    """The deciders that do not reach an accuracy level at any threshold, if all were scored."""
    found = {}
    for level in ACCURACY_LEVELS:
        missing = [
            styles[name]
            for name, entries in groups.items()
            if (result.plan.curves or entries[0] is result.entries[0])
            and _means(entries, "accuracy").max() < level
        ]
        if missing:
            found[1.0 - level] = f"{100 * level:g} % not reached", missing
    return found


def _band(entries: Sequence[Entry], column: str) -> FloatArray:
    """(2, thresholds) bounds of a figure: over training seeds, or over episodes for a single agent."""
    if len(entries) > 1:
        values = np.array([entry.scores.curve(mean(column)) for entry in entries])
        return np.array([values.min(0), values.max(0)])
    statistic = mean(column, share=column == "accuracy")
    return _points(entries[0], statistic, range(len(entries[0].scores.thresholds)))[1:]


def _points(entry: Entry, statistic: Statistic, indices: Sequence[int]) -> FloatArray:
    """(3, K) value and bounds of a statistic at some thresholds."""
    estimates = [entry.scores.estimate(statistic, index) for index in indices]
    return np.array([[one.value, one.low, one.high] for one in estimates]).reshape(-1, 3).T


def unknown_curves(result: Comparison) -> Figure:
    """Mean delay and mean reward against wrong changes per 1,000 ticks, one curve per decider.

    The delay of a switch that is not detected is that to the end of its segment. Otherwise a strict threshold
    would detect only the easiest switches and seem quick. Bands are 95 % bootstrap confidence intervals over
    tracks. Filled markers are the thresholds selected on other tracks. A dashed line marks the rate at which
    delays are compared.
    """
    task = result.plan.task
    chosen = [rate for rate in (_chosen(entry, "wrong_changes") for entry in result.entries) if rate > 0.0]
    chosen.append(EQUAL_WRONG_CHANGES)
    low, high = min(chosen) / 3.0, max(chosen) * 3.0
    rates = Axis(
        "wrong changes per 1,000 ticks",
        (low, high),
        {rate: f"{rate:g}" for rate in RATES if low <= rate <= high},
        minor=True,
        log=True,
        levels=(EQUAL_WRONG_CHANGES,),
    )
    styles = decider_styles([entry.name for entry in result.entries])
    reward = f"Mean reward, a wrong change costs {task.options.change_cost:g} ticks"
    row = []
    for title, label, statistic in (
        ("Delay against wrong changes", "mean delay of a switch, ticks", STATISTICS["full_delay"]),
        (reward, "mean reward of a tick", STATISTICS["reward"]),
    ):
        shown = [
            value
            for entry in result.entries
            for rate, value in zip(
                entry.scores.curve(WRONG_CHANGES), entry.scores.curve(statistic), strict=True
            )
            if min(chosen) / 1.7 <= rate <= high
        ]
        margin = 0.06 * (max(shown) - min(shown))
        curves = [
            _rate_curve(entry, statistic, styles[entry.name])
            for entry in result.entries
            if (entry.scores.curve(WRONG_CHANGES) > 0.0).any()
        ]
        row.append(Panel(title, rates, Axis(label, (min(shown) - margin, max(shown) + margin)), curves))
    title = f"{_title(task)}, segments of {task.options.law} ticks"
    note = f"{NOTE.format('tracks')} A switch that is not detected counts until the end of its segment."
    return curve_figure([row], SIZE, title, note)


def _rate_curve(entry: Entry, statistic: Statistic, style: DeciderStyle) -> Curve:
    """Curve through the thresholds with a wrong change."""
    rates = entry.scores.curve(WRONG_CHANGES)
    shown = np.flatnonzero(rates > 0.0)
    points = _points(entry, statistic, shown.tolist())
    selected = (_chosen(entry, "wrong_changes"), float(entry.scores.curve(statistic)[entry.chosen]))
    return Curve(
        entry.name,
        style,
        rates[shown],
        points[0],
        bounds=points[1:],
        selected=[selected] if selected[0] > 0.0 else (),
    )


def flight_figure(flight: Flight, labels: Labels, stated: Mapping[str, IntArray], title: str) -> Figure:
    """A flight with its labels, and with the statements (n,) of each decider; see `recording_figure`."""
    shown = np.where(labels.scored, labels.modes, len(MODE_NAMES))
    kilometres, minutes = flight.positions / 1000.0, flight.times / 60.0
    return recording_figure(kilometres, minutes, flight.pieces, shown, stated, MODE_NAMES, title)
