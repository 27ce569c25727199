"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on
the other.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines import Scores, parse_igc
from hybrid_env import ArgumentError
from studies.flights.figure import flight_figure
from studies.flights.flight import Flight, stack_flights
from studies.flights.labels import MODE_NAMES, Labels
from studies.flights.metrics import STATISTICS, score_flights
from studies.flights.study import cell, estimates, figure, less_first, value
from studies.flights.tracks import FlightTracks
from studies.flights.turn_beam import TurnHistories, run_turn_beam
from studies.flights.turns import STRAIGHT, FloatArray, IntArray, TurnModel, run_turn_imm
from studies.gliders.agent import GliderAgent
from studies.gliders.circling import air_motion, decode, label_glider
from studies.gliders.logs import EXPECTED, HALVES, SEALED, glider_flight, half_of, read_logs
from studies.gliders.rules import RULES, GliderImm
from studies.gliders.simulated import label_gliders, simulate_glider

# False changes an hour at which rules are compared.
LEVELS = (2.0, 5.0, 8.0)
AGENT = "agent"
HERE = Path(__file__).parent
FLIGHTS = HERE.parent / "flights"
SHIPPED = HERE / "shipped"
SEAL = HERE / "sealed.json"
"""Digests of code and weights, and the settings, which were fixed before the sealed logs were
opened.
"""
FROZEN = {
    "labels": HERE / "circling.py",
    "smoothed turns": FLIGHTS / "labels.py",
    "filters": FLIGHTS / "turns.py",
    "logs": HERE / "logs.py",
    "rules": HERE / "rules.py",
    "flight": FLIGHTS / "agent.py",
    "glider": HERE / "agent.py",
}
"""Files whose digests the seal holds."""

# Positions that are filtered at once.
PART, MARGIN = 1200, 240
# Flights, of seconds, for comparison.
SIMULATED, SIMULATED_TIME, SIMULATED_SEED = 60, 3600.0, 20260601
# Of the quick form.
QUICK, QUICK_TIME, QUICK_SEED = 4, 900.0, 20260602
# Percentiles of what recorded and simulated flights have in common.
SHARES = (5.0, 50.0, 95.0)
# Turn rate [rad/s] and angle [deg].
SLOWEST_WIGGLE, SMALLEST_WIGGLE = np.radians(1.0), 10.0
# Positions of circles that are left out at either end.
INNER = 3
# Time in the picture [s].
SHOWN_TIME = 600.0


class Candidate(NamedTuple):
    """A rule or an agent, of which settings are selected."""

    title: str
    # Settings of the filters to select from.
    models: tuple[TurnModel, ...]
    # Of the beam; None for the IMM.
    histories: TurnHistories | None
    # Settings to select from.
    grid: tuple[tuple[float, ...], ...]
    # From settings to an object with `statements`.
    make: Callable[..., Any]


class Setting(NamedTuple):
    """A rule at one of its settings."""

    # Of the rule.
    name: str
    # Index of the settings of its filters.
    model: int
    # Of the rule.
    numbers: tuple[float, ...]


Half = tuple[list[Flight], list[Labels]]


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
    stated: dict[str, list[NDArray[Any]]]
    # Scores on simulated flights, with the settings that were selected on all halves.
    simulated: dict[float, dict[str, Scores]]
    # Percentiles of the open flights and of the simulated ones, by quantity.
    gap: dict[str, tuple[list[float], ...]]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the open flights, and of the sealed ones."""
        groups: dict[str, list[int]] = {}
        for k, flight in enumerate(self.flights):
            name = SEALED if flight.tier.name == SEALED else "both halves"
            groups.setdefault(name, []).append(k)
        return groups


def candidate(name: str) -> Candidate:
    """Return a rule, the shipped agent, or the agent of a folder.

    Raises:
        ArgumentError: there is none of this name.
    """
    if name in RULES:
        rule = RULES[name]
        return Candidate(rule.title, rule.models, rule.histories, rule.grid, rule)
    folder = SHIPPED if name == AGENT else Path(name)
    if not folder.is_dir():
        expected = ", ".join((*RULES, AGENT))
        raise ArgumentError(f"deciders={name!r}: expected {expected}, or the folder of an agent")
    agent = GliderAgent.read(folder)
    return Candidate(name, (GliderAgent.model,), None, GliderAgent.grid, agent)


def all_settings(name: str) -> list[Setting]:
    """Return the settings of a rule to select from."""
    rule = candidate(name)
    return [Setting(name, k, numbers) for k in range(len(rule.models)) for numbers in rule.grid]


def glider_statements(
    flights: Sequence[Flight],
    settings: Sequence[Setting],
) -> dict[Setting, list[NDArray[Any]]]:
    """Return the statements of rules at settings on each flight, (n,); 0 outside of its pieces."""
    batch = stack_flights(flights, PART, MARGIN)
    lengths = [len(flight.times) for flight in flights]
    stated: dict[Setting, list[NDArray[Any]]] = {}
    for name, k in dict.fromkeys((setting.name, setting.model) for setting in settings):
        some = [setting for setting in settings if (setting.name, setting.model) == (name, k)]
        rule = candidate(name)
        model = rule.models[k]
        beam = None if rule.histories is None else run_turn_beam(batch, model, rule.histories)
        tracks = FlightTracks(batch, run_turn_imm(batch, model), beam)
        modes = rule.make(*(setting.numbers for setting in some)).statements(tracks)
        for column, setting in enumerate(some):
            stated[setting] = batch.unstack(modes[..., column], lengths)
    return stated


def score_settings(
    flights: Sequence[Flight],
    labels: Sequence[Labels],
    stated: Mapping[Setting, Sequence[NDArray[Any]]],
) -> Scores:
    """Return the scores of statements, whose thresholds are the indices of the settings."""
    title = candidate(next(iter(stated)).name).title
    each = [score_flights(title, flights, labels, modes) for modes in stated.values()]
    values = np.concatenate(
        [scores.values for scores in each],
        axis=-1,
    )
    return Scores(title, "setting", tuple(map(float, range(len(each)))), each[0].columns, values)


def select(scores: Scores, level: float) -> int:
    """Return the setting with the best agreement among those with few enough false changes an
    hour.
    """
    false = scores.curve(STATISTICS["false_per_hour"])
    agreement = scores.curve(STATISTICS["agreement"])
    allowed = false <= max(level, float(false.min()))
    return int(np.where(allowed, agreement, -1.0).argmax())


def read_halves(source: Path, sealed: bool = False) -> Half:
    """Return the flights of the open logs of a source and their labels, and of the sealed ones."""
    contents = read_logs(source)
    flights: list[Flight] = []
    labels: list[Labels] = []
    for half in (*HALVES, SEALED) if sealed else HALVES:
        names = [name for name in contents if half_of(name) == half]
        if not names:
            raise ArgumentError(
                f"source={str(source)!r}: expected {EXPECTED}: no log of half {half}"
            )
        logs = [parse_igc(name, contents[name]) for name in names]
        of_half = [glider_flight(name, half, log) for name, log in zip(names, logs, strict=True)]
        decoded = [decode(log.records) for log in logs]
        flights += of_half
        labels += map(label_glider, of_half, air_motion(of_half), decoded)
    return flights, labels


def simulated(count: int, seconds: float, seed: int) -> Half:
    """Return simulated flights and their labels."""
    generator = np.random.default_rng(seed)
    flights = [simulate_glider(seconds, generator) for _ in range(count)]
    return flights, label_gliders(flights)


def quick_halves() -> Half:
    """Return short simulated flights in the place of the logs of both halves."""
    flights, labels = simulated(QUICK, QUICK_TIME, QUICK_SEED)
    halves = [half for half in HALVES for _ in range(QUICK // len(HALVES))]
    named = [
        replace(
            flight,
            identity=f"simulated {k}",
            tier=flight.tier._replace(name=half),
        )
        for k, (flight, half) in enumerate(zip(flights, halves, strict=True))
    ]
    return named, labels


def compare_on_gliders(
    flights: list[Flight],
    labels: list[Labels],
    names: Sequence[str],
    copies: Half,
    jobs: int = 1,
    seal: Mapping[str, Any] | None = None,
) -> GliderComparison:
    """Compare rules on flights of gliders, the first being the reference.

    Args:
        flights: the flights, whose tiers are their halves.
        labels: of the flights.
        names: of the rules.
        copies: simulated flights and their labels.
        jobs: number of processes.
        seal: with settings for the sealed flights; without it they are selected on all halves.
    """
    open_rows = [k for k, flight in enumerate(flights) if flight.tier.name != SEALED]
    real = samples(
        [flights[k] for k in open_rows],
        [labels[k] for k in open_rows],
    )
    made = samples(*copies)
    gap = {
        name: tuple(np.percentile(some[name], SHARES).tolist() for some in (real, made))
        for name, values in real.items()
        if values.size and made[name].size
    }
    result = GliderComparison(flights, labels, {}, {}, {}, {}, gap)
    settings = {} if seal is None else seal["settings"]
    calls = [
        joblib.delayed(compare_rule)(
            name,
            flights,
            labels,
            copies,
            {level: of[name] for level, of in settings.items()},
        )
        for name in names
    ]
    for name, found in zip(
        names,
        joblib.Parallel(n_jobs=jobs)(calls),
        strict=True,
    ):
        result.stated[name], scores, chosen, of_copies = found
        for level in LEVELS:
            result.scores.setdefault(level, {})[name] = scores[level]
            result.chosen.setdefault(level, {})[name] = chosen[level]
            result.simulated.setdefault(level, {})[name] = of_copies[level]
    return result


def compare_rule(
    name: str,
    flights: list[Flight],
    labels: list[Labels],
    copies: Half,
    frozen: Mapping[str, Any],
) -> tuple[
    list[NDArray[Any]], dict[float, Scores], dict[float, dict[str, Setting]], dict[float, Scores]
]:
    """Return what a rule states at the middle level, and by level scores, settings and scores on
    simulated flights.

    `frozen` are settings for the sealed flights by level; without any they are selected on all
    halves.
    """
    halves = np.array([flight.tier.name for flight in flights])
    settings = all_settings(name)
    # All settings on all flights, before any is selected.
    stated = glider_statements(flights, settings)
    swept = score_settings(flights, labels, stated)
    scores = {}
    every = {}
    for level in LEVELS:
        best = {}
        for half in (*HALVES, SEALED):
            others = np.flatnonzero((halves != half) & (halves != SEALED))
            best[half] = select(swept.some(others.tolist()), level)
        if frozen:
            _, model, numbers = frozen[f"{level:g}"]
            best[SEALED] = settings.index(Setting(name, model, tuple(numbers)))
        chosen = [best[half] for half in halves]
        # Each flight has the setting that was selected without its half.
        values = swept.values[np.arange(len(halves)), :, chosen][..., None]
        scores[level] = Scores(
            swept.name,
            "",
            (0.0,),
            swept.columns,
            values,
        )
        every[level] = {half: settings[k] for half, k in best.items()}
    made = glider_statements(
        copies[0],
        list(dict.fromkeys(one[SEALED] for one in every.values())),
    )
    of_copies = {
        level: score_flights(swept.name, *copies, made[one[SEALED]]) for level, one in every.items()
    }
    middle = every[LEVELS[1]]
    return [stated[middle[half]][k] for k, half in enumerate(halves)], scores, every, of_copies


def samples(flights: Sequence[Flight], labels: Sequence[Labels]) -> dict[str, FloatArray]:
    """Return values by quantity, with its unit, where flights are scored."""
    batch = stack_flights(flights, PART, MARGIN)
    imm = run_turn_imm(batch, GliderImm.models[0])
    innovations = batch.unstack(
        imm.innovations,
        [len(flight.times) for flight in flights],
    )
    found: dict[str, list[Any]] = {}
    for flight, label, innovation in zip(flights, labels, innovations, strict=True):
        # At every position.
        straight = label.scored & (label.modes == STRAIGHT)
        circling = label.scored & (label.modes != STRAIGHT)
        rates = np.degrees(np.abs(label.rates))
        quantities = {
            "airspeed, m/s": label.speeds,
            "its change, m/s²": np.abs(np.gradient(label.speeds, label.times)),
            "climb rate, m/s": flight.climbs,
            "innovation along": np.abs(innovation[:, 0]),
            "innovation across": np.abs(innovation[:, 1]),
        }
        for quantity, values in quantities.items():
            found.setdefault(f"straight: {quantity}", []).append(values[straight])
            found.setdefault(f"circling: {quantity}", []).append(values[circling])
        found.setdefault("straight: turn rate, deg/s", []).append(rates[straight])
        found.setdefault("wiggle: angle, deg", []).append(_wiggles(label, straight))
        # Of every time of circling, and of straight flight.
        for first, end, mode in label.pieces:
            if label.scored[first:end].any():
                name = "straight" if mode == STRAIGHT else "circling"
                inner = rates[first + INNER : end - INNER]
                duration = label.times[end - 1] - label.times[first]
                found.setdefault(f"{name}: duration, s", []).append([duration])
                if mode != STRAIGHT and inner.size > INNER:
                    variation = inner.std() / inner.mean()
                    found.setdefault("circling: turn rate, deg/s", []).append([np.median(inner)])
                    found.setdefault("circling: its variation", []).append([variation])
    return {name: np.concatenate(values) for name, values in sorted(found.items())}


def _wiggles(label: Labels, straight: Any) -> FloatArray:
    """Return the angles of turns to one side in straight flight [deg]."""
    turning = np.where(
        straight & (np.abs(label.rates) > SLOWEST_WIGGLE),
        np.sign(label.rates),
        0.0,
    )
    begins = np.flatnonzero(np.diff(turning, prepend=np.nan) != 0.0)
    turned = np.degrees(np.abs(label.rates)) * label.weights * (turning != 0.0)
    angles = np.add.reduceat(turned, begins)
    return np.asarray(angles[angles > SMALLEST_WIGGLE])


def current_seal() -> dict[str, dict[str, str]]:
    """Return the digests of what labels and rules are computed with, and of the agent."""
    weights = {path.name: path for path in sorted(SHIPPED.glob("policy.*"))}
    seal = {
        part: {name: sha256(path.read_bytes()).hexdigest() for name, path in paths.items()}
        for part, paths in (
            ("code", FROZEN),
            ("weights", weights),
        )
    }
    seal["code"]["libigc"] = version("libigc")
    return seal


def unbroken_seal(names: Sequence[str]) -> dict[str, Any]:
    """Return the seal.

    Raises:
        ArgumentError: code or weights have changed, or there are no settings of one of the names.
    """
    kept: dict[str, Any] = json.loads(SEAL.read_text(encoding="utf-8"))
    now = current_seal()
    differ = [
        name for part, files in now.items() for name in files if kept[part].get(name) != files[name]
    ]
    differ += [name for name in names if name not in kept["settings"]["5"]]
    if differ:
        raise ArgumentError(
            f"sealed: {', '.join(differ)} differ from {SEAL.name}, and the sealed logs stay closed"
        )
    return kept


def tables(result: GliderComparison) -> dict[str, pd.DataFrame]:
    """Return the tables of each level, for the open logs and for the sealed ones, and of the
    simulated flights, by their titles.
    """
    found = {}
    for group, rows in result.groups.items():
        hours = sum(float(result.labels[k].weights.sum()) for k in rows) / 3600.0
        for level, of_level in result.scores.items():
            lines = []
            for name in of_level:
                scores = of_level[name].some(rows)
                lines.append(
                    {
                        "decider": candidate(name).title,
                        "false/h": figure(scores, "false_per_hour"),
                        "enter, s": figure(scores, "enter"),
                        "leave, s": figure(scores, "leave"),
                        "missed in, %": f"{100.0 * value(scores, 'misses_in'):.1f}",
                        "out, %": f"{100.0 * value(scores, 'misses_out'):.1f}",
                        "agreement": figure(scores, "agreement", 3),
                        "less first, points": cell(less_first(of_level, name, rows), 1, 100.0),
                        "simulated": f"{value(result.simulated[level][name]):.3f}",
                    }
                )
            title = f"{len(rows)} flights of gliders, {group}, {hours:.1f} h: at most {level:g}/h"
            found[title] = pd.DataFrame(lines)
    found["Percentiles of the open logs and of simulated flights"] = pd.DataFrame(
        [
            {
                "quantity": name,
                "logs": "  ".join(f"{number:.2f}" for number in logs),
                "simulated": "  ".join(f"{number:.2f}" for number in copies),
            }
            for name, (logs, copies) in result.gap.items()
        ]
    )
    return found


def as_json(result: GliderComparison) -> dict[str, Any]:
    """Return settings and figures of every group, agreement on every flight, and percentiles as
    plain values.
    """
    groups: dict[str, Any] = {}
    for group, rows in result.groups.items():
        groups[group] = {}
        for level, of_level in result.scores.items():
            groups[group][f"{level:g}"] = of_group = {}
            for name, scores in of_level.items():
                less = less_first(of_level, name, rows)
                of_group[name] = estimates(scores.some(rows)) | {
                    "agreement_less_first": None if less is None else less.as_json(),
                    "settings": result.chosen[level][name],
                    "simulated": estimates(result.simulated[level][name]),
                }
    middle = result.scores[LEVELS[1]]
    flights = {
        flight.identity: {name: value(scores.some([k])) for name, scores in middle.items()}
        for k, flight in enumerate(result.flights)
    }
    return {
        "groups": groups,
        "agreement": flights,
        "percentiles": SHARES,
        "gap": result.gap,
    }


def picture(result: GliderComparison) -> Figure:
    """The ten minutes with most changes of the flight with the median agreement of the first
    rule.
    """
    first, scores = next(iter(result.scores[LEVELS[1]].items()))
    each = [value(scores.some([k])) for k in range(len(result.flights))]
    k = int(np.argsort(each)[len(each) // 2])
    flight, labels = result.flights[k], result.labels[k]
    ends = np.searchsorted(flight.times, flight.times + SHOWN_TIME)
    # Number of changes of the label in the time that begins at each position.
    changed = np.diff(labels.modes, prepend=labels.modes[0]) != 0
    changes = np.cumsum(changed)
    first_row = int((changes[ends - 1] - changes).argmax())
    rows = slice(first_row, int(ends[first_row]))
    shown: IntArray = np.where(
        labels.scored,
        labels.modes,
        len(MODE_NAMES),
    )[rows]
    part = replace(
        flight,
        times=flight.times[rows] - flight.times[first_row],
        positions=flight.positions[rows],
    )
    stated = {candidate(name).title: modes[k][rows] for name, modes in result.stated.items()}
    title = f"{flight.identity}: {candidate(first).title} agrees {each[k]:.1%} of the whole flight"
    return flight_figure(part, shown, stated, title)
