"""A beam of switch histories as a decider: the semi-Markov posterior with a law of the
durations.
"""

import copy
import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np

from baselines.rules.beam_filters import (
    BY_LAW,
    BeamModel,
    Branches,
    Walk,
    begin_branches,
    branch_arrays,
    walk_branches,
    walk_memory,
)
from baselines.rules.beam_prior import Prior, hazard_tables, hazards, mixed_prior
from baselines.rules.decider import Actions, Variants
from baselines.rules.measurements import MeasurementDecider, own_filters, sensors_of
from baselines.rules.threshold import reachable_probabilities, state_modes
from hybrid_env.checks import BoolArray, FloatArray, check_integer
from hybrid_env.compiled import LANES, run_compiled
from hybrid_env.durations import Durations, GeometricDurations
from hybrid_env.limits import MAX_LENGTH
from hybrid_env.quickest_options import QuickestOptions


class BeamState(NamedTuple):
    """State of N tracks between two calls of `predict`, changed in place."""

    # The histories.
    branches: Branches
    # (N, M) logarithms of the probabilities of the modes.
    log_probability: FloatArray
    # (K, N) last statements, at each threshold.
    stated: Actions


def _geometric(options: QuickestOptions) -> Mapping[str, Any]:
    """Return the geometric law of the same mean, for which ages have no meaning."""
    mean = min(options.law.mean_duration, float(MAX_LENGTH))
    return {"durations": GeometricDurations(mean), "transitions": "equal"}


class BeamDecider(MeasurementDecider):
    """The threshold rule on the posterior of the most probable histories of switches.

    With a `prior` it does not know the laws of the durations and of the next mode: its posterior
    is averaged over laws by their evidence, and the order of the modes is learned by counts.
    Histories then carry beliefs, see `beam_habits`; their filters are the same.

    Args:
        options: of the environment.
        threshold: see `ThresholdDecider`.
        branches: largest number of histories; None is 16 for each mode, at least 64. Twice as many
            gain less than 0.001 of the share of right ticks with 7 hypotheses.
        durations: law of the durations that the decider assumes; None is the true one of the
            options.
        transitions: law of the next mode that it assumes, likewise.
        joined: whether histories of a full beam that switched to the same mode at nearly the same
            tick become one; else the least probable are omitted. See `beam_joining`.
        prior: laws of the durations with their probabilities; None does not learn.
    """

    name = "beam"
    title = "beam"
    symbol = "probability"
    default = 0.6
    bounds = 0.0, 1.0
    sweeps = True
    source = "beam"
    oracle = True
    variants: ClassVar[Variants] = {
        "beam-geometric": {"title": "beam, geometric", "oracle": False, "arguments": _geometric},
        "beam-default": {
            "title": "beam, default law",
            "oracle": False,
            "arguments": lambda options: {
                "durations": QuickestOptions.durations,
                "transitions": QuickestOptions.transitions,
            },
        },
        "beam-adaptive": {
            "title": "beam, adaptive",
            "oracle": False,
            "default": 0.65,
            "arguments": lambda options: {"threshold": 0.65, "prior": mixed_prior()},
        },
    }

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 0.6,
        branches: int | None = None,
        durations: str | Durations | None = None,
        transitions: Any = None,
        joined: bool = False,
        prior: Prior | None = None,
    ):
        super().__init__(threshold)
        self.hypotheses = options.hypotheses
        self.thresholds = reachable_probabilities(options.hypotheses)
        if branches is None:
            branches = max(64, 16 * options.hypotheses)
        self.branches = check_integer("branches", branches, options.hypotheses, 100_000)
        options = dataclasses.replace(
            options,
            durations=options.durations if durations is None else durations,
            transitions=options.transitions if transitions is None else transitions,
        )
        tables = np.zeros((2, 1, 2, 0), np.float32)
        weights = np.zeros((3, 0))
        if prior is not None:
            oldest = min(options.ticks, 1200)
            tables = hazard_tables(prior, oldest, options.start == "random")
            # Shares of the rows of `beam_habits.Habits`.
            shares = 1.0 - prior.different, prior.different, prior.different
            weights = np.outer(shares, prior.weights) / np.sum(prior.weights)
        self.model = BeamModel(
            options.motions,
            hazards(options.duration_laws),
            options.law_places,
            options.next_mode_matrix,
            tables,
            weights,
            0.0 if prior is None else prior.habitual,
            own_filters(options),
            sensors_of(options),
            joined,
            0,
            # Filters are advanced in groups.
            -(-self.branches // LANES) * LANES,
        )

    def begin(self, tracks: int) -> BeamState:
        """Return branches without meaning; see `MeasurementDecider.begin`."""
        branches = branch_arrays(tracks, self.model)
        branches.counts[:] = 1
        stated = np.zeros((np.size(self.threshold), tracks), int)
        return BeamState(branches, np.zeros((tracks, self.hypotheses)), stated)

    def begin_track(self, state: BeamState, track: int, start: FloatArray) -> None:
        """Begin one branch of every mode; see `MeasurementDecider.begin_track`."""
        run_compiled(begin_branches, state.branches, track, start, self.model)
        state.log_probability[track] = start[-self.hypotheses :]

    def step(self, state: BeamState, measurements: FloatArray) -> None:
        """Advance the branches of all tracks; see `MeasurementDecider.step`."""
        # Nodes, groups and weights are not kept.
        nodes = (np.zeros((0, 0, 0), kind) for kind in (np.int32, np.uint16, np.float32))
        run_compiled(
            walk_branches,
            state.branches,
            walk_memory(),
            Walk(measurements[None], np.full(1, BY_LAW), 0, *nodes),
            state.log_probability,
            self.model,
        )

    def statements(self, state: BeamState, starts: BoolArray) -> Actions:
        """Apply the threshold rule to the posterior; see `MeasurementDecider.statements`."""
        for threshold, stated in zip(np.atleast_1d(self.threshold), state.stated, strict=True):
            stated[:] = state_modes(state.log_probability, stated, ~starts, float(threshold))
        return state.stated.copy() if np.ndim(self.threshold) else state.stated[0].copy()

    def evidence(
        self, observation: FloatArray, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the posterior of the modes, (N, M)."""
        # A copy, because `decide` changes the state in place.
        return np.exp(
            self.decide(observation, copy.deepcopy(state), episode_start)[1].log_probability
        )
