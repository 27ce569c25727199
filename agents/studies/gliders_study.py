"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on
the other.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from rich.markup import escape
from rich.table import Table

from agents.evaluation import gliders as task
from agents.evaluation.cells import filled_table
from agents.evaluation.flights import AGENT, SECOND_LINES, figure_cell, less_cell, less_first, value
from agents.evaluation.gliders import METRICS, Setting, glider_rule, glider_statements
from agents.figures.tracks import recording_figure
from agents.interface.output_files import finite
from agents.interface.parallel import Workers
from agents.studies.seal import current_digests, unbroken_seal
from baselines.estimation.turns import STRAIGHT, run_turn_imm
from baselines.recordings.flights import circling, gliders
from baselines.recordings.flights import labels as label_rules
from baselines.recordings.flights.flight import Flight, stack_flights
from baselines.recordings.flights.gliders import HALVES, SEALED, half_of, read_logs
from baselines.recordings.flights.labels import MODE_NAMES, Labels
from baselines.recordings.flights.metrics import STATISTICS, score_flights
from baselines.recordings.flights.simulated_gliders import label_gliders, simulate_glider
from baselines.recordings.reading import igc
from baselines.rules import circling as rules_of_circling
from baselines.rules.decider import GLIDERS, rules
from baselines.scoring.scores import Scores
from hybrid_env.checks import FloatArray, IntArray, reject

# False changes an hour at which rules are compared.
LEVELS = (2.0, 5.0, 8.0)

REFERENCE = "imm"
# Flights, of seconds, for comparison.
SIMULATED, SIMULATED_TIME, SIMULATED_SEED = 60, 3600.0, 20260601
SEAL = Path(__file__).with_name("sealed.json")
"""Digests of code and weights, and the settings, which are fixed before the sealed logs are
opened.
"""

# Percentiles of what recorded and simulated flights have in common.
SHARES = (5.0, 50.0, 95.0)
# Turn rate [rad/s] and angle [deg].
SLOWEST_WIGGLE, SMALLEST_WIGGLE = np.radians(1.0), 10.0
# Positions of circles that are left out at either end.
INNER = 3
# Time in the picture [s].
SHOWN_TIME = 600.0
NOTES = (
    f"{SECOND_LINES} Less first: points of agreement.\n"
    "Settings: the best agreement on the other half with as few false changes there.\n"
    "Enter, leave: mean time from a change of the label to the first right statement.\n"
    "Misses: the next change of the label came first. Simul.: agreement on simulated flights."
)

FROZEN = {
    "labels": circling,
    "smoothed turns": label_rules,
    "logs": gliders,
    "format": igc,
    "rules": rules_of_circling,
}


@dataclass(frozen=True, eq=False)
class GliderComparison:
    """Results."""

    flights: list[Flight]
    labels: list[Labels]
    # By level and name of the rule; each flight has the setting that was selected without its half.
    scores: dict[float, dict[str, Scores]]
    # Settings by level, name and half that they are scored on, or `SEALED`: selected on all halves.
    chosen: dict[float, dict[str, dict[str, Setting]]]
    # Statements (n,) of the rules on each flight at the middle level.
    stated: dict[str, list[IntArray]]
    # Scores on simulated flights, with the settings that were selected on all halves.
    simulated: dict[float, dict[str, Scores]]
    # Percentiles of the open flights and of the simulated ones, by quantity.
    gap: dict[str, tuple[list[float], ...]]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the open flights, and of the sealed ones."""
        sealed = np.array([flight.tier.name == SEALED for flight in self.flights])
        groups = {
            "both halves": np.flatnonzero(~sealed).tolist(),
            SEALED: np.flatnonzero(sealed).tolist(),
        }
        return {name: rows for name, rows in groups.items() if rows}

    @property
    def seal(self) -> dict[str, Any]:
        """What `SEAL` holds once these settings are to be fixed."""
        found = {
            level: {name: one[SEALED] for name, one in some.items()}
            for level, some in self.chosen.items()
        }
        return current_seal() | {"settings": {f"{level:g}": some for level, some in found.items()}}


def select(scores: Scores, level: float) -> int:
    """Return the setting with the best agreement among those with few enough false changes an
    hour.
    """
    false = scores.curve(task.FALSE)
    agreement = scores.curve(STATISTICS["agreement"])
    allowed = false <= max(level, float(false.min()))
    return int(np.where(allowed, agreement, -1.0).argmax())


def compare_on_gliders(
    source: Path,
    names: Sequence[str],
    workers: Workers,
    note: Callable[[str], None],
    sealed: bool = False,
) -> GliderComparison:
    """Compare rules on flights of gliders, the first being the reference; `note` is called
    `steps` times.

    With `sealed`, the sealed logs are opened too, with the settings of the seal.
    """
    for name in names:
        # An unknown one is refused before any work.
        glider_rule(name)
    frozen = unbroken_seal(SEAL, current_seal(), "logs", names)["settings"] if sealed else {}
    note("reading")
    contents = read_logs(source)
    flights: list[Flight] = []
    labels: list[Labels] = []
    for half in (*HALVES, SEALED) if sealed else HALVES:
        some = [content for name, content in contents.items() if half_of(name) == half]
        if not some:
            raise reject("source", str(source), f"{gliders.EXPECTED}: it has no log of half {half}")
        note(f"labels: {half}")
        found = task.read_gliders(some, half)
        flights, labels = flights + found[0], labels + found[1]
    of = np.array([flight.tier.name for flight in flights])
    note("simulated flights")
    generator = np.random.default_rng(SIMULATED_SEED)
    copies = [simulate_glider(SIMULATED_TIME, generator) for _ in range(SIMULATED)]
    copied = label_gliders(copies)
    rows = np.flatnonzero(of != SEALED)
    real = samples([flights[k] for k in rows], [labels[k] for k in rows])
    made = samples(copies, copied)
    known = [name for name, values in real.items() if values.size and made[name].size]
    gap = {
        name: tuple(np.percentile(some[name], SHARES).tolist() for some in (real, made))
        for name in known
    }
    result = GliderComparison(flights, labels, {}, {}, {}, {}, gap)
    calls = {
        name: functools.partial(
            _compare_rule,
            name,
            flights,
            labels,
            copies,
            copied,
            {level: one[name] for level, one in frozen.items()},
        )
        for name in names
    }
    for name, found in workers.results(calls, lambda name: note(glider_rule(name).title)):
        result.stated[name], scores, chosen, simulated = found
        for level in LEVELS:
            result.scores.setdefault(level, {})[name] = scores[level]
            result.chosen.setdefault(level, {})[name] = chosen[level]
            result.simulated.setdefault(level, {})[name] = simulated[level]
    return result


def _compare_rule(
    name: str,
    flights: list[Flight],
    labels: list[Labels],
    copies: list[Flight],
    copied: list[Labels],
    frozen: Mapping[str, Any],
) -> tuple[
    list[IntArray], dict[float, Scores], dict[float, dict[str, Setting]], dict[float, Scores]
]:
    """Return what a rule states at the middle level, and by level scores, settings and scores on
    simulated flights.

    `frozen` are settings for the sealed flights by level; without any they are selected on all
    halves.
    """
    of = np.array([flight.tier.name for flight in flights])
    settings = task.all_settings(name)
    told = glider_statements(flights, settings)
    swept = task.score_settings(flights, labels, told)
    scores = {}
    every = {}
    for level in LEVELS:
        best = {
            half: select(swept.some(np.flatnonzero((of != half) & (of != SEALED)).tolist()), level)
            for half in (*HALVES, SEALED)
        }
        if frozen:
            _, model, numbers = frozen[f"{level:g}"]
            best[SEALED] = settings.index(Setting(name, model, tuple(numbers)))
        chosen = [best[half] for half in of]
        values = swept.values[np.arange(len(of)), :, chosen][..., None]
        scores[level] = Scores(swept.name, "", (0.0,), swept.columns, values)
        every[level] = {half: settings[k] for half, k in best.items()}
    made = glider_statements(copies, list(dict.fromkeys(one[SEALED] for one in every.values())))
    simulated = {
        level: score_flights(swept.name, copies, copied, made[one[SEALED]])
        for level, one in every.items()
    }
    return (
        [told[every[LEVELS[1]][half]][row] for row, half in enumerate(of)],
        scores,
        every,
        simulated,
    )


def samples(flights: Sequence[Flight], labels: Sequence[Labels]) -> dict[str, FloatArray]:
    """Return values by quantity, with its unit, where flights are scored."""
    batch = stack_flights(flights, task.PART, task.MARGIN)
    imm = run_turn_imm(batch, rules_of_circling.GliderImm.models[0])
    innovations = batch.unstack(imm.innovations, [len(flight.times) for flight in flights])
    found: dict[str, list[Any]] = {}
    for flight, label, innovation in zip(flights, labels, innovations, strict=True):
        straight, circling = (
            label.scored & ((label.modes == STRAIGHT) == own) for own in (True, False)
        )
        rates, changes = (
            np.degrees(np.abs(label.rates)),
            np.abs(np.gradient(label.speeds, label.times)),
        )
        for name, rows in (
            ("straight", straight),
            ("circling", circling),
        ):
            for what, values in (
                ("airspeed, m/s", label.speeds),
                ("its change, m/s²", changes),
                ("climb rate, m/s", flight.climbs),
                ("innovation along", np.abs(innovation[:, 0])),
                ("innovation across", np.abs(innovation[:, 1])),
            ):
                found.setdefault(f"{name}: {what}", []).append(values[rows])
        found.setdefault("straight: turn rate, deg/s", []).append(rates[straight])
        found.setdefault("wiggle: angle, deg", []).append(_wiggles(label, straight))
        for first, end, mode in label.pieces:
            if label.scored[first:end].any():
                name = "straight" if mode == STRAIGHT else "circling"
                inner = rates[first + INNER : end - INNER]
                found.setdefault(f"{name}: duration, s", []).append(
                    [label.times[end - 1] - label.times[first]]
                )
                if mode != STRAIGHT and inner.size > INNER:
                    found.setdefault("circling: turn rate, deg/s", []).append([np.median(inner)])
                    found.setdefault("circling: its variation", []).append(
                        [inner.std() / inner.mean()]
                    )
    return {name: np.concatenate(values) for name, values in sorted(found.items())}


def _wiggles(label: Labels, straight: Any) -> FloatArray:
    """Return the angles of turns to one side in straight flight [deg]."""
    turning = np.where(straight & (np.abs(label.rates) > SLOWEST_WIGGLE), np.sign(label.rates), 0.0)
    begins = np.flatnonzero(np.diff(turning, prepend=np.nan) != 0.0)
    angles = np.add.reduceat(
        np.degrees(np.abs(label.rates)) * label.weights * (turning != 0.0),
        begins,
    )
    return np.asarray(angles[angles > SMALLEST_WIGGLE])


def steps(names: Sequence[str], sealed: bool) -> int:
    """Return the number of calls of `note` by `compare_on_gliders`."""
    return 2 + len(HALVES) + len(names) + sealed


def default_names() -> tuple[str, ...]:
    """Return the names of all rules, the reference first, and of the agent."""
    return tuple(dict.fromkeys((REFERENCE, *rules(GLIDERS), AGENT)))


def current_seal() -> dict[str, Any]:
    """Return the digests of what labels and rules are computed with, and of the agent."""
    code = {name: Path(str(one.__file__)) for name, one in FROZEN.items()}
    found = current_digests(code, GLIDERS, {"flight": "flight_decider", "glider": "glider_decider"})
    return found | {"code": found["code"] | {"libigc": version("libigc")}}


def tables(result: GliderComparison) -> list[Table]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the
    simulated flights.
    """
    return [
        *(_glider_table(result, group, level) for group in result.groups for level in LEVELS),
        _gap_table(result),
    ]


def _glider_table(result: GliderComparison, group: str, level: float) -> Table:
    rows = result.groups[group]
    lines = []
    hours = sum(float(result.labels[k].weights.sum()) for k in rows) / 3600.0
    for name, scores in result.scores[level].items():
        cells = [figure_cell(scores.some(rows), metric) for metric in METRICS]
        cells.append(less_cell(less_first(result.scores[level], name, rows)))
        lines.append(
            (
                escape(glider_rule(name).title),
                *cells,
                f"{100.0 * value(result.simulated[level][name]):.1f}",
            )
        )
    heads = ("decider", *(metric.head for metric in METRICS), "less\nfirst", "simul.\n%")
    title = (
        f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g} false an hour"
    )
    return filled_table(title, heads, lines, NOTES if level == LEVELS[-1] else "")


def _gap_table(result: GliderComparison) -> Table:
    """Return the table of percentiles, of logs and of simulated flights."""
    lines = [
        (name, *(f"{one:.2f}" for side in sides for one in side))
        for name, sides in result.gap.items()
    ]
    heads = ("", *(f"{source}\n{share:g} %" for source in ("logs", "simul.") for share in SHARES))
    return filled_table("Open logs and simulated flights: percentiles", heads, lines)


def files(result: GliderComparison) -> dict[str, Any]:
    """Return gliders.json, with the settings, the figures of every flight and the seal, and
    gliders.png.
    """
    groups: dict[str, Any] = {}
    for group, rows in result.groups.items():
        for level, by_name in result.scores.items():
            for name, scores in by_name.items():
                groups.setdefault(group, {}).setdefault(f"{level:g}", {})[name] = _estimates(
                    scores.some(rows)
                ) | {
                    "agreement_less_first": less_first(by_name, name, rows),
                    "settings": result.chosen[level][name],
                    "simulated": _estimates(result.simulated[level][name]),
                }
    flights = [
        {
            "id": flight.identity,
            "half": flight.tier.name,
            "hours": flight.hours,
            "scored_hours": float(labels.weights.sum()) / 3600.0,
            "circles": sum(mode != 0 for *_, mode in labels.pieces),
            "deciders": {
                name: {
                    one.name: finite(scores.some([k]).curve(one.statistic)[0]) for one in METRICS
                }
                for name, scores in result.scores[LEVELS[1]].items()
            },
        }
        for k, (flight, labels) in enumerate(zip(result.flights, result.labels, strict=True))
    ]
    gap = {"percentiles": SHARES, **result.gap}
    content = {
        "groups": groups,
        "flights": flights,
        "gap": gap,
        "seal": result.seal,
    }
    return {"gliders.json": content, "gliders.png": _picture(result)}


def _estimates(scores: Scores) -> dict[str, Any]:
    return {one.name: scores.estimate(one.statistic) for one in METRICS}


def _picture(result: GliderComparison) -> Figure:
    """The ten minutes with most changes of the flight with the median agreement of the first
    rule.
    """
    first, scores = next(iter(result.scores[LEVELS[1]].items()))
    each = [value(scores.some([k])) for k in range(len(result.flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = result.flights[k], result.labels[k]
    ends = np.searchsorted(flight.times, flight.times + SHOWN_TIME)
    changes = np.cumsum(np.diff(labels.modes, prepend=labels.modes[0]) != 0)
    first_row = int((changes[ends - 1] - changes).argmax())
    rows = slice(first_row, ends[first_row])
    shown = np.where(labels.scored, labels.modes, len(MODE_NAMES))[rows]
    minutes = (flight.times[rows] - flight.times[first_row]) / 60.0
    stated = {glider_rule(name).title: one[k][rows] for name, one in result.stated.items()}
    title = (
        f"{flight.identity}: {glider_rule(first).title} agrees {each[k]:.1%} of the whole flight"
    )
    kilometres = flight.positions[rows] / 1000.0
    return recording_figure(
        kilometres,
        minutes,
        [(0, len(minutes))],
        shown,
        stated,
        MODE_NAMES,
        title,
    )
