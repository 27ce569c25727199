"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on the other."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from agents.evaluation.gliders import (
    FALSE,
    Setting,
    all_settings,
    glider_rule,
    glider_statements,
    read_gliders,
    score_settings,
)  # fmt: skip
from baselines.recordings.flights import circling, gliders
from baselines.recordings.flights import labels as label_rules
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.gliders import SEALED, half_of, read_logs
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import STATISTICS
from baselines.recordings.reading import igc
from baselines.rules.decider import GLIDERS, rules
from baselines.scoring.scores import Scores
from hybrid_env.checks import ArgumentError, IntArray, reject

LEVELS = (2.0, 5.0, 8.0)
"""False changes an hour at which rules are compared."""

REFERENCE = "imm"
SEAL = Path(__file__).with_name("sealed.json")
"""Digests of the code of the labels and of weights, and the settings, before the sealed logs are opened."""


@dataclass(frozen=True, eq=False)
class GliderComparison:
    """Results.

    Attributes:
        flights, labels: of each log.
        scores: by level and name of the rule; each flight has the setting that was selected without its half.
        chosen: settings by level, name and half that they are scored on, or `SEALED`: selected on all halves.
        stated: statements (n,) of the rules on each flight at the middle level.
        seal: what is frozen, see `SEAL`.
    """

    flights: list[Flight]
    labels: list[Labels]
    scores: dict[float, dict[str, Scores]]
    chosen: dict[float, dict[str, dict[str, Setting]]]
    stated: dict[str, list[IntArray]]
    seal: dict[str, Any]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the open flights, and of the sealed ones."""
        sealed = [flight.tier.name == SEALED for flight in self.flights]
        groups = {"both halves": np.flatnonzero(~np.array(sealed)), SEALED: np.flatnonzero(sealed)}
        return {name: rows.tolist() for name, rows in groups.items() if rows.size}


def select(scores: Scores, level: float) -> int:
    """Return the setting with the best agreement among those with few enough false changes an hour."""
    false, agreement = scores.curve(FALSE), scores.curve(STATISTICS["agreement"])
    allowed = false <= max(level, float(false.min()))
    return int(np.where(allowed, agreement, -1.0).argmax())


def compare_on_gliders(
    source: Path, names: Sequence[str], note: Callable[[str], None], sealed: bool = False
) -> GliderComparison:
    """Compare rules on flights of gliders.

    Args:
        source: archive or folder.
        names: of the rules; the first is the reference.
        note: called with what is done.
        sealed: open the sealed logs too, if the seal is unbroken.

    Raises:
        ArgumentError: there are no logs, or the seal is broken.
    """
    for name in names:
        glider_rule(name)
    if sealed:
        check_seal(current_seal({}), ("code", "weights"))
    note("reading")
    contents = read_logs(source)
    flights: list[Flight] = []
    labels: list[Labels] = []
    for half in gliders.HALVES:
        some = [content for name, content in contents.items() if half_of(name) == half]
        if not some:
            raise reject("source", str(source), f"logs of half {half}: {gliders.EXPECTED}")
        note(f"labels of half {half}")
        found = read_gliders(some, half)
        flights, labels = flights + found[0], labels + found[1]
    halves = np.array([flight.tier.name for flight in flights])
    chosen: dict[float, dict[str, dict[str, Setting]]] = {level: {} for level in LEVELS}
    scores: dict[float, dict[str, Scores]] = {level: {} for level in LEVELS}
    stated: dict[str, list[IntArray]] = {}
    for name in names:
        note(glider_rule(name).title)
        settings = all_settings(name)
        told = glider_statements(flights, settings)
        swept = score_settings(flights, labels, told)
        for level in LEVELS:
            best = {
                half: select(swept.some(np.flatnonzero(halves != half).tolist()), level)
                for half in gliders.HALVES
            }
            of_flights = [best[half] for half in halves]
            values = swept.values[np.arange(len(halves)), :, of_flights][..., None]
            scores[level][name] = Scores(swept.name, "", (0.0,), swept.columns, values)
            best[SEALED] = select(swept, level)
            chosen[level][name] = {half: settings[k] for half, k in best.items()}
            if level == LEVELS[1]:
                stated[name] = [told[settings[k]][row] for row, k in enumerate(of_flights)]
    seal = current_seal(
        {f"{level:g}": {n: _plain(one[SEALED]) for n, one in of.items()} for level, of in chosen.items()}
    )
    result = GliderComparison(flights, labels, scores, chosen, stated, seal)
    if not sealed:
        return result
    check_seal(seal, ("settings",))
    note("sealed logs")
    return with_sealed(result, [one for name, one in contents.items() if half_of(name) == SEALED])


def with_sealed(result: GliderComparison, contents: Sequence[bytes]) -> GliderComparison:
    """Return results with those on the sealed logs, at the settings that were selected on all others."""
    flights, labels = read_gliders(contents, SEALED)
    scores: dict[float, dict[str, Scores]] = {level: {} for level in LEVELS}
    stated = {}
    for level, names in result.chosen.items():
        for name, settings in names.items():
            told = glider_statements(flights, [settings[SEALED]])
            before = result.scores[level][name]
            values = np.concatenate([before.values, score_settings(flights, labels, told).values])
            scores[level][name] = Scores(before.name, "", (0.0,), before.columns, values)
            if level == LEVELS[1]:
                stated[name] = result.stated[name] + told[settings[SEALED]]
    return GliderComparison(
        result.flights + flights, result.labels + labels, scores, result.chosen, stated, result.seal
    )


def steps(names: Sequence[str], sealed: bool) -> int:
    """Return the number of calls of `note` by `compare_on_gliders`."""
    return 1 + len(gliders.HALVES) + len(names) + sealed


def current_seal(settings: dict[str, Any]) -> dict[str, Any]:
    """Return the digests of the code of the labels, and settings; there are no weights yet."""
    files = [Path(str(module.__file__)) for module in (circling, gliders, label_rules, igc)]
    code = {path.name: sha256(path.read_bytes()).hexdigest() for path in files}
    return {"code": code | {"libigc": version("libigc")}, "weights": {}, "settings": settings}


def check_seal(found: dict[str, Any], parts: Sequence[str]) -> None:
    """Raise `ArgumentError` if parts of a seal are not those of `SEAL`."""
    kept = json.loads(SEAL.read_text())
    for part in parts:
        differ = [
            name for name in {**kept[part], **found[part]} if kept[part].get(name) != found[part].get(name)
        ]
        if differ:
            raise ArgumentError(
                f"sealed=True is not allowed: {part} {', '.join(differ)} differ from {SEAL.name}; "
                "the sealed logs stay closed"
            )


def _plain(setting: Setting) -> list[float]:
    return [setting.model, *setting.numbers]


def default_names() -> tuple[str, ...]:
    """Return the names of all rules, the reference first."""
    return tuple(dict.fromkeys((REFERENCE, *rules(GLIDERS))))
