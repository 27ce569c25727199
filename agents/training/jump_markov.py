"""Training of the jump-Markov net: expected reward, true modes, and the likelihoods of the measurements."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.jump_markov_decider import JumpMarkovDecider
from agents.learned.jump_markov_net import track_inputs
from agents.learned.statement_decider import UtilityDecider
from agents.learned.statement_net import StatementOutputs
from agents.training.statements import Batch, TrackRun
from baselines.rules.measurements import OBSERVED
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.vector_env import HybridTrackQuickestVectorEnv


class JumpMarkovRun(TrackRun):
    """A training run of the jump-Markov net on the tracks of `TrackRun`, without their true states."""

    decider_class: ClassVar[type[UtilityDecider]] = JumpMarkovDecider

    def simulate(self, world: QuickestOptions, tracks: int, seed: int) -> tuple[NDArray[Any], ...]:
        """See `TrackRun.simulate`; the inputs are (T, N, 6 + M - 1), see `track_inputs`."""
        env = HybridTrackQuickestVectorEnv(tracks, autoreset_mode="Disabled", tick_info=False, **vars(world))
        env.reset(seed=seed)
        decider = JumpMarkovDecider(self.net, world)
        seen, modes = [], []
        for _ in range(world.ticks):
            seen.append(decider.observe(env.world))
            modes.append(env.world.field("true_mode").astype(np.int64))
            env.step(np.zeros(tracks, np.int64))
        logs = np.array(seen, np.float32)[..., OBSERVED : OBSERVED + world.hypotheses]
        return np.array([track_inputs(world, one) for one in seen]), logs, np.array(modes)

    def further_loss(self, outputs: StatementOutputs, batch: Batch) -> Tensor | float:
        """Return the mean negative log-likelihood of a measurement by the filter of the true mode."""
        assert outputs.logs is not None
        return -outputs.logs.gather(-1, batch.true_modes[..., None]).mean()
