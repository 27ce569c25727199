"""Training of the agent for flights of gliders, on simulated ones: `hybridtrack train --recipe
studies/gliders/gliders.yml`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from studies.flights.training import Flights, FlightSettings, Simulated
from studies.gliders.agent import GliderAgent
from studies.gliders.simulated import RANGES, STEP, label_gliders, simulate_glider


@dataclass(frozen=True, kw_only=True)
class GliderSettings(FlightSettings):
    """Those of the agent for gliders, with one number of flights of a round."""

    groups = ("gliders",)


class Gliders(Flights):
    """A training run on simulated flights of gliders, with the labels of both rules of
    `label_gliders`.
    """

    Settings = GliderSettings
    decider = GliderAgent
    next_command = "python -m studies.gliders --source igc-xc-score-1.8.0.tgz --deciders imm-climb"
    early = 4.0
    simulation: ClassVar[dict[str, Any]] = dict(RANGES)
    curve_flights = (40,)

    def draw(self, counts: tuple[int, ...], generator: np.random.Generator) -> Simulated:
        """See `Flights.draw`; each flight has settings of its own."""
        duration = STEP * self.settings.rows
        flights = [simulate_glider(duration, generator) for _ in range(sum(counts))]
        return flights, label_gliders(flights), [STEP] * len(flights)
