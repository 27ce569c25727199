"""Rules that state the mode of a flight at every position from the output of the filters, each at
several settings at once.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.flights.turn_beam import run_turn_beam
from studies.flights.turns import STRAIGHT, Batch, IntArray, TurnEstimates, TurnModel

Settings = Sequence[tuple[float, ...]]


def by_probability(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State by thresholds on the probabilities of the modes: to a turn, and to straight flight."""
    enter, leave = np.log(settings).T
    stated = begun(batch, settings)
    for tick, logs in enumerate(np.log(np.maximum(estimates.probabilities, 1e-300))):
        best = logs.argmax(-1)[:, None]
        changes = logs.max(-1)[:, None] >= np.where(best == STRAIGHT, leave, enter)
        stated[tick] = np.where(changes, best, stated[tick - 1])
    return stated


def by_cusum(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State by the cumulative sums of the log-likelihood ratios to the stated mode, which change
    the statement at a threshold and begin anew. Page 1954, "Continuous inspection schemes".
    """
    (threshold,) = np.array(settings).T
    stated = begun(batch, settings)
    sums = np.zeros((*stated.shape[1:], 3))
    likelihoods = estimates.log_likelihoods
    ratios = np.maximum(likelihoods - likelihoods.max(-1, keepdims=True), -30.0)
    for tick, ratio in enumerate(ratios):
        last = stated[tick - 1]
        sums = np.maximum(
            sums + ratio[:, None] - np.take_along_axis(ratio, last, 1)[..., None], 0.0
        )
        changes = sums.max(-1) >= threshold
        stated[tick] = np.where(changes, sums.argmax(-1), last)
        sums[changes] = 0.0
    return stated


def begun(batch: Batch, settings: Settings) -> IntArray:
    """Return statements (T, B, K) of straight flight; the last row is that before the first one."""
    return np.full((*batch.times.shape, len(settings)), STRAIGHT, "int8")


@dataclass(frozen=True, kw_only=True)
class TurnRule:
    """A rule on flights."""

    # From K settings to statements (T, B, K), at first straight flight.
    state: Callable[[Batch, TurnEstimates, Settings], IntArray] = by_probability
    # Settings to select from, the first by default.
    grid: Settings = ((0.6, 0.6),)
    # Settings of the filters to select from.
    models: tuple[TurnModel, ...] = (TurnModel(),)
    # Settings of `run_turn_beam`, whose probabilities it reads; None for the IMM.
    beam: Mapping[str, Any] | None = None

    def statements(
        self, batch: Batch, estimates: TurnEstimates, settings: Settings, model: TurnModel
    ) -> IntArray:
        """Return the statements (T, B, K) at K settings, with the output of the IMM for a model."""
        if self.beam is not None:
            beam = run_turn_beam(batch, model, **self.beam)
            estimates = estimates._replace(probabilities=beam)
        return self.state(batch, estimates, settings)


RULES = {
    "imm": TurnRule(),
    "cusum": TurnRule(state=by_cusum, grid=((3.5,),)),
    "beam": TurnRule(beam={}),
}
