"""Process noise by the evidence: banks that are told different ones, of which the likeliest is
read.

The likelihood of a measurement in a bank follows from its rows, as that of multiple models (Magill
1965). The logarithms are summed with an exponential memory, so that the choice follows an object
that drives at constant speed and then brakes.
"""

import numpy as np

from baselines.rules.decider import Observations
from hybrid_env.checks import FloatArray
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

FACTORS = tuple(10.0 ** (0.5 * k) for k in range(-2, 5))
"""Process noise of the banks, as factors of the nominal one."""


class LikeliestNoise:
    """Chooses among the rows of banks that differ in their process noise alone.

    Args:
        options: of a bank.
    """

    def __init__(self, options: QuickestOptions):
        self.layout = QuickestLayout(options.hypotheses)
        self.transitions = options.transition_matrix
        self.last: FloatArray | None = None
        self.evidence: FloatArray = np.zeros(1)

    def choose(self, rows: Observations) -> Observations:
        """Return the rows (N, width) of the likeliest bank of each track at the next tick of K
        banks, (K, N, width).
        """
        probabilities = np.exp(self.layout.read(rows, "log_probability"))
        prior = probabilities if self.last is None else self.last @ self.transitions
        self.last = probabilities
        squares = sum(
            self.layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across")
        )
        logs = -0.5 * squares - self.layout.read(rows, "log_variance")
        largest = logs.max(-1, keepdims=True)
        likelihood = np.log((prior * np.exp(logs - largest)).sum(-1)) + largest[..., 0]
        # Ticks of the exponential memory.
        self.evidence = (1.0 - 1.0 / 50.0) * self.evidence + likelihood
        return rows[self.evidence.argmax(0), np.arange(rows.shape[1])]
