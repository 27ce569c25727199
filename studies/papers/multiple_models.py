"""ATE against the multiple model estimators that Tsyganov 2019 names: static, GPB1, IMM and GPB2.

All run on the recordings of Golubkov 2018 and Tsyganov 2019, from the exact start with P = I, and
know radii, Q and R. At known moments of the switches, straight motion, left and right turns are
equally probable at a switch, and the mode is constant until the next one, so that the IMM is the
static estimator, restarted from its merged estimate. At unknown moments the detector of Golubkov
2020, with its published rule, takes the place of ATE, and the hazard of a switch is one over the
mean length of a segment. At every tick the type of the active filter is stated, or the most
probable type. The recalculated estimates of ATE use measurements up to the decision, all others
only those up to their tick.

The motions differ: the filters of ATE turn about a centre, at a rate, that they keep from the
switch on; those of the IMM have the rate of their present speed (coordinated turn). The statements
differ: ATE declares once in a segment. Delays are therefore also compared at equal wrong changes:
the IMM changes its statement only to a type whose probability reaches a threshold, which is the one
where its wrong changes are those of the rival.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines import Estimate, Scores, Statistic, sprt_thresholds
from hybrid_env import Simulation
from studies.papers.anchored_ate import anchored_ate
from studies.papers.golubkov2020 import BOOTSTRAP_INTERVAL, run_detector
from studies.papers.multiple_model_filter import MultipleModels
from studies.papers.published import FloatArray, IntArray, Reproduction, intervals, table_row
from studies.papers.setting import GOLUBKOV_2018, TSYGANOV_2019, Setting
from studies.pictures import draw_estimates

# A far stricter threshold than the published one, which is not tuned.
STRICT = 1e-9
# Options of `track_ate` in each setting, the published ones first.
ATE: dict[str, dict[str, dict[str, Any]]] = {
    GOLUBKOV_2018.paper: {
        "ATE": {},
        f"ATE, alpha = {STRICT:g}": {"alpha": STRICT},
        "ATE, radius refined": {"refine_radius": True},
    },
    TSYGANOV_2019.paper: {
        "ATE": {},
        f"ATE, alpha = {STRICT:g}": {"alpha": STRICT},
        "ATE, rewound": {"recalculation": "rewind", "reference": "straight"},
    },
}
# Whether centre and rate of a turn are exact, see `anchored_ate`, and alpha.
ANCHORED = {
    "ATE, P kept": (True, 1e-3),
    "ATE, anchor-aware bank": (False, 1e-3),
    f"ATE, anchor-aware bank, alpha = {STRICT:g}": (False, STRICT),
}
# Largest error probabilities at which the IMM changes its statement; with 1 it always states the
# most probable type.
ERRORS = (1.0, *np.logspace(-0.2, -12.0, 60))
# Values of a run and their decimals. nRMSE: root of the sum of the mean squared errors of the
# state. Delay: until the statement is right to the end of the segment, or the whole segment. Wrong:
# segments that end with a wrong statement. Wrong changes: of the statement to a wrong type. Kalman
# steps: predictions with corrections. The first three are compared.
METRICS = {
    "nRMSE": 3,
    "delay, ticks": 1,
    "wrong, %": 1,
    "wrong changes in 1,000 ticks": 1,
    "Kalman steps a tick": 1,
}
COMPARED = tuple(METRICS)[:3]
# Columns of a rival and of the IMM where its wrong changes are those of the rival.
EQUAL = (
    "wrong changes in 1,000 ticks",
    "delay of the rival, ticks",
    "delay of the IMM, ticks",
    "difference, ticks",
)


# Types: straight, left, right.
SIDES = np.array([0, 1, -1])


class Tracked(NamedTuple):
    """Output of one estimator for n runs of T ticks, or for one tick."""

    # (n, T, 4) [m, m/s]
    estimates: FloatArray
    # (n, T) stated types: 0 straight, 1 left, -1 right.
    sides: IntArray
    # (n, T) Kalman steps.
    steps: FloatArray
    # (n, T, 3) probabilities of the types, if the estimator has them.
    probabilities: FloatArray | None = None


def _run_ate(
    recording: Simulation, setting: Setting, variance: float, options: dict[str, Any]
) -> Tracked:
    tracks = setting.track(recording, variance, **options)
    modes = len(setting.signed_radii)
    sides, testing = _of_ticks(recording, setting, tracks.decided, tracks.ticks)
    undecided = np.repeat(tracks.undecided, recording.lengths, axis=1)
    recalculation = (setting.ate | options).get("recalculation", "none")
    again = {"none": 0, "as_published": 1, "rewind": modes}[recalculation]
    after = modes if options.get("refine_radius") else 1
    steps = np.where(testing, modes + again * ~undecided, after)
    return Tracked(tracks.estimates, sides, steps)


def _of_ticks(
    recording: Simulation, setting: Setting, modes: IntArray, times: IntArray
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return the stated types (n, T), and whether the test runs (n, T), from decided modes and
    decision times (n, K).
    """
    lengths = recording.lengths
    decided = setting.sides[modes]
    before = np.insert(decided[:, :-1], 0, 0, axis=1)
    ticks, now, last = (np.repeat(values, lengths, axis=1) for values in (times, decided, before))
    since = _ticks_since(lengths)
    return np.where(since >= ticks, now, last), since <= ticks


def _run_anchored(
    recording: Simulation, setting: Setting, variance: float, exact: bool, alpha: float
) -> Tracked:
    changed = replace(setting, alpha=alpha)
    estimates, modes, times = anchored_ate(recording, changed, variance, exact)
    sides, testing = _of_ticks(recording, setting, modes, times)
    return Tracked(estimates, sides, np.where(testing, len(setting.signed_radii), 1))


def _run_detector(recording: Simulation, setting: Setting, variance: float) -> Iterator[Tracked]:
    """A switch since the last change is tested, at most as long ago as the longest segment."""
    window = int(recording.lengths.max())
    threshold, _ = sprt_thresholds(setting.alpha)
    counts: Any = 0
    for stated, filters in run_detector(
        recording.measurements, setting, variance, threshold, window
    ):
        state = [filters.stated_filters[name][:, 0, 0] for name in ("x", "vx", "y", "vy")]
        steps = 1 + 2 * len(setting.radii) * np.minimum(counts + 1, window)
        yield Tracked(
            np.stack(state, -1), setting.sides[stated], np.broadcast_to(steps, len(stated))
        )
        counts = filters.counts.copy()


def _run_models(
    recording: Simulation, setting: Setting, variance: float, method: Any, known: bool
) -> Iterator[Tracked]:
    lengths, radii = recording.lengths, setting.signed_radii
    runs = len(recording.measurements)
    groups = setting.sides[:, None] == SIDES
    prior = (groups / groups.sum(0)).sum(1) / 3.0
    stay = np.eye(len(radii))
    others = prior * (1.0 - stay)
    at_any_tick = stay + (others / others.sum(1, keepdims=True) - stay) / lengths.mean()
    at_switch = np.tile(prior, (len(radii), 1))
    start = np.tile(setting.start, (runs, 1))
    models = MultipleModels(method, radii, setting.process_variance, variance, start, np.eye(4))
    for k, since in enumerate(_ticks_since(lengths)):
        at_known_moment = at_switch if since == 1 else None
        transition = at_known_moment if known or k == 0 else at_any_tick
        models.step(recording.measurements[:, k], setting.tau, transition)
        probabilities = models.probabilities @ groups
        yield Tracked(
            models.merged()[0][:, 0],
            SIDES[probabilities.argmax(1)],
            np.full(runs, float(models.filters)),
            probabilities,
        )


def _ticks_since(lengths: IntArray) -> IntArray:
    """Return the ticks since the last switch, (T,), 1 in the first tick of a segment."""
    return np.concatenate([np.arange(1, length + 1) for length in lengths])


def estimators(setting: Setting, known: bool) -> dict[str, Callable[..., Any]]:
    """Return functions of recording, setting and R by name, ATE or the detector first. They return
    a `Tracked`, or yield that of every tick.
    """
    models = {
        name: partial(_run_models, method=name.lower(), known=known)
        for name in ("static", "GPB1", "IMM", "GPB2")
        # At known moments, static is the same as the IMM.
        if not known or name != "static"
    }
    if not known:
        return {"detector 2020": _run_detector, **models}
    ate = {name: partial(_run_ate, options=given) for name, given in ATE[setting.paper].items()}
    kept = {
        name: partial(_run_anchored, exact=exact, alpha=alpha)
        for name, (exact, alpha) in ANCHORED.items()
    }
    return {**ate, **kept, **models}


def complete(tracked: Tracked | Iterator[Tracked]) -> Tracked:
    """Return the output for all ticks, from that of every tick."""
    if isinstance(tracked, Tracked):
        return tracked
    estimates, sides, steps, probabilities = zip(*tracked, strict=True)
    return Tracked(
        np.stack(estimates, axis=1),
        np.stack(sides, axis=1),
        np.stack(steps, axis=1),
        None if probabilities[0] is None else np.stack(probabilities, axis=1),
    )


def stated_above(probabilities: FloatArray, error: float) -> IntArray:
    """Return statements (n, T) that change to the most probable type where all other types have at
    most a probability together, from the probabilities (n, T, 3); straight at first.
    """
    best = probabilities.argmax(2)
    others = np.where(np.arange(3) == best[..., None], 0.0, probabilities).sum(2)
    changes = others <= error
    stated = np.zeros(best.shape, np.int64)
    last = stated[:, 0]
    for k in range(best.shape[1]):
        last = np.where(changes[:, k], best[:, k], last)
        stated[:, k] = last
    return SIDES[stated]


def at_equal_wrong_changes(rival: Scores, curve: Sequence[Scores], seed: int) -> list[FloatArray]:
    """Return the values of `EQUAL` with their intervals, of a rival and of an estimator at each of
    its thresholds; NaN if no threshold has as few wrong changes.
    """
    wrong, delay = "wrong changes in 1,000 ticks", "delay, ticks"
    values = [[each.of(name, 0) for each in (rival, *curve)] for name in (wrong, delay)]

    def delays(means: FloatArray) -> FloatArray:
        changes, late = np.split(means, 2, axis=-1)
        few = changes[..., 1:] <= changes[..., :1]
        right = few.argmax(-1)[..., None] + 1
        left = np.maximum(right - 1, 1)
        (x0, y0), (x1, y1) = (
            [np.take_along_axis(line, index, -1)[..., 0] for line in (changes, late)]
            for index in (left, right)
        )
        share = np.where(x0 > x1, (x0 - changes[..., 0]) / np.where(x0 > x1, x0 - x1, 1.0), 1.0)
        equal = np.where(few.any(-1), y0 + share * (y1 - y0), np.nan)
        theirs = late[..., 0]
        return np.stack([changes[..., 0], theirs, equal, equal - theirs], axis=-1)

    per_run = np.concatenate(values).T
    return intervals(per_run, delays, seed, len(per_run))[:3]


def score(name: str, recording: Simulation, tracked: Tracked) -> Scores:
    """Return the values of every run, see `METRICS`."""
    lengths, sides = recording.lengths, tracked.sides
    wrong = sides != np.repeat(np.sign(recording.signed_radii), lengths)
    begins = np.cumsum(lengths) - lengths
    late = np.maximum.reduceat(_ticks_since(lengths) * wrong, begins, axis=1)
    values = [
        ((tracked.estimates - recording.truth) ** 2).mean(1).sum(1),
        late.mean(1),
        100.0 * wrong[:, begins + lengths - 1].mean(1),
        1000.0 * ((np.diff(sides, prepend=sides[:, :1]) != 0) & wrong).mean(1),
        tracked.steps.mean(1),
    ]
    return Scores(name, "", (0.0,), tuple(METRICS), np.stack(values, axis=1)[..., None])


def reproduce(
    runs: int = 100,
    seed: int = 0,
    settings: Sequence[Setting] = (GOLUBKOV_2018, TSYGANOV_2019),
    variances: Sequence[float] = (1.0, 0.1, 0.01),
) -> Reproduction:
    """Compare all estimators on the same recordings, at each R [m^2]; see
    `golubkov2018.reproduce`.
    """
    rows: list[pd.DataFrame] = []
    curves = []
    numbered = enumerate(variances)
    for setting, known, (index, variance) in product(settings, (True, False), numbered):
        recording = setting.simulate(runs, seed + index, variance)
        title = f"{setting.paper}, {'known' if known else 'unknown'} moments"
        table = f"{title}, R = {variance:g}"
        results = {
            name: complete(run(recording, setting, variance))
            for name, run in estimators(setting, known).items()
        }
        compared = [score(name, recording, tracked) for name, tracked in results.items()]
        for scores in compared:
            row = _row(table, scores.name, METRICS, scores.estimate)
            rows.append(row)
            curves.append(row.assign(title=title, variance=variance))
        first, *others = compared
        *rivals, imm, gpb2 = others
        decided = [each for each in rivals if results[each.name].probabilities is None]
        pairs = [*((scores, first) for scores in others), *((imm, each) for each in decided)]
        pairs += [(gpb2, imm)]
        rows += [
            _row(
                f"{table}, paired differences",
                f"{scores.name} less {other.name}",
                COMPARED,
                partial(scores.difference, other),
            )
            for scores, other in pairs
        ]
        likely = results["IMM"].probabilities
        assert likely is not None
        curve = [
            score("IMM", recording, results["IMM"]._replace(sides=stated_above(likely, error)))
            for error in ERRORS
        ]
        rows += [
            table_row(
                f"{table}, delay at equal wrong changes",
                f"IMM and {scores.name}",
                EQUAL,
                np.nan,
                at_equal_wrong_changes(scores, curve, seed + index),
                1,
                BOOTSTRAP_INTERVAL,
            )
            for scores in compared
            if results[scores.name].probabilities is None
        ]
    figure = _figure(pd.concat(curves))
    return Reproduction("ATE against multiple models", runs, seed, rows, (), figure=figure)


def _row(
    table: str, name: str, metrics: Iterable[str], estimate: Callable[[Statistic], Any]
) -> pd.DataFrame:
    estimates = [
        estimate(Statistic((metric,), np.sqrt if metric == "nRMSE" else np.positive))
        for metric in metrics
    ]
    results = np.array([[*vars(each).values()] for each in estimates]).T
    digits = [METRICS[metric] for metric in metrics]
    return table_row(table, name, metrics, np.nan, results, digits, BOOTSTRAP_INTERVAL)


def _figure(cells: pd.DataFrame) -> Figure:
    """Return error, delay and wrong statements over R, without GPB2, whose lines are those of the
    IMM.
    """
    cells = cells[cells.row != "GPB2"]
    titles = cells.title.unique()
    figure = Figure(figsize=(18.0, 12.0), layout="constrained", dpi=110)
    panels = figure.subplots(len(COMPARED), len(titles), squeeze=False)
    for (metric, title), axes in zip(product(COMPARED, titles), panels.flat, strict=True):
        here = cells[(cells.title == title) & (cells.column == metric)]
        for name, curve in here.groupby("row", sort=False):
            estimates = [Estimate(*row) for row in curve[["ours", "low", "high"]].to_numpy()]
            draw_estimates(axes, curve.variance, estimates, marker="o", label=name)
        scale = "log" if metric == "nRMSE" else "linear"
        axes.set(title=title, xlabel="R, m²", ylabel=metric, xscale="log", yscale=scale)
    for axes in panels[0]:
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.08), fontsize=9)
    return figure
