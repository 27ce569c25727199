"""A beam of switch histories as a decider: the semi-Markov posterior with a law of the
durations.
"""

import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from baselines.rules.beam_filters import (
    BeamModel,
    Branches,
    begin_branches,
    branch_arrays,
    step_branches,
    step_memory,
)
from baselines.rules.decider import Actions, Decider, DeciderFamily, SeveralThresholds
from baselines.rules.measurements import MeasurementDecider, filter_model, run_compiled, sensors_of
from baselines.rules.threshold import ThresholdDecider, reachable_probabilities
from hybrid_env.checks import BoolArray, FloatArray, check_flag, check_integer
from hybrid_env.durations import Durations, GeometricDurations
from hybrid_env.limits import MAX_LENGTH
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel

MOST_BRANCHES = 100_000
# Histories of switches.
SMALLEST_BEAM = 64
# Twice as many gain less than 0.001 of the share of right ticks with 7 hypotheses.
HISTORIES_PER_MODE = 16


def hazards(laws: FloatArray) -> FloatArray:
    """Return the probability that a segment ends after each age, (rows, ticks), of laws as
    `QuickestOptions.duration_laws`.
    """
    table = np.empty_like(laws)
    for row, ends in enumerate(laws):
        before = 1.0 - np.append(0.0, np.cumsum(ends)[:-1])
        reached = int(np.argmin(before > 1e-12)) or len(ends)
        table[row, :reached] = ends[:reached] / before[:reached]
        # Of ages that are hardly ever or never reached.
        table[row, reached:] = table[row, reached - 1]
    return table.clip(0.0, 1.0)


class BeamState(NamedTuple):
    """State of N tracks between two calls of `predict`, changed in place."""

    # The histories.
    branches: Branches
    # (N, M) logarithms of the probabilities of the modes.
    log_probability: FloatArray
    # (N,) last statements.
    stated: Actions


class BeamDecider(MeasurementDecider[BeamState]):
    """The threshold rule on the posterior of the most probable histories of switches.

    Args:
        options: of the environment.
        threshold, release: see `ThresholdDecider`.
        branches: largest number of histories.
        merged: whether histories that switch to the same mode at the same tick are merged into one.
        durations: law of the durations that the decider assumes; None is the true one of the
            options.
        order: law of the next mode that it assumes, likewise.
        joined: whether histories of a full beam that switched to the same mode at nearly the same
            tick become one; else the least probable are omitted. See `beam_joining`.
    """

    name = "beam"
    title = "beam"
    symbol = "probability"
    default = 0.6
    informed = True
    colour = "#c80f82"
    marker = "D"

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 0.6,
        release: float = 1.0,
        branches: int = 64,
        merged: bool = True,
        durations: str | Durations | None = None,
        order: Any = None,
        joined: bool = False,
    ):
        self.rule = ThresholdDecider(threshold, release)
        self.hypotheses = options.hypotheses
        self.branches = check_integer("branches", branches, options.hypotheses, MOST_BRANCHES)
        assumed = {"durations": durations, "order": order}
        options = dataclasses.replace(
            options,
            **{name: law for name, law in assumed.items() if law is not None},
        )
        self.model = BeamModel(
            np.array(options.radii),
            hazards(options.duration_laws),
            options.order_matrix,
            check_flag("merged", merged),
            np.zeros((2, 1, 2, 0), np.float32),
            np.zeros((3, 0)),
            0.0,
            filter_model(options),
            sensors_of(options),
            check_flag("joined", joined),
        )

    @classmethod
    def assumed(cls, options: QuickestOptions) -> dict[str, Any]:
        """Return the laws that the decider found by its name assumes; others are the true ones."""
        return {}

    @classmethod
    def family(cls, options: QuickestOptions) -> DeciderFamily:
        """See `Decider.family`."""
        return dataclasses.replace(
            super().family(options),
            thresholds=reachable_probabilities(options.hypotheses),
        )

    @classmethod
    def maker(cls, options: QuickestOptions) -> Callable[[float], Decider]:
        """See `Decider.maker`."""
        branches = max(SMALLEST_BEAM, HISTORIES_PER_MODE * options.hypotheses)
        assumed = cls.assumed(options)
        return lambda threshold: cls(options, threshold, branches=branches, **assumed)

    @classmethod
    def together(cls, deciders: Sequence[Self]) -> "Beams":
        """See `Decider.together`."""
        return Beams(deciders)

    def begin(self, tracks: int) -> BeamState:
        """Return branches without meaning; see `MeasurementDecider.begin`."""
        branches = branch_arrays(tracks, self.branches, self.hypotheses, self.model.prior.shape[1])
        branches.counts[:] = 1
        return BeamState(branches, np.zeros((tracks, self.hypotheses)), np.zeros(tracks, np.int64))

    def begin_track(self, state: BeamState, track: int, start: FloatArray) -> None:
        """Begin one branch of every mode; see `MeasurementDecider.begin_track`."""
        run_compiled(begin_branches, state.branches, track, start, self.model)
        state.log_probability[track] = start[-self.hypotheses :]

    def step(self, state: BeamState, measurements: FloatArray) -> None:
        """Advance the branches of all tracks; see `MeasurementDecider.step`."""
        memory = step_memory(self.hypotheses, state.branches)
        run_compiled(
            step_branches,
            state.branches,
            *memory,
            measurements,
            state.log_probability,
            self.model,
        )

    def statements(self, state: BeamState, starts: BoolArray) -> Actions:
        """Apply the threshold rule to the posterior; see `MeasurementDecider.statements`."""
        state.stated[:] = self.rule.choose(state.log_probability, state.stated, ~starts)
        return state.stated.copy()

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return probability_panel("beam", self.rule.threshold)

    def evidence(
        self,
        observation: FloatArray,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the posterior of the modes, (N, M)."""
        # A copy, because `decide` changes the state in place.
        return np.asarray(
            np.exp(self.decide(observation, copy.deepcopy(state), episode_start)[1].log_probability)
        )


class GeometricBeamDecider(BeamDecider):
    """The beam that assumes a geometric law of the same mean, for which ages have no meaning."""

    name = "beam-geometric"
    title = "beam, geometric"
    informed = False
    colour = "#00e196"
    marker = "p"

    @classmethod
    def assumed(cls, options: QuickestOptions) -> dict[str, Any]:
        """See `BeamDecider.assumed`."""
        mean = min(options.law.mean_duration, float(MAX_LENGTH))
        return {"durations": GeometricDurations(mean), "order": "equal"}


class DefaultBeamDecider(BeamDecider):
    """The beam that always assumes the default law of the environment."""

    name = "beam-default"
    title = "beam, default law"
    informed = False
    colour = "#3c000f"
    marker = "*"

    @classmethod
    def assumed(cls, options: QuickestOptions) -> dict[str, Any]:
        """See `BeamDecider.assumed`."""
        return {"durations": QuickestOptions.durations, "order": QuickestOptions.order}


class Beams(SeveralThresholds):
    """Beams that differ in their thresholds only, computed once: the posterior does not depend
    on statements.
    """

    observes = "tracks"

    def __init__(self, beams: Sequence[BeamDecider]):
        self.beam, self.rules = beams[0], [beam.rule for beam in beams]
        self.chosen = []

    def observe(self, tracks: Any) -> FloatArray:
        """See `MeasurementDecider.observe`."""
        return self.beam.observe(tracks)

    def decide(
        self,
        observation: FloatArray,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `MeasurementDecider.decide`."""
        _, state = self.beam.decide(observation, state, episode_start)
        last = self.chosen or [np.zeros(len(observation), np.int64)] * len(self.rules)
        logs = state.log_probability
        started = ~np.asarray(episode_start)
        pairs = zip(self.rules, last, strict=True)
        self.chosen = [rule.choose(logs, stated, started) for rule, stated in pairs]
        return self.chosen[0], state
