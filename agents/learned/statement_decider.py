"""Deciders that state the mode with the largest utility of a network at every tick: on the
probabilities of the bank, or on a beam that learns an object's habits within the episode.

The beam (`baselines.rules.beam`) is smaller than that of the rule: fewer laws, and fewer
histories, which are joined (`baselines.rules.beam_joining`). Its probabilities of the modes are
those that the network corrects, and what its histories say about age and end of the present segment
are further inputs.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from agents.learned.statement_net import LOWEST_LOG, StatementNet, statement_inputs
from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.beam import BeamDecider, BeamState
from baselines.rules.beam_filters import Branches
from baselines.rules.beam_prior import mixed_prior
from baselines.rules.decider import UNKNOWN, Actions, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import AnyArray, BoolArray, Float32Array, FloatArray, IntArray, reject
from hybrid_env.compiled import LANES, compiled, run_compiled
from hybrid_env.durations import GeometricDurations, UniformDurations
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions


class UtilityDecider(NetworkDecider):
    """States the mode with the largest utility, where keeping the statement has a utility of its
    own.

    Base class; the subclasses give the inputs of the network.

    Args:
        net: trained network.

    Attributes:
        threshold: a margin, added to the utility of keeping the statement. With a larger one the
            statement changes later, and less often to a wrong mode.
    """

    any_modes = False
    symbol = "log-odds"
    thresholds = (
        *(-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0),
        *(13.0, 16.0, 20.0),
    )
    inputs: ClassVar[int]
    """Number of inputs of the network for each turn hypothesis."""

    net: Any

    def __init__(self, net: Any):
        super().__init__()
        self.net = net

    @classmethod
    def network(cls, hidden: int) -> Any:
        """Return an untrained network with a number of hidden units, `StatementNet` or one with
        the same outputs.
        """
        return StatementNet(hidden, cls.inputs)

    def largest(
        self, utility: FloatArray, stay: FloatArray, stated: Actions, started: BoolArray
    ) -> Actions:
        """Return the statements of N tracks, (N,).

        Args:
            utility: (N, M) of the modes; that of the stated one is changed.
            stay: (N,) utility of keeping the statement.
            stated: (N,) last statements.
            started: (N,) whether there has been a statement.
        """
        utility[np.arange(len(utility)), stated] += np.where(started, stay + self.threshold, 0.0)
        return utility.argmax(-1)


@dataclass
class StatementState:
    """What a `StatementDecider` remembers of N tracks.

    Attributes:
        memory: (1, N (M - 1), hidden) of the recurrent network.
        best: (N,) most probable mode of the last tick.
        age: (N,) ticks for which it has been the most probable one.
        beam: state of the beam; None without one.
    """

    memory: Tensor
    best: IntArray
    age: IntArray
    beam: BeamState | None = None


class StatementDecider(UtilityDecider):
    """The network on rows of an environment with unknown switch moments, and on a beam of its own
    if it has inputs for habits.

    Args:
        net: trained network.
        world: options of the environment.
    """

    task = UNKNOWN
    # Of each hypothesis, seen as straight motion, as the turn itself and as the other turns, and of
    # the track.
    inputs = 3 * 8 + 2

    def __init__(self, net: StatementNet, world: QuickestOptions):
        super().__init__(net)
        self.world = world
        self.layout = QuickestLayout(world.hypotheses)
        self.beam = None
        if net.recurrent.input_size > self.inputs:
            branches = max(16, 3 * world.hypotheses)
            # It learns among fewer laws than that of the rule.
            prior = mixed_prior(
                widths=((1.07, 0.07), (1.2, 0.13), (1.6, 0.25), (2.4, 0.4)),
                shortest=(14.0, 180.0),
                offsets=(0, 10, 25, 50, 80),
                means=(10, 20, 40, 80),
                shares=(0.32, 0.08),
                known=((GeometricDurations(50.0, 25), 0.3), (UniformDurations(50, 100), 0.3)),
            )._replace(different=0.15, habitual=0.4)
            self.beam = BeamDecider(world, branches=branches, joined=True, prior=prior)
            self.observes = "tracks"

    @classmethod
    def network_of(cls, entry: Mapping[str, Any]) -> StatementNet:
        """See `NetworkDecider.network_of`."""
        return cls.network(entry["hidden"], habits=bool(entry.get("habits")))

    @classmethod
    def network(cls, hidden: int, habits: bool = False) -> StatementNet:
        """Return an untrained network, with inputs for habits or without."""
        return StatementNet(hidden, cls.inputs + 3 * 5 * habits)

    def observe(self, tracks: Any) -> FloatArray:
        """Return rows, and what the beam observes, (N, width)."""
        rows = tracks.take_rows()
        return rows if self.beam is None else np.hstack([rows, self.beam.observe(tracks)])

    def initial_state(self, tracks: int) -> StatementState:
        """Return the state of N tracks before their first tick."""
        turns = self.layout.hypotheses - 1
        memory = torch.zeros(1, tracks * turns, self.net.recurrent.hidden_size)
        return StatementState(memory, np.full(tracks, -1), np.zeros(tracks, np.int64))

    @torch.no_grad()
    def decide(
        self, observation: Observations, state: StatementState | None, episode_start: Any
    ) -> tuple[Actions, StatementState]:
        """See `Decider.decide`; action i states mode i."""
        observation = np.asarray(observation)
        if state is None:
            state = self.initial_state(len(observation))
        elif episode_start is not None and episode_start.any():
            going_on = np.repeat(~episode_start, self.layout.hypotheses - 1)
            state = replace(
                state,
                memory=state.memory * torch.from_numpy(going_on).float()[None, :, None],
                best=np.where(episode_start, -1, state.best),
            )
        features, log_probability, state = self.features(observation, state, episode_start)
        inputs = statement_inputs(self.world, *features)
        outputs = self.net(
            torch.from_numpy(inputs[None]), torch.from_numpy(log_probability[None]), state.memory
        )
        stated, started = read_statement(features[0])
        utility, stay = (part[0].double().numpy() for part in (outputs.utility, outputs.stay))
        statements = self.largest(utility, stay, stated, started)
        return statements, replace(state, memory=outputs.memory)

    def features(
        self, observation: AnyArray, state: StatementState, episode_start: Any
    ) -> tuple[tuple[Any, ...], Float32Array, StatementState]:
        """Return the arguments of `statement_inputs`, the log-probabilities (N, M) that the network
        corrects, and the state with the network's memory of the last tick.
        """
        width = self.layout.width
        if observation.ndim != 2 or (observation.shape[1] > width) != (self.beam is not None):
            more = "" if self.beam is None else " and more"
            raise reject("observation shape", observation.shape, f"(N, {width}{more})")
        rows = np.array(observation[:, :width], np.float32)
        log_probability = self.layout.read(rows, "log_probability")
        best = log_probability.argmax(-1)
        state = replace(state, best=best, age=np.where(best == state.best, state.age + 1, 1))
        features: tuple[Any, ...] = rows, state.age
        if self.beam is not None:
            seen = np.asarray(observation[:, width:], np.float64)
            _, beam = self.beam.decide(seen, state.beam, episode_start)
            state = replace(state, beam=beam)
            log_probability = np.maximum(beam.log_probability, 2.0 * LOWEST_LOG)
            features += (habit_inputs(beam.branches, log_probability),)
        return features, log_probability.astype(np.float32), state

    def evidence(
        self, observation: Any, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the posterior of the bank or of the beam, (N, M)."""
        if self.beam is None:
            return super().evidence(observation, state, episode_start)
        seen = observation[:, self.layout.width :]
        return self.beam.evidence(seen, None if state is None else state.beam, episode_start)


def habit_inputs(branches: Branches, log_probability: FloatArray) -> Float32Array:
    """Return what the histories of a beam say about each hypothesis, (N, M, 5).

    Args:
        branches: of the beam.
        log_probability: (N, M) of the modes.
    """
    sums = np.zeros((*log_probability.shape, 3))
    run_compiled(_sum_branches, branches, sums)
    probability = np.exp(log_probability)
    columns = (
        2.0 * probability - 1.0,
        np.maximum(log_probability, LOWEST_LOG) / 5.0,
        # Probabilities that the segment began at this tick, and would have ended at the last one.
        np.log(np.maximum(sums[..., 0], np.exp(LOWEST_LOG))) / 5.0,
        np.log(np.maximum(sums[..., 1] / probability, 1e-4)) / 3.0 + 1.0,
        # Expected age.
        np.log(np.maximum(sums[..., 2] / probability, 1.0)) / 5.0,
    )
    return np.stack(columns, axis=-1).astype(np.float32)


@compiled
def _sum_branches(branches: Branches, sums: FloatArray) -> None:
    """Add to `sums` (N, M, 3) what the branches in each mode have of new segments, of hazard,
    and of age.
    """
    for track in range(sums.shape[0]):
        for b in range(branches.counts[track]):
            weight = math.exp(branches.filters[track, b // LANES].log_likelihood[b % LANES])
            history = branches.histories[track, b]
            target = sums[track, history.mode]
            if history.age == 1:
                target[0] += weight
            target[1] += weight * history.hazard
            target[2] += weight * history.age
