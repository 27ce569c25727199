"""Filters of the measurements in an observation, one bank for each component of the anchor. An
observation has the measurement relative to the anchor, in its heading frame, in which its velocity
is (speed, 0): all that a filter needs except the model, which is that of the world. With several
sensors it lacks the covariance of the measurement: then the filters also read what these measured.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp, softmax

from baselines.rules.decider import Observations
from baselines.rules.measurements import (
    axes_in_rows,
    copy_filter,
    estimate_in,
    in_heading_frame,
    in_rows,
    in_world,
    own_filters,
    sensors_of,
)
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, OwnState
from hybrid_env.compiled import (
    AWARE_HYPOTHESIS,
    INNOVATION,
    LANES,
    MEASURED,
    MOST_RATES,
    SENSOR,
    FilterModel,
    aligned_zeros,
    begin_turn,
    compiled,
    internal,
    run_compiled,
    signed_radius,
    step_motion,
    write_measured,
)
from hybrid_env.live import TRIANGLE
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions


class NoiseLaw(NamedTuple):
    """What filters assume of the noise."""

    # Logarithm of the probability of the law before the first measurement, up to a constant.
    log_prior: float
    # Variance of most measurements, relative to R.
    variance: float
    # Variance of outliers, relative to R.
    outlier_variance: float
    # Logarithm of the share of outliers.
    log_outlier_odds: float
    # Squared whitened innovation from which a measurement counts as an outlier; infinite if none
    # does.
    distance: float


# Normal errors with an outlier in thirty, and heavy tails.
ASSUMED_LAWS = NoiseLaw(0.0, 1.0, 25.0, -3.5, 14.0), NoiseLaw(-3.0, 2.0, 40.0, -2.3, 12.0)


class FilterRecords(NamedTuple):
    """Temporary memory of filters, for M hypotheses of a block of tracks."""

    # (M,) records `AWARE_HYPOTHESIS`
    filters: AnyArray
    # (M,) records `INNOVATION`
    innovations: AnyArray
    # (1,) record `MEASURED`
    measured: AnyArray


def filter_records(hypotheses: int) -> FilterRecords:
    """Return memory for M hypotheses."""
    return FilterRecords(
        aligned_zeros((hypotheses,), AWARE_HYPOTHESIS),
        aligned_zeros((hypotheses,), INNOVATION),
        aligned_zeros((1,), MEASURED),
    )


class Anchors(NamedTuple):
    """Distributions of the estimates at a switch, of n tracks with C components each, in the
    heading frame.
    """

    # (n, C) logarithms of the weights.
    log_weights: FloatArray
    # (n, C, 4) mean of (true state - anchor).
    mean: FloatArray
    # (n, C, 4, 4) of the same.
    covariance: FloatArray


@internal
def _sense(
    bank: Any, memory: FilterRecords, first: int, last: int, sensors: AnyArray, model: FilterModel
) -> None:
    """Advance the filters of lanes first .. last - 1 by a tick."""
    for h in range(bank.size):
        step_motion(
            bank[h],
            memory.innovations[h],
            np.uint64(first),
            np.uint64(last),
            None,
            memory.measured[0],
            sensors,
            model,
        )


@compiled
def _filter_tick(
    filters: AnyArray,
    law: NoiseLaw,
    model: FilterModel,
    outlier_model: FilterModel,
    log_likelihood: FloatArray,
    innovations: FloatArray,
    begins: BoolArray,
    anchors: FloatArray,
    measurements: FloatArray,
    radii: FloatArray,
    sensors: AnyArray,
    memory: FilterRecords,
) -> None:
    """Start the filters of some tracks, (N,), at anchors (C, N, 14), then advance all by one tick.
    The filters, (blocks, M) records, have C N lanes: the tracks of one component after the other.
    Likelihoods (C, N, M) and innovations (C, N, M, 3) are written. Measurements, see
    `sensing.write_measured`, are NaN if a tick has none.
    """
    tracks = begins.size
    for b in range(filters.shape[0]):
        bank = filters[b]
        lanes = min(LANES, log_likelihood.shape[0] * tracks - b * LANES)
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            write_measured(memory.measured[0], lane, measurements[i])
            for h in range(bank.size if begins[i] else 0):
                anchor, covariance = estimate_in(anchors[c, i])
                radius = signed_radius(h, radii)
                begin_turn(bank[h], lane, anchor, covariance, radius, model)
        for h in range(bank.size):
            memory.filters[h] = bank[h]
        _sense(bank, memory, 0, lanes, sensors, model)
        for lane in range(lanes):
            smallest = math.inf
            for h in range(bank.size):
                x = memory.innovations[h].white_x[lane]
                y = memory.innovations[h].white_y[lane]
                smallest = min(smallest, x * x + y * y)
            if smallest >= law.distance:
                # No hypothesis explains the measurement.
                for h in range(bank.size):
                    copy_filter(memory.filters[h], lane, bank[h], lane)
                    bank[h].log_likelihood[lane] += law.log_outlier_odds
                _sense(bank, memory, lane, lane + 1, sensors, outlier_model)
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            for h in range(bank.size):
                innovation = memory.innovations[h]
                log_likelihood[c, i, h] = bank[h].log_likelihood[lane]
                innovations[c, i, h, 0] = innovation.white_x[lane]
                innovations[c, i, h, 1] = innovation.white_y[lane]
                innovations[c, i, h, 2] = innovation.log_variance[lane]


class ComponentFilters(OwnState):
    """One bank for each of N tracks and of C components of the distribution of its anchor: filters
    of `anchor_aware`, with an exact anchor those of `published`. With `robust` a measurement that
    no hypothesis explains is an outlier, with a larger variance. There are filters for every law of
    `ASSUMED_LAWS`, weighted by the likelihood of all measurements of the episode, and for three
    orientations of the heading frame if the axes have different variances. Otherwise these have
    their geometric mean. With `oriented` the rows of the published bank tell the axes.
    """

    # (C, N, M) of all measurements since the start of the filters.
    log_likelihood: FloatArray
    # (C, N, M, 3) whitened, along and across the heading, and logarithm of the variance [m^2]
    innovations: FloatArray
    # (laws, N) logarithms of the weights of the laws before the present segment.
    log_laws: FloatArray
    # (N, C) logarithms of the weights of the components.
    log_weights: FloatArray

    def __init__(
        self,
        bank: str,
        components: int,
        tracks: int,
        world: WorldOptions,
        robust: bool = False,
        oriented: bool = False,
    ):
        self.bank = bank
        self.world = world
        self.robust = robust
        self.layout = Layout(world.hypotheses)
        x, y = np.broadcast_to(world.variances, 2).tolist()
        variances = [(float(np.sqrt(x * y)),) * 2]
        # The published bank tells the axes.
        self.oriented = oriented and x != y and world.bank == "published"
        if robust and x != y and not self.oriented:
            variances = [(x, y), (y, x), ((x + y) / 2, (x + y) / 2)]
        laws = ASSUMED_LAWS if robust else (ASSUMED_LAWS[0]._replace(distance=math.inf),)
        # Its laws of the errors are its own.
        model = own_filters(world)._replace(freedom=0.0, exact_anchor=float(bank == "published"))
        # Laws of the noise and orientations of the heading frame, with the models of measurements
        # and of outliers.
        self.assumptions = [
            (
                law,
                model._replace(variance_x=law.variance * x, variance_y=law.variance * y),
                model._replace(
                    variance_x=law.outlier_variance * x, variance_y=law.outlier_variance * y
                ),
            )
            for law in laws
            for x, y in variances
        ]
        self.prior = np.array([[law.log_prior] for law in laws])
        self.log_laws = np.tile(self.prior, (1, tracks))
        self.log_weights = np.zeros((tracks, components))
        M = world.hypotheses
        self.filters = aligned_zeros(
            (len(self.assumptions), -(-components * tracks // LANES), M), AWARE_HYPOTHESIS
        )
        # Log-likelihoods (laws, orientations, C, N, M).
        self._joint = np.zeros((len(laws), len(variances), components, tracks, M))
        self._innovations = np.zeros((*self._joint.shape, 3))
        self.sensors = sensors_of(world)
        # Covariance xx, xy, yy of a measurement over R.
        self.noise = np.tile([1.0, 0.0, 1.0], (tracks, 1))
        if self.oriented:
            self.sensors = np.zeros(1, SENSOR)
        # Whether the axes are known, (N,).
        self.axes_known = np.zeros(tracks, np.bool_)
        self.memory = filter_records(M)
        self._combine()

    def advance(
        self,
        rows: Observations,
        begins: BoolArray,
        started: Anchors,
        first: BoolArray,
        sensed: FloatArray | None = None,
    ) -> None:
        """Start the filters of tracks that begin, (N,), at their anchors, n, then advance all by
        a tick of rows. `first`, (N,), is True where an episode starts; `sensed` is from
        `split_sensed`.
        """
        # Estimate and upper triangle of its covariance.
        anchors = np.zeros((*self.log_weights.T.shape, 14))
        if begins.any():
            self._weigh_laws(begins, first)
            log_weights, mean, covariance = started
            self.log_weights[begins] = log_weights
            moments = np.concatenate([mean, covariance[..., TRIANGLE[0], TRIANGLE[1]]], axis=-1)
            moments[..., 1] += speeds(self.world, rows[begins])[:, None]
            anchors[:, begins] = moments.swapaxes(0, 1)
        if self.world.sensors:
            measurements, anchors, heading = in_world(sensed, anchors)
        else:
            measurements = in_rows(self.world, rows)
        if self.oriented:
            measurements = self._with_noise(rows, begins, measurements)
        shape = len(self.assumptions), *self.log_likelihood.shape
        of_assumptions = zip(
            self.filters,
            self.assumptions,
            self._joint.reshape(shape),
            self._innovations.reshape(*shape, 3),
            strict=True,
        )
        of_tick = (
            begins,
            np.ascontiguousarray(anchors),
            measurements,
            np.array(self.world.radii),
            self.sensors,
            self.memory,
        )
        for arrays in of_assumptions:
            filters, assumption, *written = arrays
            run_compiled(_filter_tick, filters, *assumption, *written, *of_tick)
        self._combine()
        if self.world.sensors:
            self.innovations = in_heading_frame(self.innovations, heading)

    def _with_noise(
        self, rows: Observations, begins: BoolArray, measurements: FloatArray
    ) -> FloatArray:
        """Return measurements (N, 9) with their covariance over R in the heading frame."""
        self.axes_known[begins] = False
        new = ~self.axes_known & ~np.isnan(measurements[:, 0])
        if new.any():
            axes = axes_in_rows(self.world, rows[new], measurements[new])
            ratio = np.sqrt(self.world.variances.min() / self.world.variances.max())
            mean, half = (1.0 / ratio + ratio) / 2.0, (1.0 / ratio - ratio) / 2.0
            cosine, sine = half * axes.T
            self.noise[new] = np.stack([mean - cosine, -sine, mean + cosine], axis=-1)
            self.axes_known |= new
        rates = np.full((len(rows), MOST_RATES), np.nan)
        return np.hstack([measurements, self.noise, rates])

    def _combine(self) -> None:
        """Write likelihoods and innovations, weighted over laws and orientations."""
        if len(self.assumptions) == 1:
            self.log_likelihood = self._joint[0, 0]
            self.innovations = self._innovations[0, 0]
            return
        joint = self._joint + (self.log_laws - np.log(self._joint.shape[1]))[:, None, None, :, None]
        largest = joint.max((0, 1))
        share = np.exp(joint - largest)
        total = share.sum((0, 1))
        self.log_likelihood = largest + np.log(total)
        self.innovations = ((share / total)[..., None] * self._innovations).sum((0, 1))

    def _weigh_laws(self, begins: BoolArray, first: BoolArray) -> None:
        """Multiply the weights of the laws by the likelihood of the segment that has ended."""
        joint = self._joint[:, :, :, begins] + self.log_weights[begins].T[..., None]
        laws = self.log_laws[:, begins] + logsumexp(joint, axis=(1, 2, 4))
        laws = np.where(first[begins], self.prior, laws - laws.max(0))
        self.log_laws[:, begins] = laws - logsumexp(laws, axis=0)

    @property
    def noise_ratios(self) -> FloatArray:
        """Variance of the errors over that of a measurement, by each assumption."""
        return np.array([law.variance for law, _, _ in self.assumptions])

    @property
    def posterior(self) -> FloatArray:
        """Posterior of components and equally likely hypotheses, (C, N, M)."""
        return np.asarray(softmax(self.log_likelihood + self.log_weights.T[..., None], (0, 2)))

    def shares(self) -> FloatArray:
        """Return the posterior of every filter, (assumptions, C, N, M)."""
        joint = self._joint + self.log_laws[:, None, None, :, None] + self.log_weights.T[..., None]
        share = softmax(joint, (0, 1, 2, 4))
        return np.asarray(share.reshape(-1, *share.shape[2:]))

    def select_tracks(self, tracks: BoolArray) -> "ComponentFilters":
        """Return the filters of the tracks selected by a mask (N,)."""
        components = len(self.log_likelihood)
        count = int(tracks.sum())
        given = self.bank, components, count, self.world, self.robust, self.oriented
        selected = ComponentFilters(*given)
        for name in ("noise", "axes_known", "log_weights"):
            setattr(selected, name, getattr(self, name)[tracks])
        selected.log_laws[:] = self.log_laws[:, tracks]
        selected._joint[:] = self._joint[:, :, :, tracks]
        old = np.divmod(np.flatnonzero(np.tile(tracks, components)), LANES)
        new = np.divmod(np.arange(components * count), LANES)
        for name in AWARE_HYPOTHESIS.names or ():
            kept = self.filters[name][:, old[0], ..., old[1]]
            selected.filters[name][:, new[0], ..., new[1]] = kept
        return selected


def speeds(world: WorldOptions, rows: Observations) -> FloatArray:
    """Return the speeds of the anchors of rows, (N,) [m/s]."""
    return Layout(world.hypotheses).read(rows, "speed") * (world.deviation / world.tau)


def stated_covariance(world: WorldOptions, rows: Observations) -> FloatArray:
    """Return the covariance of the anchor as stated by the bank, (N, 4, 4), the mean over the
    axes.
    """
    layout = Layout(world.hypotheses)
    xx, xv, vv = (
        layout.read(rows, name) * (world.deviation**2 / world.tau**power)
        for power, name in enumerate(("anchor_xx", "anchor_xv", "anchor_vv"))
    )
    of_axis = np.moveaxis(np.array([[xx, xv], [xv, vv]]), -1, 0)
    return np.kron(np.eye(2), of_axis)


def stated_anchors(world: WorldOptions, rows: Observations, components: int = 1) -> Anchors:
    """Return anchors as the bank states them: one component, and others of weight 0."""
    log_weights = np.full((len(rows), components), -1e3)
    log_weights[:, 0] = 0.0
    covariance = stated_covariance(world, rows)[:, None]
    mean = np.zeros((*log_weights.shape, 4))
    return Anchors(log_weights, mean, np.repeat(covariance, components, axis=1))
