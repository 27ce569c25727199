"""Filters that start from learned distributions of the anchor error, as a decider.

At every switch a network (`anchor_net`) predicts the distribution of the anchor error, and extended Kalman
filters of every hypothesis start from its components. Where only the type of motion is rewarded, a second
network predicts what a wrong radius costs in the next segment. The decider declares when the expected loss
falls to alpha.

All inputs are without units (`dimensionless`), and left and right turns are mirror images. The same weights
therefore apply to objects of any size and to banks of any size.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import nn

from agents.learned.anchor_net import AnchorNet, RegretNet, regret_inputs
from agents.learned.dimensionless import Scales, ratios, turns_per_tick
from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.track_filters import TrackFilters
from baselines.rules.decider import Observations
from baselines.rules.measurements import observe_sensed, split_sensed
from baselines.rules.msprt import error_and_best, mode_types
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

HEAVY_TAILS = 2.7
"""Under heavy tails the stated loss is too small by this factor: on selection seeds, the threshold 0.02 then earns
as much as the best one under Lévy noise of index 1.5."""

REGRET_SHARE = 0.5  # a wrong declaration loses 2, from 1 to -1


class AnchorNetworks(nn.Module):
    """The two networks of the decider.

    Args:
        hidden: units of each hidden layer.
    """

    def __init__(self, hidden: int = 48):
        super().__init__()
        self.anchor = AnchorNet(hidden)
        self.regret = RegretNet(hidden)


@torch.no_grad()
def errors_and_best(
    net: AnchorNetworks,
    rows: Observations,
    scales: Scales,
    posterior: FloatArray,
    by_type: BoolArray,
    alpha: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Return the expected loss of a declaration in units of a wrong one, and the hypothesis to declare.

    If the hypothesis is rewarded, the loss is the posterior error probability of the most likely one. If only
    the type is rewarded, a wrong radius costs nothing at once, but the next anchor is less accurate. Its
    expected cost is added, and the radius may be the mean one instead of the most likely one. If all filters
    run on (`follow="bank"`), the next anchor does not depend on the declaration, and the cost is zero.

    Args:
        net: predicts the cost in the next segment.
        rows: (N, width).
        scales: of the worlds.
        posterior: (N, M).
        by_type: (N,) only the type is rewarded.
        alpha: (N,) the cost is added where the error probability is at most alpha.

    Returns:
        Loss (N,) and hypothesis (N,).
    """
    error, best = error_and_best(posterior, by_type)
    chosen = np.flatnonzero(by_type & (error <= alpha) & (scales.follows_bank == 0.0))
    if posterior.shape[1] == 3 or not chosen.size:
        return error, best
    layout = Layout.of_rows(rows)
    rows, scales, posterior = rows[chosen], scales.select(chosen), posterior[chosen]
    turn = turns_per_tick(layout, rows, scales)
    kind = mode_types(layout.hypotheses)
    same = kind == kind[best[chosen]][:, None]
    mean = (posterior * same * turn).sum(-1) / (posterior * same).sum(-1)
    candidates = [best[chosen], np.where(same, np.abs(turn - mean[:, None]), np.inf).argmin(-1)]
    motion, process, *_ = (np.broadcast_to(one[:, None], turn.shape) for one in ratios(layout, rows, scales))
    shared = [
        np.broadcast_to(one[:, None], turn.shape)
        for one in (layout.read(rows, "ticks_left"), scales.follows_bank, scales.anchor_aware)
    ]
    costs = []
    for candidate in candidates:
        declared = np.broadcast_to(turn[np.arange(len(turn)), candidate][:, None], turn.shape)
        regret = net.regret.regret(*regret_inputs(declared, turn, motion, process, *shared))
        costs.append((posterior * regret.numpy()).sum(-1))
    second = costs[1] < costs[0]
    best[chosen] = np.where(second, candidates[1], candidates[0])
    error[chosen] += REGRET_SHARE * np.where(second, costs[1], costs[0])
    return error, best


@dataclass
class AnchorState:
    """State of the decider for N tracks.

    Attributes:
        filters: of the tracks; changed in place.
        starting: (N,) an episode starts with the next first tick of a segment.
    """

    filters: TrackFilters
    starting: BoolArray


class AnchorDecider(PosteriorDecider):
    """Declares the best hypothesis once the expected loss of the declaration is at most alpha.

    Args:
        net: trained networks.
        world: options of the world; the filters use its model.
        alpha: threshold of the expected loss in units of a wrong declaration, in (0, 1]. If the hypothesis is
            rewarded, the loss is the posterior error probability.

    Raises:
        ArgumentError: alpha is out of range.
    """

    every_tick = True
    network = AnchorNetworks
    label = "learned anchors"

    def __init__(self, net: AnchorNetworks, world: WorldOptions, alpha: float = 0.02):
        super().__init__(net, world, alpha)
        self.observes = "tracks" if world.sensors else "rows"

    def observe(self, tracks: Any) -> Observations:
        """See `Decider.observe`: with sensors also what they measured."""
        return observe_sensed(tracks)

    def posterior(
        self, observation: Observations, state: Any, episode_start: BoolArray | None
    ) -> tuple[FloatArray, AnchorState]:
        """Return the posterior (N, M) after one tick, and the state."""
        rows, sensed = split_sensed(self.layout, np.asarray(observation))
        tracks = len(rows)
        if state is None:
            state = AnchorState(TrackFilters([self.world], [tracks]), np.ones(tracks, np.bool_))
        starting = state.starting if episode_start is None else state.starting | episode_start
        first = starting & (Layout.of_rows(rows).read(rows, "ticks") < 1.5)
        state.starting = starting & ~first
        return state.filters.advance(self.net.anchor, rows, first, [sensed]), state

    def errors(
        self, observation: Observations, posterior: FloatArray, state: AnchorState
    ) -> tuple[FloatArray, IntArray]:
        """Return the expected loss of a declaration and the hypothesis to declare, see `errors_and_best`.

        The loss is corrected by the probability that the noise of the track has heavy tails.
        """
        tracks = len(posterior)
        error, best = errors_and_best(
            self.net, split_sensed(self.layout, observation)[0], state.filters.scales, posterior,
            np.full(tracks, self.by_type), np.full(tracks, self.alpha),
        )  # fmt: skip
        return np.minimum(error * HEAVY_TAILS**state.filters.heavy_tails, 1.0), best

    def select_tracks(self, state: AnchorState, tracks: BoolArray) -> AnchorState:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished tracks."""
        return AnchorState(state.filters.select_tracks(tracks), state.starting[tracks])
