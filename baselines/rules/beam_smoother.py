"""The posterior of the mode some ticks ago, by fixed-lag smoothing on the beam of switch histories.

Every branch of the beam also carries the probabilities of the modes at the last ticks, given that
the branch is right. A branch that continues keeps them; one that begins has the mean of its
parents, weighted by the probabilities with which they switched. Later measurements change the
weights of the branches and nothing else, so by Bayes' rule the mean over the branches is the
posterior of the mode at an earlier tick, given all measurements so far.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.rules.beam import BeamDecider, BeamState
from baselines.rules.beam_filters import FIRST
from baselines.rules.decider import UNKNOWN, Actions, Decider
from baselines.rules.measurements import run_compiled
from hybrid_env.checks import FloatArray, IntArray, check_integer, reject
from hybrid_env.core.compilation import compiled

# Ticks.
LONGEST_LAG = 10_000


class BranchTable(NamedTuple):
    """The branches of N tracks without their filters; no two of a track have the same mode, age
    and row.
    """

    # (N, B) as in `beam_filters.Branches`
    modes: IntArray
    # (N, B)
    ages: IntArray
    # (N, B)
    rows: IntArray
    # (N, B) logarithms of the probabilities of the branches.
    log_weights: FloatArray
    # (N,) number of branches.
    counts: IntArray


class SmootherState(NamedTuple):
    """State of N tracks between two calls of `BeamSmoother.predict`."""

    beam: BeamState
    # Its branches.
    table: BranchTable
    # (N, B, K + 1, M) probability of each mode 0, ..., K ticks ago, given each branch.
    past: FloatArray
    # Memory of the same shape for the next tick.
    spare: FloatArray


@compiled
def carry_past(
    before: BranchTable,
    now: BranchTable,
    past: FloatArray,
    carried: FloatArray,
    hazards: FloatArray,
    order: FloatArray,
) -> None:
    """Write the probabilities of the modes at the last ticks, `carried`, from those `past` at
    the tick before.
    """
    weights = np.empty(before.modes.shape[1])
    for track in range(now.counts.size):
        for c in range(now.counts[track]):
            mode = now.modes[track, c]
            age = now.ages[track, c]
            row = now.rows[track, c]
            target = carried[track, c]
            target[:] = 0.0
            target[0, mode] = 1.0
            if age > 1:
                for b in range(before.counts[track]):
                    same = before.modes[track, b] == mode and before.rows[track, b] == row
                    if same and before.ages[track, b] == age - 1:
                        target[1:] = past[track, b, :-1]
                        break
            elif row != FIRST:
                largest = -np.inf
                for b in range(before.counts[track]):
                    parent = before.modes[track, b]
                    row = 2 * before.rows[track, b]
                    row += 1 if parent > 0 else 0
                    hazard = (
                        hazards[row, min(before.ages[track, b], hazards.shape[1]) - 1]
                        * order[parent, mode]
                    )
                    weights[b] = -np.inf
                    if hazard > 0.0:
                        weights[b] = before.log_weights[track, b] + math.log(hazard)
                        largest = max(largest, weights[b])
                total = 0.0
                for b in range(before.counts[track]):
                    if weights[b] > -np.inf:
                        weight = math.exp(weights[b] - largest)
                        total += weight
                        target[1:] += weight * past[track, b, :-1]
                if total > 0.0:
                    target[1:] /= total


class BeamSmoother(Decider):
    """A beam that also gives the posterior of the mode some ticks ago, `lags`: what a decider
    that waits could know.

    It decides as the beam, on line. Every track has one episode, and all begin together.
    """

    task = UNKNOWN
    observes = "tracks"

    def __init__(self, beam: BeamDecider, lags: Sequence[int]):
        if beam.model.prior.size:
            raise reject("beam", type(beam).__name__, "a beam that does not learn the law")
        if not beam.model.merged:
            raise reject(
                "merged",
                beam.model.merged,
                "True: branches are found by their mode and age",
            )
        if beam.model.joined:
            raise reject(
                "joined",
                beam.model.joined,
                "False: a joined branch stands for several ages",
            )
        self.beam = beam
        self.lags = tuple(check_integer("lags", lag, 0, LONGEST_LAG) for lag in lags)
        self._found: dict[int, list[FloatArray]] = {}

    def observe(self, tracks: Any) -> FloatArray:
        """See `BeamDecider.observe`."""
        return self.beam.observe(tracks)

    def decide(
        self,
        observation: FloatArray,
        state: SmootherState | None,
        episode_start: Any,
    ) -> tuple[Actions, SmootherState]:
        """See `MeasurementDecider.decide`; without a state, a new recording begins."""
        actions, beam_state = self.beam.decide(
            observation,
            None if state is None else state.beam,
            None,
        )
        branches = beam_state.branches
        weights = branches.filters["log_likelihood"].reshape(len(branches.counts), -1).copy()
        # Of branches that are not used.
        weights[np.arange(weights.shape[1]) >= branches.counts[:, None]] = -np.inf
        modes, ages, rows = (one.copy() for one in (branches.modes, branches.ages, branches.rows))
        now = BranchTable(modes, ages, rows, weights, branches.counts.copy())
        if state is None:
            shape = *now.modes.shape, max(self.lags) + 1, self.beam.hypotheses
            state = SmootherState(beam_state, now, np.zeros(shape), np.zeros(shape))
            self._found = {lag: [] for lag in self.lags}
        model = self.beam.model
        run_compiled(
            carry_past,
            state.table,
            now,
            state.past,
            state.spare,
            model.hazards,
            model.order,
        )
        state = SmootherState(beam_state, now, state.spare, state.past)
        self._weights, self._past = np.exp(now.log_weights), state.past
        for lag, found in self._found.items():
            # Without meaning before there are so many ticks.
            found.append(self._posterior(lag))
        return actions, state

    def _posterior(self, lag: int) -> FloatArray:
        """Return the posterior of the mode some ticks ago, (N, M)."""
        return np.einsum("nb,nbm->nm", self._weights, self._past[:, :, lag])

    def posterior(self, lag: int) -> FloatArray:
        """Return the posteriors of all ticks so far, (T, N, M), one of the lags later; the last
        ones less later.
        """
        found = self._found[lag]
        last = [self._posterior(later) for later in reversed(range(min(lag, len(found))))]
        return np.array(found[lag:] + last)
