"""Filters that start from learned distributions of the anchor error, and a learned stop, as a
decider.

Extended Kalman filters of every hypothesis start from the components of that distribution, see
`anchor_net`. Inputs have no units and left and right turns are mirror images, so that the same
weights apply to objects of any size and to banks of any size.
"""

import copy
from typing import Any, Self

import numpy as np
import torch

from agents.learned.anchor_inputs import (
    RowRatios,
    anchor_inputs,
    bias_of_bank,
    declared_side,
    log_odds,
    regret_inputs,
    stated_factor,
    stopping_inputs,
)
from agents.learned.anchor_net import AnchorNet, AnchorNetworks
from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.component_filters import Anchors, ComponentFilters, stated_anchors
from baselines.rules.decider import Actions, Observations
from baselines.rules.measurements import observe_sensed, split_sensed
from baselines.rules.msprt import error_and_best
from hybrid_env.checks import BoolArray, Float32Array, FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.evidence import EvidencePanel


class AnchorState:
    """The filters of N tracks, started as the network predicts, and what is remembered of the row
    before; changed in place.

    Attributes:
        ratios: of the present row.
        anchors: inputs (n, 22 + C), factor (n, 4, 4) and tracks (n,) of the anchors predicted in
            this row, if any.
        inputs: (N, 31) of the network that decides to declare, as `logits` and `best` of the
            present row and written by `AnchorDecider.advance`.
        logits: (N,) log-odds of declaring against waiting.
        best: (N,) hypothesis that is most likely to be rewarded.
    """

    ratios: RowRatios
    inputs: Float32Array
    logits: FloatArray
    best: IntArray

    def __init__(self, world: WorldOptions, tracks: int):
        self.world = world
        M, C = world.hypotheses, AnchorNet.components
        self.filters = ComponentFilters("anchor_aware", C, tracks, world, robust=True)
        # An episode starts with the next first tick of a segment, (N,), and with this row.
        self.starting = np.ones(tracks, np.bool_)
        self.first = np.zeros(tracks, np.bool_)
        self.posterior = np.full((tracks, M), 1 / M)
        self.components = np.full((tracks, C), 1 / C)
        self.bias = np.zeros((tracks, M, 2))
        # Ticks, ticks left, speed.
        self.before = np.zeros((tracks, 3))
        # (N, M, 3) of each hypothesis, see `ComponentFilters`.
        self.innovations = np.zeros((tracks, M, 3))
        # Moving averages of the log-odds, and of squared innovations over 2, see `stopping_inputs`.
        self.odds = np.zeros((tracks, 3))
        self.squares = np.ones((tracks, 2))
        self.anchors: tuple[Float32Array, FloatArray, IntArray] | None = None

    def advance(
        self,
        net: AnchorNet,
        ratios: RowRatios,
        episode_start: BoolArray | None,
        sensed: FloatArray | None,
    ) -> None:
        """Process one row of every track; `sensed` is what the sensors measured, see
        `split_sensed`.
        """
        if episode_start is not None:
            self.starting = self.starting | episode_start
        before = np.column_stack([ratios.read(name) for name in ("ticks", "ticks_left", "speed")])
        begins = before[:, 0] < 1.5
        self.first = self.starting & begins
        self.starting = self.starting & ~self.first
        started = self._anchors(net, ratios, begins)
        self.filters.advance(ratios.rows, begins, started, self.first, sensed)
        share = self.filters.posterior
        self.posterior = share.sum(0)
        self.components = share.sum(-1).T
        innovations = (share[..., None] * self.filters.innovations).sum(0)
        self.innovations = innovations / np.maximum(self.posterior, 1e-300)[..., None]
        self.bias = bias_of_bank(ratios, self.innovations)
        self.before, self.ratios = before, ratios

    def _anchors(self, net: AnchorNet, ratios: RowRatios, begins: BoolArray) -> Anchors:
        """Return the anchors of the tracks that begin a segment."""
        begun = np.flatnonzero(begins)
        started = stated_anchors(self.world, ratios.rows[begun], net.components)
        self.anchors = None
        later = np.flatnonzero(~self.first[begun])
        if later.size:
            tracks = begun[later]
            ratios = RowRatios(self.world, ratios.rows[tracks])
            past = (getattr(self, name)[tracks] for name in ("components", "bias", "before"))
            posterior = self.posterior[tracks]
            side = declared_side(ratios, posterior)
            inputs = anchor_inputs(ratios, side, posterior, *past)
            factor = stated_factor(ratios, side)
            for values, predicted in zip(started, net.anchors(inputs, factor), strict=True):
                values[later] = predicted
            self.anchors = inputs, factor, tracks
        return started

    @property
    def heavy_tails(self) -> FloatArray:
        """Probability (N,) that the noise has heavy tails, from the segments before the present
        one.
        """
        return np.asarray(np.exp(self.filters.log_laws[-1]))

    def select_tracks(self, tracks: BoolArray) -> Self:
        """Return the state of the tracks selected by a mask (N,)."""
        other = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(other, name, value[tracks])
        other.filters = self.filters.select_tracks(tracks)
        return other


class AnchorDecider(NetworkDecider):
    """Declares the best hypothesis once the network predicts that waiting does not pay.

    Args:
        net: trained networks.
        world: options of the environment, whose model the filters use.

    Attributes:
        stop: 0 to declare by the probability of an error alone, at threshold 0 by one of 2 %.
    """

    every_tick = True
    any_modes = False
    network = AnchorNetworks
    symbol = "log-odds"
    second_threshold = "stop"
    stop: float = 1.0
    thresholds = -30.0, -20.0, -12.0, -8.0, -5.0, -2.5, 0.0, 2.5, 5.0, 12.0, 30.0

    def __init__(self, net: AnchorNetworks, world: WorldOptions):
        super().__init__()
        self.net, self.world = net, world
        self.layout = Layout(world.hypotheses)
        self.observes = "tracks" if world.sensors else "rows"

    def observe(self, tracks: Any) -> Observations:
        """See `Decider.observe`: with sensors also what they measured."""
        return observe_sensed(tracks)

    @torch.no_grad()
    def advance(
        self, observation: Observations, state: AnchorState | None, episode_start: Any
    ) -> AnchorState:
        """Return the state after one tick, with the log-odds of declaring."""
        rows, sensed = split_sensed(self.layout, np.asarray(observation))
        ratios = RowRatios(self.world, rows)
        state = state or AnchorState(self.world, len(rows))
        state.advance(self.net.anchor, ratios, episode_start, sensed)
        error, state.best = error_and_best(state.posterior, self.world.groups)
        right = -log_odds(error, 1e-9)[:, None]
        begins = ratios.read("ticks") < 1.5
        before = np.where(begins[:, None], right, state.odds)
        changes = right - before
        state.odds = before + np.array([1 / 2, 1 / 5, 1 / 12]) * changes
        white = ratios.of_mode(state.innovations, state.best)[:, :2]
        square = np.minimum(0.5 * (white**2).sum(-1), 40.0)[:, None]
        squares = np.where(np.stack([begins, state.first], -1), 1.0, state.squares)
        state.squares = squares + np.array([1 / 8, 1 / 60]) * (square - squares)
        state.inputs = stopping_inputs(
            ratios, state.posterior, error, state.best, changes, state.squares, state.heavy_tails
        )
        state.logits = right[:, 0] + log_odds(0.02)
        if self.stop:
            state.logits = self.net.stopping(torch.from_numpy(state.inputs)).double().numpy()
        return state

    def decide(
        self, observation: Observations, state: Any, episode_start: Any
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`."""
        state = self.advance(observation, state, episode_start)
        return self.declarations(state, state.logits > self.threshold), state

    @torch.no_grad()
    def declarations(self, state: AnchorState, stops: BoolArray) -> Actions:
        """Return the actions (N,) of tracks that declare where `stops` (N,) is True.

        If only the type is rewarded, a wrong radius costs nothing at once, but the next anchor is
        less accurate: the mean radius is declared where its expected cost is smaller than that of
        the most likely one. If all filters run on (`follow="bank"`), the next anchor does not
        depend on the declaration.
        """
        best = state.best[stops]
        world = self.world
        of_type = world.correctness == "type" and world.hypotheses > 3
        if best.size and of_type and world.follow != "bank":
            ratios, posterior = RowRatios(world, state.ratios.rows[stops]), state.posterior[stops]
            turn = ratios.turn
            same = ratios.kind == ratios.kind[best][:, None]
            mean = (posterior * same * turn).sum(-1) / (posterior * same).sum(-1)
            other = np.where(same, np.abs(turn - mean[:, None]), np.inf).argmin(-1)
            costs = []
            for candidate in (best, other):
                declared = ratios.of_mode(turn, candidate)[:, None]
                inputs = torch.from_numpy(regret_inputs(ratios, declared, turn))
                costs.append((posterior * self.net.regret(inputs).numpy()).sum(-1))
            best = np.where(costs[1] < costs[0], other, best)
        actions = np.zeros(len(stops), np.int64)
        actions[stops] = best + 1
        return actions

    def panel(self) -> EvidencePanel:
        """See `Decider.panel`."""
        return self.log_odds_panel(60.0, 20.0, "single")

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the log-odds of declaring against waiting, the same for each hypothesis, (N,
        M).
        """
        state = self.advance(observation, copy.deepcopy(state), episode_start)
        return np.broadcast_to(state.logits[:, None], state.posterior.shape)

    def select_tracks(self, state: AnchorState, tracks: BoolArray) -> AnchorState:
        """See `Decider.select_tracks`."""
        return state.select_tracks(tracks)
