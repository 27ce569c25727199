"""The agent for flights of gliders, trained on simulated ones."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from agents.algorithms.flights import Flights, FlightSettings, Simulated
from agents.learned.glider_decider import GliderAgent
from baselines.recordings.flights.simulated_gliders import (
    RANGES,
    STEP,
    label_gliders,
    simulate_glider,
)


@dataclass(frozen=True, kw_only=True)
class GliderSettings(FlightSettings):
    """Those of the agent for gliders, with one number of flights of a round."""

    groups = ("gliders",)


class Gliders(Flights):
    """A training run on simulated flights of gliders, with the labels of both rules of
    `label_gliders`.
    """

    name = "gliders"
    Settings = GliderSettings
    decider = GliderAgent
    next_command = (
        "hybridtrack compare --gliders --source igc-xc-score-1.8.0.tgz --deciders imm-climb"
    )
    early = 4.0
    simulation: ClassVar[dict[str, Any]] = dict(RANGES)
    curve_flights = (40,)

    def draw(self, counts: tuple[int, ...], generator: np.random.Generator) -> Simulated:
        """See `Flights.draw`; each flight has settings of its own."""
        flights = [
            simulate_glider(STEP * self.settings.rows, generator) for _ in range(sum(counts))
        ]
        return flights, label_gliders(flights), [STEP] * len(flights)
