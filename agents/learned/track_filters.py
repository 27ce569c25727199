"""Filters of tracks, started from the distribution of the anchor error that a network predicts."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.learned.anchor_net import COMPONENTS, AnchorNet, stated_factor
from agents.learned.dimensionless import LastRow, Scales, anchor_inputs, bias_of_bank, declared_side
from baselines.rules.component_filters import (
    ANCHOR_COLUMNS,
    ComponentFilters,
    anchor_rows,
    joint_posterior,
    stated_covariance,
)
from baselines.rules.decider import Observations
from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

SMALLEST = 1e-300


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
        self.anchor_samples: tuple[NDArray[np.float32], FloatArray, IntArray] | None = None

    def advance(
        self, net: AnchorNet, rows: Observations, first: BoolArray, sensed: Sequence[FloatArray | None] | None = None
    ) -> FloatArray:
        """Process one row of every track; return the posterior of the hypotheses, (N, M).

        Args:
            net: predicts the anchors.
            rows: (N, width).
            first: (N,) True at the first tick of an episode, whose anchor is as the options say.
            sensed: of each world what its sensors measured, see `sensed_of`; None without sensors.
        """
        layout = self.layout
        ticks = layout.read(rows, "ticks")
        begins = ticks < 1.5
        anchors = np.zeros((COMPONENTS, len(rows), ANCHOR_COLUMNS))
        self.anchor_samples = None
        log_weights = self.log_weights.copy()
        if begins.any():
            anchors[:, begins] = self._anchors(net, rows[begins], begins, first[begins])
        parts = zip(
            self.filters,
            *(np.split(array, self.splits) for array in (rows, begins, anchors.swapaxes(0, 1))),
            *(np.split(array, self.splits) for array in (log_weights, first)),
            sensed or [None] * len(self.filters),
            strict=True,
        )
        for filters, own_rows, own_begins, own_anchors, *own in parts:
            filters.advance(own_rows, own_begins, own_anchors.swapaxes(0, 1), *own)
        log_likelihood = np.concatenate([filters.log_likelihood for filters in self.filters], axis=1)
        share = joint_posterior(log_likelihood, self.log_weights)
        posterior = share.sum(0)
        innovations = np.concatenate([filters.innovations for filters in self.filters], axis=1)
        own = (share[..., None] * innovations).sum(0) / np.maximum(posterior, SMALLEST)[..., None]
        self.last = LastRow(
            posterior, share.sum(-1).T, bias_of_bank(layout, rows, own), ticks,
            layout.read(rows, "ticks_left"), layout.read(rows, "speed"),
        )  # fmt: skip
        return posterior

    @property
    def heavy_tails(self) -> FloatArray:
        """Probability (N,) that the noise has heavy tails, from the segments before the present one."""
        return np.concatenate([np.exp(filters.log_laws[-1]) for filters in self.filters])

    def select_tracks(self, tracks: BoolArray) -> "TrackFilters":
        """Return the filters of the tracks selected by a mask (N,)."""
        parts = np.split(tracks, self.splits)
        selected = TrackFilters([filters.world for filters in self.filters], [int(one.sum()) for one in parts])
        selected.filters = [filters.select_tracks(part) for filters, part in zip(self.filters, parts, strict=True)]
        selected.log_weights = self.log_weights[tracks]
        selected.last = self.last.select(tracks)
        return selected

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next ticks; writing into them changes the filters."""
        arrays = {f"last.{name}": array for name, array in vars(self.last).items()}
        arrays["log_weights"] = self.log_weights
        for k, filters in enumerate(self.filters):
            arrays |= {f"filters.{k}.{name}": array for name, array in filters.state_arrays().items()}
        return arrays

    def _anchors(self, net: AnchorNet, rows: Observations, begins: BoolArray, first: BoolArray) -> FloatArray:
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
            log_weights[later], mean[later], covariance[later] = net.anchors(inputs, factor)
            self.anchor_samples = inputs, factor, np.flatnonzero(begins)[later]
        self.log_weights[begins] = log_weights
        return np.stack([anchor_rows(layout, rows, mean[:, k], covariance[:, k]) for k in range(COMPONENTS)])
