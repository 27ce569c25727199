"""ATE against the multiple model estimators that Tsyganov 2019 names: static, GPB1, IMM and GPB2.

All run on the recordings of Golubkov 2018 and Tsyganov 2019, from the exact start with P = I, and
know radii, Q and R. At known moments of the switches, straight motion, left and right turns are
equally probable at a switch, and the mode is constant until the next one, so that the IMM is the
static estimator, restarted from its merged estimate. At unknown moments the detector of Golubkov
2020, with its published rule, takes the place of ATE, and the hazard of a switch is one over the
mean length of a segment. At every tick the type of the active filter is stated, or the most
probable type. The recalculated estimates of ATE use measurements up to the decision, all others
only those up to their tick.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines import MeanRatioDecider, Scores, Statistic, sprt_thresholds, track_ate
from hybrid_env import QuickestOptions, Simulation, simulate
from studies.papers import golubkov2018, tsyganov2019
from studies.papers.figures import new_figure
from studies.papers.golubkov2020 import BOOTSTRAP_INTERVAL, start_row
from studies.papers.multiple_model_filter import MultipleModels
from studies.papers.reproduction import Cell, Finding, Reproduction

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
# s.
TAU = 0.1
# R [m^2].
VARIANCES = (1.0, 0.1, 0.01)
# Of all tracks in one call; they fit into the cache of a processor.
FILTERS_AT_ONCE = 10_000
MULTIPLE_MODELS = {
    "static": "static",
    "GPB1": "gpb1",
    "IMM": "imm",
    "GPB2": "gpb2",
}


class Setting(NamedTuple):
    """Scheme of a paper: module of the paper, radii of the bank [m], Q [m^2/s^2], options of
    `track_ate`.
    """

    paper: ModuleType
    radii: tuple[float, ...]
    process_variance: float
    ate: dict[str, dict[str, Any]]

    @property
    def sides(self) -> IntArray:
        """(M,) type of each mode: 0 straight, 1 left, -1 right."""
        return np.repeat([0, 1, -1], [1, len(self.radii), len(self.radii)])


REFINED = {"ATE": {}, "ATE, radius refined": {"refine_radius": True}}
REWOUND = {
    "ATE": tsyganov2019.VARIANTS[tsyganov2019.AS_PUBLISHED],
    "ATE, rewound": {"recalculation": "rewind", "reference": "straight"},
}
SETTINGS = (
    Setting(golubkov2018, golubkov2018.RADII, 0.001, REFINED),
    Setting(tsyganov2019, (tsyganov2019.RADIUS,), 0.0, REWOUND),
)

# Statistic and decimals. nRMSE: root of the sum of the mean squared errors of the state. Delay:
# until the statement is right to the end of the segment, or the whole segment. Wrong: segments that
# end with a wrong statement. Wrong changes: of the statement to a wrong type. Kalman steps:
# predictions with corrections.
METRICS = {
    "nRMSE": (Statistic(("squares",), np.sqrt), 3),
    "delay, ticks": (Statistic(("delay",), np.positive), 1),
    "wrong, %": (Statistic(("wrong",), np.positive), 1),
    "wrong changes in 1,000 ticks": (Statistic(("wrong_changes",), np.positive), 1),
    "Kalman steps a tick": (Statistic(("steps",), np.positive), 1),
}
COMPARED = ("nRMSE", "delay, ticks", "wrong, %")


class Tracked(NamedTuple):
    """Output of one estimator: estimates (n, T, 4), stated types (n, T), and Kalman steps a tick
    (n,).
    """

    estimates: FloatArray
    sides: IntArray
    steps: FloatArray


def _run_ate(
    recording: Simulation,
    setting: Setting,
    variance: float,
    options: dict[str, Any],
) -> Tracked:
    tracks = track_ate(
        recording.measurements,
        recording.lengths,
        setting.paper.START,
        radii=setting.radii,
        process_variance=setting.process_variance,
        measurement_variance=variance,
        alpha=setting.paper.ALPHA,
        **options,
    )
    lengths, modes = recording.lengths, len(setting.sides)
    decided = setting.sides[tracks.decided]
    before = np.insert(
        decided[:, :-1],
        0,
        0,
        axis=1,
    )
    ticks, now, last = (
        np.repeat(values, lengths, axis=1) for values in (tracks.ticks, decided, before)
    )
    again = {"as_published": 1, "rewind": modes}.get(options.get("recalculation", "none"), 0)
    after = modes if options.get("refine_radius") else 1
    steps = (modes + again * ~tracks.undecided) * tracks.ticks + after * (lengths - tracks.ticks)
    stated = np.where(
        _ticks_since(lengths) >= ticks,
        now,
        last,
    )
    return Tracked(
        tracks.estimates,
        stated,
        steps.sum(1) / lengths.sum(),
    )


def _run_detector(
    recording: Simulation,
    setting: Setting,
    variance: float,
) -> Tracked:
    """A switch since the last change is tested, at most as long ago as the longest segment."""
    output = _no_output(recording)
    options = QuickestOptions(
        radii=setting.radii,
        process_variance=setting.process_variance,
        measurement_variance=variance,
    )
    window = int(recording.lengths.max())
    rule = MeanRatioDecider(
        options,
        sprt_thresholds(setting.paper.ALPHA)[0],
        0.0,
        window,
    )
    modes = options.hypotheses
    rows = np.tile(start_row(setting.paper.START, modes), (len(output.steps), 1))
    _, filters = rule.predict(rows)
    for k, measured in enumerate(recording.measurements.swapaxes(0, 1)):
        tested = np.minimum(filters.counts + 1, window)
        output.steps[:] += (1 + (modes - 1) * tested) / output.sides.shape[1]
        rows[:, :2] = measured
        stated, filters = rule.predict(rows, filters)
        for axis, name in enumerate(("x", "vx", "y", "vy")):
            output.estimates[:, k, axis] = filters.stated_filters[name][:, 0]
        output.sides[:, k] = setting.sides[stated]
    return output


def _run_models(
    recording: Simulation,
    setting: Setting,
    variance: float,
    method: Any,
    known: bool,
) -> Tracked:
    output, lengths, modes = _no_output(recording), recording.lengths, len(setting.sides)
    groups = setting.sides[:, None] == (0, 1, -1)
    prior = (groups / groups.sum(0)).sum(1) / 3.0
    others = prior * ~np.eye(modes, dtype=np.bool_)
    at_any_tick = (
        np.eye(modes) + (others / others.sum(1, keepdims=True) - np.eye(modes)) / lengths.mean()
    )
    begins = _ticks_since(lengths) == 1
    at_once = max(FILTERS_AT_ONCE // modes**2, 1)
    for first in range(0, len(output.steps), at_once):
        part = slice(first, first + at_once)
        measured = recording.measurements[part]
        start = np.tile(setting.paper.START, (len(measured), 1))
        noises = setting.process_variance, variance
        models = MultipleModels(
            method,
            setting.radii,
            *noises,
            start,
            np.eye(4),
        )
        for k, begin in enumerate(begins):
            at_switch = np.tile(prior, (modes, 1)) if begin else None
            models.step(
                measured[:, k],
                TAU,
                at_switch if known or k == 0 else at_any_tick,
            )
            output.estimates[part, k] = models.merged()[0]
            output.sides[part, k] = np.array([0, 1, -1])[(models.probabilities @ groups).argmax(1)]
            output.steps[part] += models.filters / len(begins)
    return output


def _no_output(recording: Simulation) -> Tracked:
    shape = recording.measurements.shape[:2]
    return Tracked(
        np.empty((*shape, 4)),
        np.empty(shape, np.int64),
        np.zeros(shape[0]),
    )


def _ticks_since(lengths: IntArray) -> IntArray:
    """Return the ticks since the last switch, (T,), 1 in the first tick of a segment."""
    return np.concatenate([np.arange(1, length + 1) for length in lengths])


def estimators(setting: Setting, known: bool) -> dict[str, Callable[..., Tracked]]:
    """Return functions of recording, setting and R by name, ATE or the detector first."""
    found: dict[str, Callable[..., Tracked]] = {"detector 2020": _run_detector}
    if known:
        found = {name: partial(_run_ate, options=options) for name, options in setting.ate.items()}
    for name, method in MULTIPLE_MODELS.items():
        # Which is then the same as the IMM.
        if not known or method != "static":
            found[name] = partial(_run_models, method=method, known=known)
    return found


def score(
    name: str,
    recording: Simulation,
    tracked: Tracked,
) -> Scores:
    """Return the figures of every run, see `METRICS`."""
    lengths, sides = recording.lengths, tracked.sides
    wrong = sides != np.repeat(np.sign(recording.signed_radii), lengths)
    begins = np.cumsum(lengths) - lengths
    figures = {
        "squares": ((tracked.estimates - recording.truth) ** 2).mean(1).sum(1),
        "delay": np.maximum.reduceat(_ticks_since(lengths) * wrong, begins, axis=1).mean(1),
        "wrong": 100.0 * wrong[:, begins + lengths - 1].mean(1),
        "wrong_changes": 1000.0 * ((np.diff(sides, prepend=sides[:, :1]) != 0) & wrong).mean(1),
        "steps": tracked.steps,
    }
    return Scores(
        name,
        "",
        (0.0,),
        tuple(figures),
        np.stack([*figures.values()], axis=1)[..., None],
    )


def reproduce(runs: int = 100, seed: int = 0) -> Reproduction:
    """Compare all estimators on the same recordings; see `golubkov2018.reproduce`."""
    cells: list[Cell] = []
    findings: list[Finding] = []
    curves: dict[str, Any] = {}
    for setting, known, (index, variance) in product(SETTINGS, (True, False), enumerate(VARIANCES)):
        recording = simulate(
            setting.paper.SCHEME,
            runs,
            seed + index,
            start=setting.paper.START,
            process_variance=setting.process_variance,
            measurement_variance=variance,
        )
        title = f"{setting.paper.PAPER}, {'known' if known else 'unknown'} moments"
        table = f"{title}, R = {variance:g}"
        found = [
            score(name, recording, run(recording, setting, variance))
            for name, run in estimators(setting, known).items()
        ]
        for scores in found:
            estimates = {
                metric: scores.estimate(statistic) for metric, (statistic, _) in METRICS.items()
            }
            cells += _cells(table, scores.name, estimates)
            curves.setdefault(title, {}).setdefault(scores.name, []).append(estimates)
        lower: dict[str, list[str]] = {metric: [] for metric in COMPARED}
        pairs = [(scores, found[0]) for scores in found[1:]] + [
            (found[-2], found[1]),
            (found[-1], found[-2]),
        ]
        for scores, other in pairs:
            differences = {
                metric: scores.difference(other, METRICS[metric][0]) for metric in COMPARED
            }
            cells += _cells(
                f"{table}, paired differences",
                f"{scores.name} less {other.name}",
                differences,
            )
            for metric, difference in differences.items():
                if difference.high < 0.0 or difference.low > 0.0:
                    names = scores.name, other.name
                    lower[metric].append(
                        "{} < {}".format(*(names if difference.high < 0.0 else names[::-1]))
                    )
        texts = (
            f"{metric}: {', '.join(names) or 'no difference'}" for metric, names in lower.items()
        )
        findings.append(Finding(f"{table}: paired intervals without 0", "; ".join(texts)))
    return Reproduction(
        "ATE against multiple models",
        runs,
        seed,
        tuple(cells),
        tuple(findings),
        curves,
        100,
    )


def _cells(
    table: str,
    row: str,
    estimates: dict[str, Any],
) -> list[Cell]:
    return [
        Cell(
            table,
            row,
            key,
            float("nan"),
            estimate.value,
            estimate.low,
            estimate.high,
            METRICS[key][1],
            BOOTSTRAP_INTERVAL,
        )
        for key, estimate in estimates.items()
    ]


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name: error, delay and wrong statements over R."""
    figure, rows = new_figure(
        "",
        (18.0, 12.0),
        (1.0,) * len(result.examples),
        len(COMPARED),
    )
    for axes_of_metric, metric in zip(rows, COMPARED, strict=True):
        for axes, (title, found) in zip(axes_of_metric, result.examples.items(), strict=True):
            for name, by_variance in found.items():
                estimates = [of_metric[metric] for of_metric in by_variance]
                values = np.array([estimate.value for estimate in estimates])
                low = values - [estimate.low for estimate in estimates]
                high = [estimate.high for estimate in estimates] - values
                axes.errorbar(
                    VARIANCES,
                    values,
                    [low, high],
                    marker="o",
                    label=name,
                )
            axes.set(
                title=title,
                xlabel="R, m²",
                ylabel=metric,
                xscale="log",
            )
            axes.set_xticks(VARIANCES, [f"{variance:g}" for variance in VARIANCES])
            if metric == "nRMSE":
                axes.set_yscale("log")
                axes.legend()
    return {"multiple_models.png": figure}
