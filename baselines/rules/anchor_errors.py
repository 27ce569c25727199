"""Distribution of the error of the anchor, the estimate at a switch, computed from what is known at
the declaration. Each filter of a decider gives the state of the object if its hypothesis is true;
`propagation` gives the error for each hypothesis.
"""

from typing import ClassVar

import numpy as np

from baselines.estimation.mixture import mixture
from baselines.rules.component_filters import (
    Anchors,
    ComponentFilters,
    filter_records,
    speeds,
    stated_anchors,
)
from baselines.rules.decider import Observations
from baselines.rules.propagation import propagate_anchor
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, OwnState
from hybrid_env.compiled import LANES, FilterModel, run_compiled
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions


class AnchorErrors(OwnState):
    """A copy of the bank of the environment for each of N tracks, and the distribution of its error
    at the next switch.
    """

    # Of the distribution.
    components: ClassVar[int] = 4

    def __init__(self, tracks: int, world: WorldOptions):
        self.world, self.tracks = world, tracks
        self.layout = Layout(world.hypotheses)
        kind = "anchor_aware" if world.bank == "anchor_aware" else "published"
        self.bank = ComponentFilters(kind, 1, tracks, world, oriented=True)
        self.resets = bool(world.parameters()["reset_covariance"])
        # Ticks of the present segment, and ticks to the next switch, (N,).
        self.ticks = np.ones(tracks)
        self.ticks_left = np.zeros(tracks)
        # (N, 3) sum of the inverse covariances of the measurements of the sensors, times R.
        self.information = np.zeros((tracks, 3))
        # Of which lane 0 is used.
        self.memory = filter_records(1)
        # Range rates are left out.
        self.memory.measured["rates"] = np.nan

    def advance(self, rows: Observations, begins: BoolArray, sensed: FloatArray | None) -> None:
        """Start the bank of tracks that begin, (N,), and advance all by a tick of rows; `sensed` is
        from `split_sensed`.
        """
        anchors = stated_anchors(self.world, rows[begins])
        if self.resets:
            anchors.covariance[:] = np.eye(4)
        self.bank.advance(rows, begins, anchors, begins, sensed)
        self.ticks = np.rint(self.layout.read(rows, "ticks"))
        self.ticks_left = np.rint(self.layout.read(rows, "ticks_left"))
        if sensed is not None:
            self.information[begins] = 0.0
            inverse = inverted(sensed[:, 2:5])
            self.information += np.where(np.isnan(sensed[:, :1]), 0.0, inverse)

    def select_tracks(self, tracks: BoolArray) -> "AnchorErrors":
        """Return the copies of the tracks selected by a mask (N,)."""
        selected = AnchorErrors(int(tracks.sum()), self.world)
        selected.bank = self.bank.select_tracks(tracks)
        for name in ("ticks", "ticks_left", "information"):
            setattr(selected, name, getattr(self, name)[tracks])
        return selected

    def after(self, filters: ComponentFilters, rows: Observations, tracks: IntArray) -> Anchors:
        """Return the anchors of tracks (n,) that begin a segment. rows: (n, width) their first
        ones; filters: at the declaration.
        """
        share = filters.shares()[:, :, tracks].transpose(2, 0, 1, 3)
        of_course = share.reshape(len(tracks), -1)
        # The hypotheses of the twelve likeliest filters are propagated.
        chosen = np.argsort(-of_course, axis=1)[:, :12]
        weight = np.take_along_axis(of_course, chosen, axis=1)
        assumption, component, h = np.unravel_index(chosen, share.shape[1:])
        previous = self.layout.read(rows, "previous").argmax(-1)[:, None]
        # What runs on if the hypothesis is true.
        declared = h if self.world.follow == "bank" else np.broadcast_to(previous, h.shape)
        # Filters of less weight are not propagated.
        smallest = 1e-7
        likely = weight > smallest
        ticks = np.where(likely, self.ticks_left[tracks, None], 0)
        mean, covariance = self.errors_of(
            filters, assumption, component, h, declared, tracks, ticks
        )
        # The speed of the anchor is known.
        speed = mean[..., 4]
        variance = covariance[..., 4, 4] + (1e-6 * speed) ** 2
        gain = covariance[..., :4, 4] / variance[..., None]
        innovation = speeds(self.world, rows)[:, None] - speed
        log_weight = np.log(np.maximum(weight, smallest)) - 0.5 * (
            np.log(variance) + innovation**2 / variance
        )
        log_weight[~likely] = -np.inf
        weight = np.exp(log_weight - log_weight.max(1, keepdims=True))
        return merged(
            self.components,
            weight / weight.sum(1, keepdims=True),
            mean[..., :4] + gain * innovation[..., None],
            covariance[..., :4, :4] - gain[..., None] * covariance[..., None, :4, 4],
        )

    def errors_of(
        self,
        filters: ComponentFilters,
        assumption: IntArray,
        component: IntArray,
        hypothesis: IntArray,
        declared: IntArray,
        tracks: IntArray,
        ticks: AnyArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return means (n, K, 5) and covariances (n, K, 5, 5) of the errors of the anchor, and of
        its speed, in some ticks, if the state of the object is that of K filters, (n, K) each, of
        tracks (n,).
        """
        n, courses = hypothesis.shape
        of_bank = np.broadcast_to(tracks[:, None], hypothesis.shape)
        block, lane = np.divmod(component * self.tracks + of_bank, LANES)
        indices = assumption, block, hypothesis, lane, of_bank // LANES, declared, of_bank % LANES
        results = np.zeros((n * courses, 30))
        # As much information in every tick as on average.
        R = np.sqrt(self.world.variances[0] * self.world.variances[-1])
        R /= 1.0 if self.world.sensors else 1.0 - self.world.missed
        run_compiled(
            propagate_anchor,
            results,
            np.stack([*indices, ticks], axis=-1).reshape(-1, 8).astype(np.int64),
            np.repeat(self._noise(tracks), courses, axis=0),
            filters.noise_ratios,
            filters.filters,
            self.bank.filters[0],
            self.bank.sensors,
            FilterModel(self.world.tau, self.world.process_variance, float(R), float(R)),
            self.memory,
        )
        mean, covariance = np.split(results.reshape(n, courses, 30), [5], axis=-1)
        return mean, covariance.reshape(n, courses, 5, 5)

    def _noise(self, tracks: IntArray) -> FloatArray:
        """Return the covariance xx, xy, yy of a measurement over R, (n, 3), with sensors that of
        their mean information in this segment.
        """
        if not self.world.sensors:
            return self.bank.noise[tracks]
        # Where nothing was measured the errors are large.
        mean = self.information[tracks] / self.ticks[tracks, None] + [1e-9, 0.0, 1e-9]
        return inverted(mean)


def inverted(entries: FloatArray) -> FloatArray:
    """Return the entries xx, xy, yy of inverse matrices, (n, 3)."""
    xx, xy, yy = entries.T
    return np.stack([yy, -xy, xx], axis=-1) / (xx * yy - xy * xy)[:, None]


def merged(
    components: int, weight: FloatArray, mean: FloatArray, covariance: FloatArray
) -> Anchors:
    """Return mixtures of the heaviest of some components, weights (n, K), and of one that has the
    moments of all others.
    """
    order = np.argsort(-weight, axis=1)
    rows = np.arange(len(weight))[:, None]
    weight, mean, covariance = (values[rows, order] for values in (weight, mean, covariance))
    last = components - 1
    rest = np.maximum(weight[:, None, last:], 1e-300)
    total = rest.sum(-1)
    others = mixture(mean[:, last:], covariance[:, last:], rest / total[..., None])
    weight[:, last:components] = total
    mean[:, last:components], covariance[:, last:components] = others
    log_weights = np.log(np.maximum(weight[:, :components], 1e-300))
    return Anchors(log_weights, mean[:, :components], covariance[:, :components])
