"""The two forms in which deciders see a recorded flight, and the deciders of each.

Native: the positions as they were reported, with filters for turn rates. Semi-real: their smoothed path with
white noise, in the setting of `HybridTrackQuickest-v0`, with the deciders of that environment.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.deciders import split_threshold
from agents.evaluation.statement_deciders import RULES, shipped_agents, statement_decider
from agents.learned.flight_decider import FlightAgent, load_flight_agent, shipped_flight_decider
from baselines.estimation.turn_imm import run_turn_imm
from baselines.recordings.flights.batch import stack_flights
from baselines.recordings.flights.flight import Flight
from baselines.recordings.flights.labels import Labels
from baselines.recordings.flights.metrics import unstack
from baselines.recordings.flights.semi_real import WORLD, semi_real_flights, state_semi_real
from baselines.rules.flight_rules import Beam, Cusum, FlightDecider, Threshold
from hybrid_env.checks import reject

IntArray = NDArray[np.int64]

DECIDERS: dict[str, tuple[str, str, Callable[..., FlightDecider]]] = {
    "imm": ("IMM threshold", "IMM threshold {:g}", Threshold),
    "cusum": ("CUSUM", "CUSUM {:g}", Cusum),
    "beam": ("beam", "beam {:g}", Beam),
    "agent": ("agent", "agent, margin {:g}", shipped_flight_decider),
}
"""Names in figures without and with a threshold, and constructor, of the native deciders."""


class Form(Protocol):
    """How deciders see flights.

    Attributes:
        deciders: names of the deciders that are compared by default.
    """

    deciders: tuple[str, ...]

    def label(self, name: str) -> str:
        """Return the name of a decider in figures.

        Raises:
            ArgumentError: there is no such decider.
        """

    def convert(
        self, flights: Sequence[Flight], labels: Sequence[Labels], seed: int
    ) -> tuple[list[Flight], list[Labels]]:
        """Return flights and labels in this form; the seed is that of the noise."""

    def run(self, flights: Sequence[Flight]) -> Callable[[str], list[IntArray]]:
        """Return a function from the name of a decider to its statements on each flight, (n,)."""


class Native:
    """See `Form`. A decider is a name of `DECIDERS` or the folder of an agent, with an optional threshold."""

    deciders: tuple[str, ...] = ("imm", "imm:0.8", "cusum", "beam", "agent:8", "agent")

    def label(self, name: str) -> str:
        """See `Form`."""
        base, threshold = split_threshold(name)
        if base not in DECIDERS and not Path(base).is_dir():
            raise reject("deciders", name, f"{', '.join(DECIDERS)} with --flights, or a folder")
        self._decider(name)
        if base not in DECIDERS:
            return name
        plain, with_threshold, _ = DECIDERS[base]
        return plain if threshold is None else with_threshold.format(threshold)

    @staticmethod
    def _decider(name: str) -> FlightDecider:
        base, threshold = split_threshold(name)
        if base not in DECIDERS:
            return FlightAgent(load_flight_agent(Path(base)), threshold or 0.0)
        return DECIDERS[base][2](*() if threshold is None else (threshold,))

    def convert(
        self, flights: Sequence[Flight], labels: Sequence[Labels], seed: int
    ) -> tuple[list[Flight], list[Labels]]:
        """See `Form`."""
        return list(flights), list(labels)

    def run(self, flights: Sequence[Flight]) -> Callable[[str], list[IntArray]]:
        """See `Form`."""
        batch = stack_flights(flights)
        estimates = run_turn_imm(batch)
        lengths = [len(flight.times) for flight in flights]
        return lambda name: unstack(batch, self._decider(name).state_modes(batch, estimates), lengths)


class SemiReal:
    """See `Form`. A decider is a name of `statement_decider`, with an optional threshold."""

    deciders = (*RULES, *shipped_agents())

    def label(self, name: str) -> str:
        """See `Form`."""
        family, threshold, _ = statement_decider(name, WORLD)
        return family.name if split_threshold(name)[1] is None else f"{family.name} {threshold:g}"

    def convert(
        self, flights: Sequence[Flight], labels: Sequence[Labels], seed: int
    ) -> tuple[list[Flight], list[Labels]]:
        """See `Form`."""
        return semi_real_flights(flights, labels, np.random.default_rng(seed))

    def run(self, flights: Sequence[Flight]) -> Callable[[str], list[IntArray]]:
        """See `Form`."""
        return lambda name: state_semi_real(statement_decider(name, WORLD)[2], flights)


FORMS: dict[str, Form] = {"native": Native(), "semi-real": SemiReal()}
