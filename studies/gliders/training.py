"""Training of the agent for flights of gliders, on simulated ones: `hybridtrack train --recipe
studies/gliders/gliders.yml`.
"""

import numpy as np

from studies.flights.training import Flights, Simulated
from studies.gliders.agent import GliderAgent
from studies.gliders.simulated import STEP, label_gliders, simulate_glider


class Gliders(Flights):
    """A training run on simulated flights of gliders, with the labels of both rules of
    `label_gliders`.
    """

    decider = GliderAgent
    next_command = "python -m studies.gliders --source igc-xc-score-1.8.0.tgz imm-climb"
    early = 4.0
    curve_flights = (40,)

    def draw(self, counts: tuple[int, ...], generator: np.random.Generator) -> Simulated:
        """See `Flights.draw`; each flight has settings of its own."""
        duration = STEP * self.settings.rows
        flights = [simulate_glider(duration, generator) for _ in range(sum(counts))]
        return flights, label_gliders(flights), [STEP] * len(flights)
