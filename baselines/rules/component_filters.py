"""Filters of the measurements in an observation, one bank for each component of the anchor. An
observation has the measurement relative to the anchor, in its heading frame, in which its velocity
is (speed, 0): all that a filter needs except the model, which is that of the world. With several
sensors it lacks the covariance of the measurement: then the filters also read what these measured.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.special import logsumexp

from baselines.rules.decider import Observations
from baselines.rules.measurements import in_heading_frame, in_rows, in_world, sensors_of
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, OwnState
from hybrid_env.compiled import (
    BANKS,
    LANES,
    MEASURED,
    AnchorAwareBank,
    FilterModel,
    aligned_zeros,
    bank_arrays,
    compiled,
    internal,
    operations,
    prepare,
    write_measured,
)
from hybrid_env.live import TRIANGLE
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

# The estimate [x, vx, y, vy], and the upper triangle of its covariance row by row.
ANCHOR_COLUMNS = 14


class NoiseLaw(NamedTuple):
    """What filters assume of the noise."""

    # Logarithm of the probability of the law before the first measurement, up to a constant.
    log_prior: float
    # Of most measurements, relative to R.
    variance: float
    # Of outliers, relative to R.
    outlier_variance: float
    # Logarithm of the share of outliers.
    log_outlier_odds: float
    # Squared whitened innovation from which a measurement counts as an outlier.
    distance: float


# Normal errors with an outlier in thirty, and heavy tails.
LAWS = NoiseLaw(0.0, 1.0, 25.0, -3.5, 14.0), NoiseLaw(-3.0, 2.0, 40.0, -2.3, 12.0)


class _Assumption(NamedTuple):
    """Filters that assume a law of the noise and an orientation of the heading frame."""

    # C N lanes: the tracks of one component after the other.
    banks: Any
    model: FilterModel
    outlier_model: FilterModel
    log_outlier_odds: float
    distance: float


@internal
def _step_lane(
    bank: Any,
    lane: int,
    measured: Any,
    sensors: AnyArray,
    model: FilterModel,
) -> None:
    """Advance the filters of one lane; a measurement NaN only predicts."""
    missing = math.isnan(measured.measurement[0, lane])
    if not missing and sensors.size == 0:
        operations.step(bank, lane, lane + 1, measured.measurement, model)
        return
    operations.predict(bank, lane, model)
    for h in range(0 if missing else bank.hypotheses.size):
        operations.correct(bank, lane, h, measured, sensors, model)


@internal
def _any_outlier(bank: Any, lanes: int, distance: float, outlier: BoolArray) -> bool:
    """Mark the lanes whose measurement no hypothesis explains; return whether there are any."""
    any_outlier = False
    for lane in range(lanes):
        smallest = distance
        for h in range(bank.hypotheses.size):
            innovation = bank.innovations[h]
            x = innovation.white_x[lane]
            y = innovation.white_y[lane]
            smallest = min(smallest, x * x + y * y)
        outlier[lane] = smallest >= distance
        any_outlier = any_outlier or outlier[lane]
    return any_outlier


@compiled
def _filter_tick(
    assumption: _Assumption,
    log_likelihood: FloatArray,
    innovations: FloatArray,
    begins: BoolArray,
    anchors: FloatArray,
    measurements: FloatArray,
    radii: FloatArray,
    sensors: AnyArray,
    saved: AnyArray,
    measured: AnyArray,
    outlier: BoolArray,
) -> None:
    """Start the filters of some tracks, (N,), at anchors (C, N, 14), then advance all by one tick.
    Likelihoods (C, N, M) and innovations (C, N, M, 3) are written. Measurements, see
    `sensing.write_measured`, are NaN if a tick has none. The others are memory; `saved`, (M,)
    hypotheses, is (0,) if outliers do not have a model of their assumption.
    """
    tracks = begins.size
    lanes_total = log_likelihood.shape[0] * tracks
    for b in range(assumption.banks.hypotheses.shape[0]):
        bank = operations.bank_of_block(assumption.banks, b)
        lanes = min(LANES, lanes_total - b * LANES)
        separate = sensors.size > 0
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            if begins[i]:
                a = anchors[c, i]
                anchor = (a[0], a[1], a[2], a[3])
                covariance = (a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13])
                operations.begin(bank, lane, anchor, covariance, radii, assumption.model)
            write_measured(measured[0], lane, measurements[i])
            separate = separate or math.isnan(measurements[i, 0])
        for h in range(saved.size):
            saved[h] = bank.hypotheses[h]
        if separate:
            for lane in range(lanes):
                _step_lane(bank, lane, measured[0], sensors, assumption.model)
        else:
            operations.step(bank, 0, lanes, measured[0].measurement, assumption.model)
        if saved.size > 0 and _any_outlier(bank, lanes, assumption.distance, outlier):
            for h in range(saved.size):
                bank.hypotheses[h] = saved[h]
            for lane in range(lanes):
                _step_lane(
                    bank,
                    lane,
                    measured[0],
                    sensors,
                    assumption.outlier_model if outlier[lane] else assumption.model,
                )
                for h in range(saved.size if outlier[lane] else 0):
                    bank.hypotheses[h].log_likelihood[lane] += assumption.log_outlier_odds
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            for h in range(bank.hypotheses.size):
                innovation = bank.innovations[h]
                target = innovations[c, i, h]
                log_likelihood[c, i, h] = bank.hypotheses[h].log_likelihood[lane]
                target[0] = innovation.white_x[lane]
                target[1] = innovation.white_y[lane]
                target[2] = innovation.log_variance[lane]


class ComponentFilters(OwnState):
    """One bank for each of N tracks and of C components of the distribution of its anchor. With
    `robust` a measurement that no hypothesis explains is an outlier, with a larger variance. There
    are filters for every law of `LAWS`, weighted by the likelihood of all measurements of the
    episode, and for three orientations of the heading frame if the axes have different variances.
    Otherwise these have their geometric mean.
    """

    # (C, N, M) of all measurements since the start of the filters.
    log_likelihood: FloatArray
    # (C, N, M, 3) whitened, along and across the heading, and logarithm of the variance [m^2]
    innovations: FloatArray
    # (laws, N) logarithms of the weights of the laws before the present segment.
    log_laws: FloatArray

    def __init__(
        self,
        bank: str,
        components: int,
        tracks: int,
        world: WorldOptions,
        robust: bool = False,
    ):
        self.bank = bank
        self.world = world
        self.robust = robust
        self.radii = np.array(world.radii)
        self.layout = Layout(world.hypotheses)
        x, y = np.broadcast_to(world.variances, 2).tolist()
        variances = [(float(np.sqrt(x * y)),) * 2]
        if robust and x != y:
            variances = [
                (x, y),
                (y, x),
                ((x + y) / 2, (x + y) / 2),
            ]
        shape = (components, tracks, world.hypotheses)
        blocks = -(-components * tracks // LANES)
        laws = LAWS if robust else LAWS[:1]
        # Log-likelihoods (laws, orientations, C, N, M).
        self._joint = np.zeros((len(laws), len(variances), *shape))
        self._innovations = np.zeros((*self._joint.shape, 3))
        kind = AnchorAwareBank if world.sensors else BANKS[bank]
        fields = {"tau": world.tau, "process_variance": world.process_variance}
        fields["exact_anchor"] = float(bank == "published")
        self.assumptions = [
            _Assumption(
                bank_arrays(kind, self.radii.size, 1 if x == y else 2, blocks),
                FilterModel(variance_x=law.variance * x, variance_y=law.variance * y, **fields),
                FilterModel(
                    variance_x=law.outlier_variance * x,
                    variance_y=law.outlier_variance * y,
                    **fields,
                ),
                law.log_outlier_odds,
                law.distance,
            )
            for law in laws
            for x, y in variances
        ]
        self.prior = np.array([[law.log_prior] for law in laws])
        self.log_laws = np.tile(self.prior, (1, tracks))
        saved = np.zeros(
            world.hypotheses if robust else 0,
            self.assumptions[0].banks.hypotheses.dtype,
        )
        self.memory = saved, aligned_zeros((1,), MEASURED), np.zeros(LANES, np.bool_)
        self.sensors = sensors_of(world)
        self.log_likelihood = np.zeros(shape)
        self.innovations = np.zeros((*shape, 3))
        none = np.zeros(0, np.bool_), np.zeros((components, 0, ANCHOR_COLUMNS)), np.zeros((0, 2))
        written = self._joint[0, 0], self._innovations[0, 0]
        prepare(
            _filter_tick,
            self.assumptions[0],
            *written,
            *none,
            self.radii,
            self.sensors,
            *self.memory,
        )

    def advance(
        self,
        rows: Observations,
        begins: BoolArray,
        anchors: FloatArray,
        log_weights: FloatArray,
        first: BoolArray,
        sensed: FloatArray | None = None,
    ) -> None:
        """Start the filters of tracks that begin, (N,), at anchors (C, N, 14), then advance all by
        a tick of rows. `log_weights`, (N, C), are of the components of the last segment; `first`,
        (N,), is True where an episode starts; `sensed` is from `sensed_of`.
        """
        if len(self.log_laws) > 1 and begins.any():
            self._weigh_laws(begins, log_weights, first)
        if self.world.sensors:
            measurements, anchors, heading = in_world(sensed, anchors)
        else:
            measurements = in_rows(self.layout, rows, self.world.missed > 0.0)
        shape = len(self.assumptions), *self.log_likelihood.shape
        written = zip(
            self.assumptions,
            self._joint.reshape(shape),
            self._innovations.reshape(*shape, 3),
            strict=True,
        )
        for arrays in written:
            _filter_tick(
                *arrays,
                begins,
                anchors,
                measurements,
                self.radii,
                self.sensors,
                *self.memory,
            )
        self._combine()
        if self.world.sensors:
            self.innovations = in_heading_frame(self.innovations, heading)

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

    def _weigh_laws(self, begins: BoolArray, log_weights: FloatArray, first: BoolArray) -> None:
        """Multiply the weights of the laws by the likelihood of the segment that has ended."""
        joint = self._joint[:, :, :, begins] + log_weights[begins].T[..., None]
        laws = self.log_laws[:, begins] + logsumexp(joint, axis=(1, 2, 4))
        laws = np.where(first[begins], self.prior, laws - laws.max(0))
        self.log_laws[:, begins] = laws - logsumexp(laws, axis=0)

    def state_arrays(self) -> dict[str, AnyArray]:
        """Return all arrays that determine the next ticks; writing into them changes the
        filters.
        """
        banks = {
            f"{k}.{name}.{field}": records[field]
            for k, assumption in enumerate(self.assumptions)
            for name, records in assumption.banks._asdict().items()
            for field in records.dtype.names
        }
        each = self._joint.reshape(len(self.assumptions), *self.log_likelihood.shape)
        likelihoods = {f"{k}.log_likelihood": values for k, values in enumerate(each)}
        return banks | likelihoods | {"log_laws": self.log_laws}

    def select_tracks(self, tracks: BoolArray) -> "ComponentFilters":
        """Return the filters of the tracks selected by a mask (N,)."""
        components = len(self.log_likelihood)
        selected = ComponentFilters(
            self.bank,
            components,
            int(tracks.sum()),
            self.world,
            self.robust,
        )
        lanes = np.flatnonzero(np.tile(tracks, components))
        blocks, lane = np.divmod(np.arange(lanes.size), LANES)
        selected.log_laws[:] = self.log_laws[:, tracks]
        selected._joint[:] = self._joint[:, :, :, tracks]
        for mine, others in zip(self.assumptions, selected.assumptions, strict=True):
            for old, new in zip(mine.banks, others.banks, strict=True):
                # The others are temporary memory.
                if old.ndim > 1 and len(old) == len(mine.banks.hypotheses):
                    for name in old.dtype.names:
                        new[name][blocks, ..., lane] = old[name][lanes // LANES, ..., lanes % LANES]
        return selected


def joint_posterior(log_likelihood: FloatArray, log_weights: FloatArray) -> FloatArray:
    """Return the posterior of components and equally likely hypotheses, (C, N, M), by logarithms
    of weights (N, C).
    """
    joint = log_likelihood + log_weights.T[..., None]
    share = np.exp(joint - joint.max((0, 2), keepdims=True))
    return np.asarray(share / share.sum((0, 2), keepdims=True))


def anchor_rows(
    layout: Layout,
    rows: Observations,
    mean: FloatArray | float,
    covariance: FloatArray,
) -> FloatArray:
    """Return anchors (N, 14): estimates of rows in the heading frame, with mean errors and
    covariances (N, 4, 4).
    """
    anchors = np.zeros((len(rows), ANCHOR_COLUMNS))
    anchors[:, 1] = layout.read(rows, "speed")
    anchors[:, :4] += mean
    anchors[:, 4:] = covariance[:, TRIANGLE[0], TRIANGLE[1]]
    return anchors


def stated_covariance(layout: Layout, rows: Observations) -> FloatArray:
    """Return the covariance of the anchor as stated by the bank, (N, 4, 4), the mean over the
    axes.
    """
    noise = np.exp(layout.read(rows, "log_noise"))
    xx, xv, vv = (
        noise * layout.read(rows, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv")
    )
    of_axis = np.moveaxis(np.array([[xx, xv], [xv, vv]]), -1, 0)
    return np.kron(np.eye(2), of_axis)
