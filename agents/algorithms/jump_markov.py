"""The jump-Markov net, trained without the true states."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from agents.algorithms.statements import StatementSettings, TrackAlgorithm, make_tracks
from agents.learned.jump_markov_net import JumpMarkovDecider, track_inputs
from agents.learned.statement_net import StatementOutputs
from agents.training.expected_reward import Batch
from baselines.rules.measurements import OBSERVED
from hybrid_env.quickest_options import QuickestOptions


class JumpMarkov(TrackAlgorithm):
    """A training run of the jump-Markov net on the tracks of `TrackAlgorithm`, without their true
    states.
    """

    name = "jump_markov"
    Settings = StatementSettings
    decider = JumpMarkovDecider

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """See `TrackAlgorithm.simulate`; the inputs are (T, N, 6 + M - 1), see `track_inputs`."""
        env = make_tracks(world, tracks, inexact)
        env.reset(seed=seed)
        decider = JumpMarkovDecider(self.net, world)
        seen = []
        modes = []
        for _ in range(world.ticks):
            seen.append(decider.observe(env.world))
            modes.append(env.world.field("true_mode").astype(np.int64))
            env.step(np.zeros(tracks, np.int64))
        logs = np.array(seen, np.float32)[..., OBSERVED : OBSERVED + world.hypotheses]
        return np.array([track_inputs(world, one) for one in seen]), logs, np.array(modes)

    def further_loss(self, outputs: StatementOutputs, batch: Batch) -> Tensor | float:
        """Return the mean negative log-likelihood of a measurement by the filter of the true
        mode.
        """
        assert outputs.logs is not None
        return -outputs.logs.gather(-1, batch.true_modes[..., None]).mean()
