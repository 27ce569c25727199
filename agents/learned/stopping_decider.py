"""The anchor agent with a learned stop: no threshold, in any environment and for any delay cost."""

import copy
import math
from typing import Any, NamedTuple

import numpy as np
import torch

from agents.learned.anchor_decider import (
    AnchorDecider,
    AnchorNetworks,
    AnchorState,
    errors_and_best,
)
from agents.learned.anchor_net import select
from agents.learned.stopping_net import Memory, StoppingNet, stopping_inputs
from baselines.rules.decider import Actions, Observations
from baselines.rules.measurements import split_sensed
from baselines.rules.msprt import error_and_best
from hybrid_env.checks import BoolArray, Float32Array, FloatArray
from hybrid_env.rendering.evidence import EvidencePanel


class StoppingNetworks(AnchorNetworks):
    """The networks of the anchor agent, which are not trained, and that of the stop."""

    def __init__(self, hidden: int = 64):
        super().__init__(hidden)
        self.stopping = StoppingNet(hidden)


class StoppingState(NamedTuple):
    """State of the decider for N tracks."""

    anchor: AnchorState
    memory: Memory


class StoppingDecider(AnchorDecider):
    """Declares the best hypothesis once the network predicts that waiting does not pay.

    The margin is on the log-odds of declaring; at 0 the largest reward is expected.
    """

    network = StoppingNetworks
    symbol = "log-odds"
    default = 0.0
    bounds = -math.inf, math.inf
    thresholds = -30.0, -12.0, -5.0, -2.5, 0.0, 2.5, 5.0, 12.0, 30.0

    @torch.no_grad()
    def logits(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Float32Array, FloatArray, FloatArray, StoppingState]:
        """Return inputs of the network (N, 30), log-odds of declaring (N,), posterior (N, M) and
        state after a tick.
        """
        rows = split_sensed(self.layout, np.asarray(observation))[0]
        anchor, memory = state or (None, Memory.new(len(rows)))
        posterior, anchor = self.posterior(observation, anchor, episode_start)
        filters, (error, best) = anchor.filters, error_and_best(posterior, self.by_type)
        white = filters.innovations[np.arange(len(rows)), best, :2]
        inputs, memory = stopping_inputs(
            rows,
            filters.scales,
            posterior,
            (error, best),
            self.by_type,
            0.5 * (white**2).sum(-1),
            filters.heavy_tails,
            self.world.delay_cost,
            memory,
            filters.first,
        )
        logits = self.net.stopping(torch.from_numpy(inputs)).double().numpy()
        return inputs, logits, posterior, StoppingState(anchor, memory)

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`."""
        _, logits, posterior, state = self.logits(observation, state, episode_start)
        return self.declarations(observation, posterior, state, logits > self.threshold), state

    def declarations(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: StoppingState,
        stops: BoolArray,
    ) -> Actions:
        """Return the actions (N,) of tracks that declare where `stops` (N,) is True."""
        actions = np.zeros(len(stops), np.int64)
        if stops.any():
            rows = split_sensed(self.layout, np.asarray(observation)[stops])[0]
            _, best = errors_and_best(
                self.net,
                rows,
                select(state.anchor.filters.scales, stops),
                posterior[stops],
                np.full(len(rows), self.by_type),
                np.ones(len(rows)),
            )
            actions[stops] = best + 1
        return actions

    def panel(self) -> EvidencePanel:
        """See `Decider.panel`."""
        return self.log_odds_panel(60.0, 20.0, "single")

    def evidence(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the log-odds of declaring against waiting, the same for each hypothesis, (N,
        M).
        """
        _, logits, posterior, _ = self.logits(observation, copy.deepcopy(state), episode_start)
        return np.broadcast_to(logits[:, None], posterior.shape)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`."""
        memory = Memory(*(part[tracks] for part in state.memory))
        return StoppingState(super().select_tracks(state.anchor, tracks), memory)
