"""Filters that start from learned distributions of the anchor error, as a decider, and its file.

At every switch `anchor_net` predicts the distribution of the anchor error, and extended Kalman filters of
every hypothesis start from its components. Where only the type of motion is rewarded, `regret_net` predicts
what a wrong radius costs in the next segment. The decider declares when the expected loss falls to alpha.

All inputs are without units (`dimensionless`), and left and right turns are mirror images. The same weights
therefore apply to objects of any size and to banks of any size.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.anchor_net import COMPONENTS, AnchorNet, stated_factor
from agents.learned.dimensionless import (
    LastRow,
    Scales,
    anchor_inputs,
    bias_of_bank,
    declared_side,
    ratios,
    turns_per_tick,
)
from agents.learned.network_settings import LARGEST_HIDDEN
from agents.learned.policy_file import load_weights, save_policy, unreadable_policy
from agents.learned.regret_net import RegretNet, regret_inputs
from baselines.deciders.component_filters import (
    ANCHOR_COLUMNS,
    ComponentFilters,
    anchor_rows,
    stated_covariance,
)
from baselines.deciders.decider import Actions, Observations
from baselines.deciders.msprt import likeliest_of_type, mode_types, other_types_sum, type_sums
from hybrid_env.checks import check_integer, reject
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

FloatArray = NDArray[np.float64]
SMALLEST = 1e-300
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


class TrackFilters:
    """The filters of N tracks in one or several worlds, started as the network predicts.

    Args:
        worlds: options, all with the same number of hypotheses.
        tracks: number of tracks of each.

    Attributes:
        last: what is remembered of the last row.
        anchor_samples: inputs (n, 22 + C), factor (n, 4, 4) and tracks (n,) of the anchors predicted in the
            last tick.
    """

    def __init__(self, worlds: Sequence[WorldOptions], tracks: Sequence[int]):
        self.layout = Layout(worlds[0].hypotheses)
        self.filters = [
            ComponentFilters("anchor_aware", COMPONENTS, count, world, robust=True)
            for world, count in zip(worlds, tracks, strict=True)
        ]
        self.splits = np.cumsum(tracks)[:-1]
        self.scales = Scales.of(worlds, tracks)
        total, M = int(sum(tracks)), self.layout.hypotheses
        self.log_weights = np.zeros((total, COMPONENTS))
        zeros = [np.zeros(total) for _ in range(3)]
        self.last = LastRow(
            np.full((total, M), 1 / M), np.full((total, COMPONENTS), 1 / COMPONENTS),
            np.zeros((total, M, 2)), *zeros,
        )  # fmt: skip
        self.anchor_samples: tuple[NDArray[np.float32], FloatArray, NDArray[np.int64]] | None = None

    def advance(self, net: AnchorNetworks, rows: Observations, first: NDArray[np.bool_]) -> FloatArray:
        """Process one row of every track; return the posterior of the hypotheses, (N, M).

        Args:
            net: predicts the anchors.
            rows: (N, width).
            first: (N,) True at the first tick of an episode, whose anchor is as the options say.
        """
        layout = self.layout
        ticks = layout.read(rows, "ticks")
        begins = ticks < 1.5
        anchors = np.zeros((COMPONENTS, len(rows), ANCHOR_COLUMNS))
        self.anchor_samples = None
        if begins.any():
            anchors[:, begins] = self._anchors(net, rows[begins], begins, first[begins])
        parts = zip(
            self.filters, np.split(rows, self.splits), np.split(begins, self.splits),
            np.split(anchors, self.splits, axis=1), strict=True,
        )  # fmt: skip
        for filters, own_rows, own_begins, own_anchors in parts:
            filters.advance(own_rows, own_begins, own_anchors)
        joint = np.concatenate([filters.log_likelihood for filters in self.filters], axis=1)
        joint += self.log_weights.T[..., None]
        share = np.exp(joint - joint.max((0, 2), keepdims=True))
        share /= share.sum((0, 2), keepdims=True)
        posterior = share.sum(0)
        innovations = np.concatenate([filters.innovations for filters in self.filters], axis=1)
        own = (share[..., None] * innovations).sum(0) / np.maximum(posterior, SMALLEST)[..., None]
        self.last = LastRow(
            posterior, share.sum(-1).T, bias_of_bank(layout, rows, own), ticks,
            layout.read(rows, "ticks_left"), layout.read(rows, "speed"),
        )  # fmt: skip
        return posterior

    def select_tracks(self, tracks: NDArray[np.bool_]) -> "TrackFilters":
        """Return the filters of the tracks selected by a mask (N,)."""
        parts = np.split(tracks, self.splits)
        selected = TrackFilters(
            [filters.world for filters in self.filters], [int(one.sum()) for one in parts]
        )
        selected.filters = [
            filters.select_tracks(part) for filters, part in zip(self.filters, parts, strict=True)
        ]
        selected.log_weights = self.log_weights[tracks]
        selected.last = self.last.select(tracks)
        return selected

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next ticks; writing into them changes the filters."""
        arrays = {f"last.{name}": array for name, array in vars(self.last).items()}
        arrays |= {
            "log_weights": self.log_weights,
        }
        for k, filters in enumerate(self.filters):
            arrays |= {f"filters.{k}.{name}": array for name, array in filters.state_arrays().items()}
        return arrays

    def _anchors(
        self, net: AnchorNetworks, rows: Observations, begins: NDArray[np.bool_], first: NDArray[np.bool_]
    ) -> FloatArray:
        """Return the anchors (C, n, 14) of the tracks that begin a segment, and set their weights."""
        layout, scales, last = self.layout, self.scales.select(begins), self.last.select(begins)
        log_weights = np.full((len(rows), COMPONENTS), -1e3)
        log_weights[:, 0] = 0.0
        mean = np.zeros((len(rows), COMPONENTS, 4))
        covariance = np.repeat(stated_covariance(layout, rows)[:, None], COMPONENTS, axis=1)
        later = np.flatnonzero(~first)
        if later.size:
            side = declared_side(layout, rows, last)
            inputs = anchor_inputs(layout, rows, scales, last, side)[later]
            factor = stated_factor(layout, rows, scales.tau, side)[later]
            log_weights[later], mean[later], covariance[later] = net.anchor.anchors(inputs, factor)
            self.anchor_samples = inputs, factor, np.flatnonzero(begins)[later]
        self.log_weights[begins] = log_weights
        return np.stack([anchor_rows(layout, rows, mean[:, k], covariance[:, k]) for k in range(COMPONENTS)])


def error_probabilities_and_best(
    posterior: NDArray[np.floating], by_type: bool | NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the hypothesis to declare and the posterior probabilities of a wrong type and a wrong radius.

    Args:
        posterior: (N, M).
        by_type: choose the most likely hypothesis of the most likely type instead of the most likely
            hypothesis; one value for all tracks, or (N,).

    Returns:
        Posterior of all other types, posterior of the other radii of the chosen type, and index of the chosen
        hypothesis, each (N,).
    """
    types = type_sums(posterior)
    best = np.where(by_type, likeliest_of_type(types, posterior), posterior.argmax(1))
    kind = mode_types(posterior.shape[1])
    same_type = kind == kind[best][:, None]
    same_type[np.arange(len(best)), best] = False
    return other_types_sum(types, kind[best]), np.where(same_type, posterior, 0.0).sum(1), best


@torch.no_grad()
def errors_and_best(
    net: AnchorNetworks,
    rows: Observations,
    scales: Scales,
    posterior: FloatArray,
    by_type: NDArray[np.bool_],
    alpha: FloatArray,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return the expected loss of a declaration in units of a wrong one, and the hypothesis to declare.

    If the hypothesis is rewarded, the loss is the posterior error probability of the most likely one. If only
    the type is rewarded, a wrong radius costs nothing at once, but the next anchor is less accurate. Its
    expected cost is added, and the radius may be the mean one instead of the most likely one.

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
    wrong_type, wrong_radius, best = error_probabilities_and_best(posterior, by_type)
    error = np.where(by_type, wrong_type, wrong_type + wrong_radius)
    chosen = np.flatnonzero(by_type & (error <= alpha))
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
    starting: NDArray[np.bool_]


class AnchorDecider:
    """Declares the most likely hypothesis once its posterior error probability is at most alpha.

    Args:
        net: trained network.
        world: options of the world; the filters use its model.
        alpha: threshold on the posterior error probability, in (0, 1].

    Raises:
        ArgumentError: alpha is out of range.
    """

    def __init__(self, net: AnchorNetworks, world: WorldOptions, alpha: float = 0.02):
        if not 0.0 < alpha <= 1.0:
            raise reject("alpha", alpha, "a number above 0, at most 1")
        self.net, self.world, self.alpha = net, world, alpha
        self.by_type = world.correctness == "type"

    def posterior(
        self, observation: Observations, state: Any, episode_start: NDArray[np.bool_] | None
    ) -> tuple[FloatArray, AnchorState]:
        """Return the posterior (N, M) after one tick, and the state."""
        rows = np.asarray(observation)
        tracks = len(rows)
        if state is None:
            state = AnchorState(
                TrackFilters([self.world], [tracks]),
                np.ones(tracks, np.bool_),
            )
        starting = state.starting if episode_start is None else state.starting | episode_start
        first = starting & (Layout.of_rows(rows).read(rows, "ticks") < 1.5)
        state.starting = starting & ~first
        return state.filters.advance(self.net, rows, first), state

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, AnchorState]:
        """See `Decider.predict`. The state is a `AnchorState`."""
        posterior, state = self.posterior(observation, state, episode_start)
        error, best = self.errors(observation, posterior, state)
        return np.where(error <= self.alpha, best + 1, 0), state

    def errors(
        self, observation: Observations, posterior: FloatArray, state: AnchorState
    ) -> tuple[FloatArray, NDArray[np.int64]]:
        """Return the expected loss of a declaration and the hypothesis to declare, see `errors_and_best`."""
        tracks = len(posterior)
        return errors_and_best(
            self.net, observation, state.filters.scales, posterior,
            np.full(tracks, self.by_type), np.full(tracks, self.alpha),
        )  # fmt: skip

    def select_tracks(self, state: AnchorState, tracks: NDArray[np.bool_]) -> AnchorState:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished tracks."""
        return AnchorState(state.filters.select_tracks(tracks), state.starting[tracks])


def check_declares_hypotheses(world: WorldOptions) -> None:
    """Refuse an environment in which only the most likely hypothesis of the bank can be declared."""
    if world.actions != "all":
        raise reject("actions", world.actions, "'all' for an agent that declares hypotheses")


def save_anchor(folder: Path, net: AnchorNetworks, card: dict[str, Any]) -> None:
    """Write weights and card. Each file is written atomically."""
    save_policy(folder, net.state_dict(), card)


def load_anchor(folder: Path, weights: dict[str, Tensor], card: dict[str, Any]) -> AnchorNetworks:
    """Return the network for the weights and card that `policy_file.load_policy` read from a folder.

    Raises:
        ArgumentError: weights and card do not match.
    """
    try:
        hidden = check_integer("hidden", card["recipe"]["entry"]["hidden"], maximum=LARGEST_HIDDEN)
        with torch.device("meta"):
            net = AnchorNetworks(hidden)
        load_weights(net, weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable_policy(folder, error) from None
    return net.eval()
