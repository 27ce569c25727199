"""A beam of switch histories as a decider: the semi-Markov posterior with a law of the durations."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions
from baselines.quickest.beam_filters import (
    BeamModel,
    Branches,
    begin_branches,
    branch_arrays,
    step_branches,
    step_memory,
)
from baselines.quickest.threshold import ThresholdDecider
from hybrid_env.checks import check_flag, check_integer, reject
from hybrid_env.core.compilation import prepare
from hybrid_env.core.published_bank import FilterModel
from hybrid_env.durations import Durations
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.quickest_world import QuickestWorld

FloatArray = NDArray[np.float64]
MOST_BRANCHES = 100_000
OBSERVED = 2 + 4 + 10
"""Width of an observation without the probabilities: measurement, estimate and covariance."""


def hazards(laws: FloatArray) -> FloatArray:
    """Return the probability that a segment ends after each age, (rows, ticks).

    Args:
        laws: (rows, ticks) probabilities of 1, 2, ... ticks, as `QuickestOptions.duration_laws`.
    """
    table = np.ones_like(laws)  # ages that are never reached
    for row, ends in enumerate(laws):
        before = 1.0 - np.append(0.0, np.cumsum(ends)[:-1])
        np.divide(ends, before, out=table[row], where=before > 1e-12)
    return table.clip(0.0, 1.0)


class BeamState(NamedTuple):
    """State of N tracks between two calls of `BeamDecider.predict`, changed in place.

    Attributes:
        branches: the histories.
        log_probability: (N, M) logarithms of the probabilities of the modes.
        stated: (N,) last statements.
    """

    branches: Branches
    log_probability: FloatArray
    stated: Actions


class BeamDecider:
    """The threshold rule on the posterior of the most probable histories of switches.

    It observes the measurements instead of the rows of the environment, and the first estimate and
    probabilities of the bank.

    Args:
        options: of the environment.
        threshold, release: see `ThresholdDecider`.
        branches: largest number of histories.
        merged: whether histories that switch to the same mode at the same tick are merged into one.
        durations: law of the durations that the decider assumes; None is the true one of the options.

    Raises:
        ArgumentError: an argument is out of range.
    """

    every_tick = True

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 0.6,
        release: float = 1.0,
        branches: int = 64,
        merged: bool = True,
        durations: str | Durations | None = None,
    ):
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

    @staticmethod
    def observe(world: QuickestWorld) -> FloatArray:
        """Return what the decider observes, (N, 16 + M).

        Measurement, merged estimate, its covariance, and logarithms of the probabilities of the modes.
        """
        parts = [world.field(name) for name in ("measurement", "estimate", "covariance")]
        return np.hstack([*parts, world.copy_tick()()["log_probability"]])

    def predict(
        self,
        observation: FloatArray,
        state: BeamState | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, BeamState]:
        """See `Decider.predict`; action i states mode i.

        Args:
            observation: (N, 16 + M) from `observe`. All but the measurement are used where an episode begins.
            state: returned by the previous call and changed in place; None begins anew.
            episode_start: (N,) True where an episode begins; None means nowhere, except without a state.
            deterministic: not used.
        """
        width = OBSERVED + self.hypotheses
        if observation.ndim != 2 or observation.shape[1] != width:
            raise reject("observation shape", observation.shape, f"(N, {width})")
        tracks = len(observation)
        if state is None:
            state = self._begin(tracks)
            episode_start = np.ones(tracks, np.bool_)
        starts = np.zeros(tracks, np.bool_) if episode_start is None else episode_start
        children, innovations = step_memory(self.hypotheses, state.branches)
        measurements = np.ascontiguousarray(observation[:, :2])
        arguments = (
            state.branches, children, innovations, measurements, state.log_probability, self.model,
        )  # fmt: skip
        prepare(step_branches, *arguments)
        step_branches(*arguments)
        for track in np.flatnonzero(starts).tolist():
            begin = state.branches, track, np.ascontiguousarray(observation[track, 2:]), self.model
            prepare(begin_branches, *begin)
            begin_branches(*begin)
            state.log_probability[track] = observation[track, OBSERVED:]
        state.stated[:] = self.rule.choose(state.log_probability, state.stated, ~starts)
        return state.stated.copy(), state

    def _begin(self, tracks: int) -> BeamState:
        branches = branch_arrays(tracks, self.branches)
        branches.counts[:] = 1  # a branch without meaning, replaced in the first call
        log_probability = np.zeros((tracks, self.hypotheses))
        return BeamState(branches, log_probability, np.zeros(tracks, np.int64))
