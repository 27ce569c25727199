"""The statement network on a beam that learns an object's habits within the episode.

The beam (`baselines.rules.beam`) is smaller than that of the rule: fewer laws, and fewer
histories, which are joined (`baselines.rules.beam_joining`). Its probabilities of the modes are
those that the network corrects, and what its histories say about age and end of the present segment
are further inputs.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.learned.statement_decider import StatementDecider
from agents.learned.statement_net import INPUTS, LOWEST_LOG, StatementNet
from baselines.rules.beam import BeamDecider, BeamState
from baselines.rules.beam_filters import Branches
from baselines.rules.beam_prior import mixed_prior
from baselines.rules.decider import Observations
from baselines.rules.measurements import run_compiled
from hybrid_env.checks import Float32Array, FloatArray, reject
from hybrid_env.compiled import LANES, compiled
from hybrid_env.durations import GeometricDurations, UniformDurations
from hybrid_env.quickest_options import QuickestOptions

HABIT_INPUTS = (
    "probability in the beam",
    "its logarithm",
    "log of the probability that the segment began at this tick",
    "log of the probability that it would have ended at the last tick",
    "log of its expected age",
)
"""Of straight motion, of the turn, and of the other turns, in addition to
`statement_net.HYPOTHESIS_INPUTS`.
"""

# The beam learns among fewer laws than that of the rule, with those of the recipe `statements`.
PRIOR = mixed_prior(
    widths=((1.07, 0.07), (1.2, 0.13), (1.6, 0.25), (2.4, 0.4)),
    shortest=(14.0, 180.0),
    offsets=(0, 10, 25, 50, 80),
    means=(10, 20, 40, 80),
    shares=(0.32, 0.08),
    known=((GeometricDurations(50.0, 25), 0.3), (UniformDurations(50, 100), 0.3)),
)._replace(different=0.15, habitual=0.4)


class RhythmDecider(StatementDecider):
    """The network on rows of an environment with unknown switch moments, and on a beam of its own.

    Args:
        net: trained network.
        world: options of the environment.
        margin: see `UtilityDecider`.
        branches: histories of the beam, at least three for each mode.

    Raises:
        ArgumentError: the margin is not a finite number.
    """

    observes = "tracks"
    inputs = INPUTS + 3 * len(HABIT_INPUTS)

    def __init__(
        self,
        net: StatementNet,
        world: QuickestOptions,
        margin: float = 0.0,
        branches: int = 16,
    ):
        super().__init__(net, world, margin)
        branches = max(branches, 3 * world.hypotheses)
        self.beam = BeamDecider(world, branches=branches, joined=True, prior=PRIOR)

    def observe(self, tracks: Any) -> FloatArray:
        """Return rows, and what the beam observes, (N, width)."""
        return np.hstack([tracks.take_rows(), self.beam.observe(tracks)])

    def divide(self, observation: Observations) -> tuple[Float32Array, NDArray[Any] | None]:
        """See `StatementDecider.divide`."""
        width = self.layout.width
        if observation.ndim != 2 or observation.shape[1] <= width:
            raise reject(
                "observation shape",
                observation.shape,
                f"(N, more than {width}), from `observe`",
            )
        rows, _ = super().divide(observation[:, :width])
        return rows, np.asarray(observation[:, width:], np.float64)

    def filtered(
        self,
        bank: FloatArray,
        seen: NDArray[Any] | None,
        filters: BeamState | None,
        episode_start: Any,
    ) -> tuple[FloatArray, Float32Array | None, BeamState]:
        """See `StatementDecider.filtered`."""
        assert seen is not None
        _, state = self.beam.decide(seen, filters, episode_start)
        log_probability = np.maximum(state.log_probability, 2.0 * LOWEST_LOG)
        return log_probability, habit_inputs(state.branches, log_probability), state

    def evidence(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the posterior of the beam, (N, M)."""
        seen = observation[:, self.layout.width :]
        return self.beam.evidence(seen, None if state is None else state.filters, episode_start)


def habit_inputs(branches: Branches, log_probability: FloatArray) -> Float32Array:
    """Return the `HABIT_INPUTS` of all hypotheses, (N, M, 5).

    Args:
        branches: of the beam.
        log_probability: (N, M) of the modes.
    """
    sums = np.zeros((*log_probability.shape, 3))
    run_compiled(_sum_branches, branches, sums)
    out = np.empty((*log_probability.shape, len(HABIT_INPUTS)), np.float32)
    probability = np.exp(log_probability)
    floor = np.exp(LOWEST_LOG)
    out[..., 0] = 2.0 * probability - 1.0
    out[..., 1] = np.maximum(log_probability, LOWEST_LOG) / 5.0
    out[..., 2] = np.log(np.maximum(sums[..., 0], floor)) / 5.0
    out[..., 3] = np.log(np.maximum(sums[..., 1] / probability, 1e-4)) / 3.0 + 1.0
    out[..., 4] = np.log(np.maximum(sums[..., 2] / probability, 1.0)) / 5.0
    return out


@compiled
def _sum_branches(branches: Branches, sums: FloatArray) -> None:
    """Add to `sums` (N, M, 3) what the branches in each mode have of new segments, of hazard,
    and of age.
    """
    for track in range(sums.shape[0]):
        for b in range(branches.counts[track]):
            weight = math.exp(branches.filters[track, b // LANES].log_likelihood[b % LANES])
            target = sums[track, branches.modes[track, b]]
            if branches.ages[track, b] == 1:
                target[0] += weight
            target[1] += weight * branches.hazards[track, b]
            target[2] += weight * branches.ages[track, b]
