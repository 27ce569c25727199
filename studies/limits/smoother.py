"""The posterior of the mode some ticks ago, by fixed-lag smoothing on the beam of switch histories.

Every branch of the beam also carries the probabilities of the modes at the last ticks, given that
the branch is right. A branch that continues keeps them; one that begins has the mean of its
parents, weighted by the probabilities with which they switched. Later measurements change the
weights of the branches and nothing else, so by Bayes' rule the mean over the branches is the
posterior of the mode at an earlier tick, given all measurements so far.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines import BeamDecider, Decider

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class BranchTable(NamedTuple):
    """The branches of N tracks without their filters; no two of a track have the same mode, age
    and row.
    """

    # (N, B) as in the state of the beam
    modes: IntArray
    # (N, B)
    ages: IntArray
    # (N, B)
    rows: IntArray
    # (N, B) logarithms of the probabilities of the branches; -inf where there is none.
    log_weights: FloatArray


def carry_past(
    before: BranchTable,
    now: BranchTable,
    past: FloatArray,
    hazards: FloatArray,
    law_places: IntArray,
    order: FloatArray,
) -> FloatArray:
    """Return the probabilities of the modes at the last ticks from those at the tick before."""
    same = (before.log_weights > -np.inf)[:, None]
    same = same & (now.ages[:, :, None] == before.ages[:, None] + 1)
    same &= now.modes[:, :, None] == before.modes[:, None]
    same &= now.rows[:, :, None] == before.rows[:, None]
    carried = np.empty_like(past)
    carried[:, :, 0] = np.eye(len(order))[now.modes]
    continued = same.argmax(2)[:, :, None, None]
    carried[:, :, 1:] = np.take_along_axis(past[:, :, :-1], continued, axis=1)
    # Of every branch before as the parent of one that begins with a mode, (N, B, M).
    ages = np.minimum(before.ages, hazards.shape[1]) - 1
    rows = before.rows * (len(hazards) // 2) + law_places[before.modes]
    hazard = hazards[rows, ages]
    with np.errstate(divide="ignore"):
        weights = before.log_weights[..., None] + np.log(hazard[..., None] * order[before.modes])
    shares = np.exp(weights - np.nan_to_num(weights.max(1, keepdims=True), neginf=0.0))
    # The largest share is 1, where a mode has parents.
    shares /= np.maximum(shares.sum(1, keepdims=True), 1.0)
    mixed = np.einsum("nbm,nbkl->nmkl", shares, past[:, :, :-1], optimize=True)
    # Row 0 has the hazards of the first segment of an episode.
    track, branch = np.nonzero((now.ages == 1) & (now.rows != 0))
    carried[track, branch, 1:] = mixed[track, now.modes[track, branch]]
    return carried


class BeamSmoother(Decider):
    """A beam that also gives the posterior of the mode some ticks ago, `lags`: what a decider
    that waits could know.

    It decides as the beam, on line. Every track has one episode, and all begin together. Histories
    of the beam are merged, but not joined, as its branches are found by their mode and age.
    """

    observes = "tracks"

    def __init__(self, beam: BeamDecider, lags: Sequence[int]):
        self.task = beam.task
        self.beam = beam
        self.lags = tuple(lags)
        self._posteriors: dict[int, list[FloatArray]] = {}

    def observe(self, tracks: Any) -> FloatArray:
        """See `BeamDecider.observe`."""
        return self.beam.observe(tracks)

    def decide(self, observation: FloatArray, state: Any, episode_start: Any) -> tuple[Any, Any]:
        """See `MeasurementDecider.decide`; without a state, a new recording begins.

        The state is that of the beam, its branches, and the probabilities of each mode 0, ..., K
        ticks ago, given each branch, (N, B, K + 1, M).
        """
        of_beam, *kept = state or (None,)
        actions, of_beam = self.beam.decide(observation, of_beam, None)
        branches = of_beam.branches
        weights = branches.filters["log_likelihood"].reshape(len(branches.counts), -1).copy()
        # Of branches that are not used.
        weights[np.arange(weights.shape[1]) >= branches.counts[:, None]] = -np.inf
        now = BranchTable(
            branches.histories["mode"].copy(),
            branches.histories["age"].copy(),
            branches.histories["row"].copy(),
            weights,
        )
        nothing = np.zeros((*weights.shape, max(self.lags) + 1, self.beam.hypotheses))
        before, past = kept or (now, nothing)
        if state is None:
            self._posteriors = {lag: [] for lag in self.lags}
        model = self.beam.model
        past = carry_past(before, now, past, model.hazards, model.law_places, model.order)
        self._weights, self._past = np.exp(weights), past
        for lag, posteriors in self._posteriors.items():
            # Without meaning before there are so many ticks.
            posteriors.append(self._posterior(lag))
        return actions, (of_beam, now, past)

    def _posterior(self, lag: int) -> FloatArray:
        """Return the posterior of the mode some ticks ago, (N, M)."""
        return np.einsum("nb,nbm->nm", self._weights, self._past[:, :, lag])

    def posterior(self, lag: int) -> FloatArray:
        """Return the posteriors of all ticks so far, (T, N, M), one of the lags later; the last
        ones less later.
        """
        posteriors = self._posteriors[lag]
        last = [self._posterior(later) for later in reversed(range(min(lag, len(posteriors))))]
        return np.array(posteriors[lag:] + last)
