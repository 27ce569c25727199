"""Training of the agent for gliders on simulated flights."""

from typing import Any, ClassVar

import numpy as np

from agents.learned.glider_decider import GliderAgent
from agents.training.learning_curve import LearningCurve
from agents.training.simulated_flights import FlightRun, Simulated, flight_curve
from baselines.recordings.flights.simulated_gliders import RANGES, STEP, label_gliders, simulate_glider

CURVE_FLIGHTS = (40,)


class GliderRun(FlightRun):
    """A training run on simulated flights of gliders; see `StatementRun`. Labels are those of both rules."""

    decider_class = GliderAgent
    next_command = "hybridtrack compare --gliders --source igc-xc-score-1.8.0.tgz --deciders imm-climb"
    early = 4.0
    simulation: ClassVar[dict[str, Any]] = dict(RANGES)

    def make_curve(self) -> LearningCurve:
        """See `Run.make_curve`."""
        return flight_curve(self, CURVE_FLIGHTS)

    def draw(self, counts: tuple[int, ...], generator: np.random.Generator) -> Simulated:
        """See `FlightRun.draw`; each flight has settings of its own."""
        flights = [simulate_glider(STEP * self.settings.rows, generator) for _ in range(sum(counts))]
        return flights, label_gliders(flights), [STEP] * len(flights)
