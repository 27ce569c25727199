"""Rules on flights of gliders at equal false changes: settings selected on one half, scored on the other."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from agents.evaluation.flights import AGENT
from agents.evaluation.gliders import (
    FALSE,
    Setting,
    all_settings,
    glider_rule,
    glider_statements,
    read_gliders,
    score_settings,
)  # fmt: skip
from agents.evaluation.registry import SHIPPED, policy_folder
from agents.studies.gliders_gap import percentiles, samples
from agents.studies.seal import differing, digests
from baselines.recordings.flights import circling, gliders
from baselines.recordings.flights import labels as label_rules
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.gliders import HALVES, SEALED, half_of, read_logs
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import STATISTICS, score_flights
from baselines.recordings.flights.simulated_gliders import label_gliders, simulate_glider
from baselines.recordings.reading import igc
from baselines.rules import circling as rules_of_circling
from baselines.rules.decider import GLIDERS, rules
from baselines.scoring.scores import Scores
from hybrid_env.checks import IntArray, reject

LEVELS = (2.0, 5.0, 8.0)
"""False changes an hour at which rules are compared."""

REFERENCE = "imm"
SIMULATED, SIMULATED_TIME, SIMULATED_SEED = 60, 3600.0, 20260601  # flights, of seconds, for comparison
SEAL = Path(__file__).with_name("sealed.json")
"""Digests of code and weights, and the settings, which are fixed before the sealed logs are opened."""

FROZEN = {
    "labels": circling, "smoothed turns": label_rules, "logs": gliders, "format": igc,
    "rules": rules_of_circling,
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class GliderComparison:
    """Results.

    Attributes:
        flights, labels: of each log.
        scores: by level and name of the rule; each flight has the setting that was selected without its half.
        chosen: settings by level, name and half that they are scored on, or `SEALED`: selected on all halves.
        stated: statements (n,) of the rules on each flight at the middle level.
        simulated: scores on simulated flights, with the settings that were selected on all halves.
        gap: percentiles of the open flights and of the simulated ones, by quantity.
    """

    flights: list[Flight]
    labels: list[Labels]
    scores: dict[float, dict[str, Scores]]
    chosen: dict[float, dict[str, dict[str, Setting]]]
    stated: dict[str, list[IntArray]]
    simulated: dict[float, dict[str, Scores]]
    gap: dict[str, tuple[list[float], list[float]]]

    @property
    def groups(self) -> dict[str, list[int]]:
        """Indices of the open flights, and of the sealed ones."""
        sealed = np.array([flight.tier.name == SEALED for flight in self.flights])
        groups = {"both halves": np.flatnonzero(~sealed).tolist(), SEALED: np.flatnonzero(sealed).tolist()}
        return {name: rows for name, rows in groups.items() if rows}

    @property
    def seal(self) -> dict[str, Any]:
        """What `SEAL` holds once these settings are to be fixed."""
        return current_seal() | {
            "settings": {
                f"{level:g}": {name: one[SEALED] for name, one in by_name.items()}
                for level, by_name in self.chosen.items()
            }
        }


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
        note: called with what is done, `steps` times.
        sealed: open the sealed logs too, with the settings of the seal.

    Raises:
        ArgumentError: there are no logs, a name is unknown, or the seal is broken.
    """
    frozen = unbroken_seal(names)["settings"] if sealed else {}
    every = {name: all_settings(name) for name in names}
    note("reading")
    contents = read_logs(source)
    flights: list[Flight] = []
    labels: list[Labels] = []
    for half in (*HALVES, SEALED) if sealed else HALVES:
        some = [content for name, content in contents.items() if half_of(name) == half]
        if not some:
            raise reject("source", str(source), f"{gliders.EXPECTED}: it has no log of half {half}")
        note(f"labels: {half}")
        found = read_gliders(some, half)
        flights, labels = flights + found[0], labels + found[1]
    of = np.array([flight.tier.name for flight in flights])
    note("simulated flights")
    generator = np.random.default_rng(SIMULATED_SEED)
    copies = [simulate_glider(SIMULATED_TIME, generator) for _ in range(SIMULATED)]
    copied, rows = label_gliders(copies), np.flatnonzero(of != SEALED)
    real, made = samples([flights[k] for k in rows], [labels[k] for k in rows]), samples(copies, copied)
    known = [name for name, values in real.items() if values.size and made[name].size]
    gap = {name: (percentiles(real[name]), percentiles(made[name])) for name in known}
    result = GliderComparison(
        flights, labels, {k: {} for k in LEVELS}, {k: {} for k in LEVELS}, {}, {k: {} for k in LEVELS}, gap
    )
    for name, settings in every.items():
        note(glider_rule(name).title)
        told = glider_statements(flights, settings)
        swept = score_settings(flights, labels, told)
        for level in LEVELS:
            best = {
                half: select(swept.some(np.flatnonzero((of != half) & (of != SEALED)).tolist()), level)
                for half in (*HALVES, SEALED)
            }
            if sealed:
                _, model, numbers = frozen[f"{level:g}"][name]
                best[SEALED] = settings.index(Setting(name, model, tuple(numbers)))
            chosen = [best[half] for half in of]
            values = swept.values[np.arange(len(of)), :, chosen][..., None]
            result.scores[level][name] = Scores(swept.name, "", (0.0,), swept.columns, values)
            result.chosen[level][name] = {half: settings[k] for half, k in best.items()}
            if level == LEVELS[1]:
                result.stated[name] = [told[settings[k]][row] for row, k in enumerate(chosen)]
        usual = dict.fromkeys(one[name][SEALED] for one in result.chosen.values())
        told = glider_statements(copies, list(usual))
        for level in LEVELS:
            stated = told[result.chosen[level][name][SEALED]]
            result.simulated[level][name] = score_flights(swept.name, copies, copied, stated)
    return result


def steps(names: Sequence[str], sealed: bool) -> int:
    """Return the number of calls of `note` by `compare_on_gliders`."""
    return 2 + len(HALVES) + len(names) + sealed


def default_names() -> tuple[str, ...]:
    """Return the names of all rules, the reference first, and of the agent."""
    return tuple(dict.fromkeys((REFERENCE, *rules(GLIDERS), AGENT)))


def current_seal() -> dict[str, Any]:
    """Return the digests of what labels and rules are computed with, and of the agent."""
    weights, files = policy_folder(SHIPPED, GLIDERS), {name: Path(str(one.__file__)) for name, one in FROZEN.items()}
    files |= {name: weights.parent / f"{name}_decider.py" for name in ("flight", "glider")}  # importing loads PyTorch
    shipped = digests({file.name: file for file in sorted(weights.glob("policy.*"))})
    return {"code": digests(files) | {"libigc": version("libigc")}, "weights": shipped}


def unbroken_seal(names: Sequence[str]) -> dict[str, Any]:
    """Return the seal.

    Raises:
        ArgumentError: code or weights are not those of the seal, or it has no settings of a rule.
    """
    kept: dict[str, Any] = json.loads(SEAL.read_text(encoding="utf-8"))
    differ = differing(kept, current_seal())
    differ += [name for name in names if any(name not in one for one in kept["settings"].values())]
    if differ:
        allowed = f"no value: {', '.join(differ)} differ from {SEAL.name}, and the sealed logs stay closed"
        raise reject("sealed", True, allowed)
    return kept
