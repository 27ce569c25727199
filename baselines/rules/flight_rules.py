"""Rules that state at every position what a flight is doing: straight motion, left or right turn."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.turn_beam import run_turn_beam
from baselines.estimation.turn_imm import TurnEstimates
from baselines.recordings.flights.batch import Batch
from baselines.recordings.flights.labels import STRAIGHT
from hybrid_env.checks import check_between, check_positive

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class FlightDecider(Protocol):
    """A rule that reads positions and the output of the filter."""

    def state_modes(self, batch: Batch, estimates: TurnEstimates) -> IntArray:
        """Return the stated mode, (T, B), at each position; it may use positions up to this one only."""


@dataclass(frozen=True)
class Threshold:
    """States the most probable mode when its probability exceeds a threshold, else what was stated before.

    Attributes:
        threshold: probability above which the statement changes, between 0 and 1.
    """

    threshold: float = 0.6

    def __post_init__(self) -> None:
        check_between("threshold", self.threshold, 0.0, 1.0)

    def state_modes(self, batch: Batch, estimates: TurnEstimates) -> IntArray:
        """See `FlightDecider`."""
        return self._most_probable(estimates.probabilities)

    def _most_probable(self, probabilities: FloatArray) -> IntArray:
        return held(probabilities.argmax(-1), probabilities.max(-1) > self.threshold)


class Beam(Threshold):
    """The same rule on the semi-Markov posterior of switch histories, `turn_beam`."""

    def state_modes(self, batch: Batch, estimates: TurnEstimates) -> IntArray:
        """See `FlightDecider`; only the positions are used."""
        return self._most_probable(run_turn_beam(batch))


@dataclass(frozen=True)
class Cusum:
    """Page's CUSUM of the likelihoods of the modes against that of the stated one. Page 1954.

    The sum of each other mode is kept at 0 or above; a mode whose sum exceeds the threshold is stated, and
    all sums begin anew.

    Attributes:
        threshold: of the sum, in units of log-likelihood.
    """

    threshold: float = 3.5

    def __post_init__(self) -> None:
        check_positive("threshold", self.threshold)

    def state_modes(self, batch: Batch, estimates: TurnEstimates) -> IntArray:
        """See `FlightDecider`."""
        total, tracks = batch.times.shape
        which = np.arange(tracks)
        stated = np.full(tracks, STRAIGHT)
        sums = np.zeros((tracks, 3))
        output = np.empty((total, tracks), np.int64)
        for k, likelihoods in enumerate(estimates.log_likelihoods):
            sums = np.maximum(sums + likelihoods - likelihoods[which, stated, None], 0.0)
            best = sums.argmax(1)
            changes = sums[which, best] > self.threshold
            stated = np.where(changes, best, stated)
            sums[changes] = 0.0
            output[k] = stated
        return output


def held(values: IntArray, sure: NDArray[np.bool_]) -> IntArray:
    """Return the last sure value of each column up to each row, (T, B); straight motion before the first."""
    rows = np.maximum.accumulate(np.where(sure, np.arange(len(values))[:, None], -1), axis=0)
    return np.where(rows >= 0, np.take_along_axis(values, np.maximum(rows, 0), axis=0), STRAIGHT)
