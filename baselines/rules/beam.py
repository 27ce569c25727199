"""A beam of switch histories as a decider: the semi-Markov posterior with a law of the durations."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.estimation.beam_filters import (
    BeamModel,
    Branches,
    begin_branches,
    branch_arrays,
    step_branches,
    step_memory,
)
from baselines.rules.decider import Actions
from baselines.rules.measurements import FloatArray, MeasurementDecider, check_measured, run_compiled
from baselines.rules.threshold import ThresholdDecider
from hybrid_env.checks import check_flag, check_integer
from hybrid_env.core.banks.bank import FilterModel
from hybrid_env.durations import Durations
from hybrid_env.quickest_options import QuickestOptions

MOST_BRANCHES = 100_000


def hazards(laws: FloatArray) -> FloatArray:
    """Return the probability that a segment ends after each age, (rows, ticks).

    Args:
        laws: (rows, ticks) probabilities of 1, 2, ... ticks, as `QuickestOptions.duration_laws`.
    """
    table = np.empty_like(laws)
    for row, ends in enumerate(laws):
        before = 1.0 - np.append(0.0, np.cumsum(ends)[:-1])
        reached = int(np.argmin(before > 1e-12)) or len(ends)
        table[row, :reached] = ends[:reached] / before[:reached]
        table[row, reached:] = table[row, reached - 1]  # of ages that are hardly ever or never reached
    return table.clip(0.0, 1.0)


class BeamState(NamedTuple):
    """State of N tracks between two calls of `predict`, changed in place.

    Attributes:
        branches: the histories.
        log_probability: (N, M) logarithms of the probabilities of the modes.
        stated: (N,) last statements.
    """

    branches: Branches
    log_probability: FloatArray
    stated: Actions


class BeamDecider(MeasurementDecider[BeamState]):
    """The threshold rule on the posterior of the most probable histories of switches.

    Args:
        options: of the environment.
        threshold, release: see `ThresholdDecider`.
        branches: largest number of histories.
        merged: whether histories that switch to the same mode at the same tick are merged into one.
        durations: law of the durations that the decider assumes; None is the true one of the options.

    Raises:
        ArgumentError: an argument is out of range.
    """

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 0.6,
        release: float = 1.0,
        branches: int = 64,
        merged: bool = True,
        durations: str | Durations | None = None,
    ):
        check_measured(options)
        self.rule = ThresholdDecider(threshold, release)
        self.hypotheses = options.hypotheses
        self.branches = check_integer("branches", branches, options.hypotheses, MOST_BRANCHES)
        if durations is not None:
            options = dataclasses.replace(options, durations=durations)
        variances = options.variances
        self.model = BeamModel(
            np.array(options.radii),
            hazards(options.duration_laws),
            check_flag("merged", merged),
            FilterModel(options.tau, options.process_variance, float(variances[0]), float(variances[-1])),
        )

    def begin(self, tracks: int) -> BeamState:
        """Return branches without meaning; see `MeasurementDecider.begin`."""
        branches = branch_arrays(tracks, self.branches)
        branches.counts[:] = 1
        log_probability = np.zeros((tracks, self.hypotheses))
        return BeamState(branches, log_probability, np.zeros(tracks, np.int64))

    def begin_track(self, state: BeamState, track: int, start: FloatArray) -> None:
        """Begin one branch of every mode; see `MeasurementDecider.begin_track`."""
        run_compiled(begin_branches, state.branches, track, start, self.model)
        state.log_probability[track] = start[-self.hypotheses :]

    def step(self, state: BeamState, measurements: FloatArray) -> None:
        """Advance the branches of all tracks; see `MeasurementDecider.step`."""
        children, innovations = step_memory(self.hypotheses, state.branches)
        run_compiled(
            step_branches, state.branches, children, innovations, measurements, state.log_probability,
            self.model,
        )  # fmt: skip

    def statements(self, state: BeamState, starts: NDArray[np.bool_]) -> Actions:
        """Apply the threshold rule to the posterior; see `MeasurementDecider.statements`."""
        state.stated[:] = self.rule.choose(state.log_probability, state.stated, ~starts)
        return state.stated.copy()
