"""The anchor agent with a learned stop: no threshold, in any environment and for any delay cost."""

import copy
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

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
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.evidence import EvidencePanel, Threshold


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
    thresholds = -30.0, -12.0, -5.0, -2.5, 0.0, 2.5, 5.0, 12.0, 30.0

    def __init__(self, net: StoppingNetworks, world: WorldOptions, margin: float = 0.0):
        super().__init__(net, world)
        self.margin = margin

    @torch.no_grad()
    def logits(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[NDArray[np.float32], FloatArray, FloatArray, StoppingState]:
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
        actions = np.zeros(len(logits), np.int64)
        stops = np.flatnonzero(logits > self.margin)
        if stops.size:
            actions[stops] = (
                self.declared(np.asarray(observation)[stops], posterior[stops], state, stops) + 1
            )
        return actions, state

    def declared(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: StoppingState,
        tracks: IntArray,
    ) -> IntArray:
        """Return the hypotheses (n,) that some tracks (n,) declare."""
        rows, scales = (
            split_sensed(self.layout, observation)[0],
            select(state.anchor.filters.scales, tracks),
        )
        always = np.ones(len(rows))
        return errors_and_best(
            self.net,
            rows,
            scales,
            posterior,
            np.full(len(rows), self.by_type),
            always,
        )[1]

    def panel(self) -> EvidencePanel:
        """See `Decider.panel`."""
        return EvidencePanel(
            label="log-odds of declaring against waiting",
            limits=(self.margin - 60.0, self.margin + 20.0),
            curves="single",
            thresholds=(Threshold(np.array([self.margin])),),
            legend=f"threshold {self.margin:g}",
        )

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
