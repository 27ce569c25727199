"""Filters that run on the measurements of an observation, one bank for each component of the anchor.

The environment reports the measurement relative to the anchor, in the heading frame of the anchor. In this
frame the anchor is at the origin and its velocity is (speed, 0), so that the observation determines
everything that a filter needs except the model, which is that of the world. With several sensors it does not
contain the covariance of the measurement: then the filters also read what the sensors measured.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.rules.measurements import sensors_of
from hybrid_env.checks import BoolArray, FloatArray, reject
from hybrid_env.core.arrays import aligned_zeros
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.anchor_aware import AnchorAwareBank
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.banks.sensing import write_measured
from hybrid_env.core.compilation import compiled, internal, prepare
from hybrid_env.core.records import LANES, MEASURED, MOST_RATES
from hybrid_env.core.state import BANKS
from hybrid_env.live import SQUARE
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions

Observations = NDArray[np.float32]
TRIANGLE = np.triu_indices(4)
OUTLIER_DISTANCE = 16.0  # squared whitened innovation from which a measurement counts as an outlier
OUTLIER_VARIANCE = 25.0  # assumed of outliers, relative to R
LOG_OUTLIER_ODDS = -4.6  # logarithm of the assumed share of outliers, one in a hundred
SENSED = 2 + 3 + MOST_RATES, 4, 2
"""Columns of `sensed_of`: what `sensing.write_measured` reads, the anchor, and its heading."""

ANCHOR_COLUMNS = 14
"""Columns of an anchor: the estimate [x, vx, y, vy], and the upper triangle of its covariance row by row."""


class _Orientation(NamedTuple):
    """Filters that assume an orientation of the heading frame; see `_filter_tick` for the fields."""

    banks: Any
    model: FilterModel
    outlier_model: FilterModel
    log_likelihood: FloatArray
    innovations: FloatArray


@internal
def _step_lane(bank: Any, lane: int, measured: Any, sensors: NDArray[Any], model: FilterModel) -> None:
    """Advance the filters of one lane; a measurement NaN only predicts."""
    missing = math.isnan(measured.measurement[0, lane])
    if not missing and sensors.size == 0:
        operations.step(bank, lane, lane + 1, measured.measurement, model)
        return
    operations.predict(bank, lane, model)
    for h in range(0 if missing else bank.hypotheses.size):
        operations.correct(bank, lane, h, measured, sensors, model)


@internal
def _any_outlier(bank: Any, lanes: int, outlier: BoolArray) -> bool:
    """Mark the lanes whose measurement no hypothesis explains; return whether there are any."""
    found = False
    for lane in range(lanes):
        smallest = OUTLIER_DISTANCE
        for h in range(bank.hypotheses.size):
            innovation = bank.innovations[h]
            x, y = innovation.white_x[lane], innovation.white_y[lane]
            smallest = min(smallest, x * x + y * y)
        outlier[lane] = smallest >= OUTLIER_DISTANCE
        found = found or outlier[lane]
    return found


@compiled
def _filter_tick(
    banks: Any,
    begins: BoolArray,
    anchors: FloatArray,
    measurements: FloatArray,
    radii: FloatArray,
    sensors: NDArray[Any],
    model: FilterModel,
    outlier_model: FilterModel,
    log_likelihood: FloatArray,
    innovations: FloatArray,
    saved: NDArray[Any],
    measured: NDArray[Any],
    outlier: BoolArray,
) -> None:
    """Start the filters of some tracks, (N,), at anchors (C, N, 14), then advance all by one tick.

    The C N lanes of the banks have the tracks of one component after the other. Measurements, (N, 2) or with
    sensors (N, 9), see `sensing.write_measured`, are NaN if a tick has none. `log_likelihood`, (C, N, M), and
    `innovations`, (C, N, M, 3), are written. `saved` is memory for the hypotheses of a block, (M,), or (0,)
    if outliers do not have a model of their own. Of its lanes, `measured`, (1,) record, and `outlier`,
    (LANES,), are memory too.
    """
    tracks = begins.size
    lanes_total = log_likelihood.shape[0] * tracks
    for b in range(banks.hypotheses.shape[0]):
        bank = operations.bank_of_block(banks, b)
        lanes = min(LANES, lanes_total - b * LANES)
        separate = sensors.size > 0
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            if begins[i]:
                a = anchors[c, i]
                anchor = (a[0], a[1], a[2], a[3])
                covariance = (a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13])
                operations.begin(bank, lane, anchor, covariance, radii, model)
            write_measured(measured[0], lane, measurements[i])
            separate = separate or math.isnan(measurements[i, 0])
        for h in range(saved.size):
            saved[h] = bank.hypotheses[h]
        if separate:
            for lane in range(lanes):
                _step_lane(bank, lane, measured[0], sensors, model)
        else:
            operations.step(bank, 0, lanes, measured[0].measurement, model)
        if saved.size > 0 and _any_outlier(bank, lanes, outlier):
            for h in range(saved.size):
                bank.hypotheses[h] = saved[h]
            for lane in range(lanes):
                _step_lane(bank, lane, measured[0], sensors, outlier_model if outlier[lane] else model)
                for h in range(saved.size if outlier[lane] else 0):
                    bank.hypotheses[h].log_likelihood[lane] += LOG_OUTLIER_ODDS
        for lane in range(lanes):
            c, i = divmod(b * LANES + lane, tracks)
            for h in range(bank.hypotheses.size):
                innovation = bank.innovations[h]
                log_likelihood[c, i, h] = bank.hypotheses[h].log_likelihood[lane]
                innovations[c, i, h, 0] = innovation.white_x[lane]
                innovations[c, i, h, 1] = innovation.white_y[lane]
                innovations[c, i, h, 2] = innovation.log_variance[lane]


class ComponentFilters:
    """One bank for each track and component of the distribution of its anchor.

    Args:
        bank: key of `hybrid_env.core.state.BANKS`.
        components: C.
        tracks: N.
        world: options of the world, whose model the filters use. They have one measurement variance, the
            geometric mean of the axes, because the orientation of the heading frame is unknown.
        robust: a measurement that no hypothesis explains is treated as an outlier, with a larger variance. If
            the axes have different variances, there are filters for three orientations of the heading frame.

    Attributes:
        log_likelihood: (C, N, M) of all measurements since the start of the filters.
        innovations: (C, N, M, 3) innovation of the last tick: whitened, along and across the heading, and
            the logarithm of its variance [m^2].
    """

    def __init__(self, bank: str, components: int, tracks: int, world: WorldOptions, robust: bool = False):
        self.bank, self.world, self.robust = bank, world, robust
        self.radii = np.array(world.radii)
        self.layout = Layout(world.hypotheses)
        x, y = np.broadcast_to(world.variances, 2).tolist()
        variances = [(float(np.sqrt(x * y)),) * 2]
        if robust and x != y:
            variances = [(x, y), (y, x), ((x + y) / 2, (x + y) / 2)]
        shape, blocks = (components, tracks, world.hypotheses), -(-components * tracks // LANES)
        kind = AnchorAwareBank if world.sensors else BANKS[bank]
        fields = {"tau": world.tau, "process_variance": world.process_variance}
        fields["exact_anchor"] = float(bank == "published")
        self.orientations = [
            _Orientation(
                bank_arrays(kind, self.radii.size, 1 if x == y else 2, blocks),
                FilterModel(variance_x=x, variance_y=y, **fields),
                FilterModel(variance_x=OUTLIER_VARIANCE * x, variance_y=OUTLIER_VARIANCE * y, **fields),
                np.zeros(shape), np.zeros((*shape, 3)),
            )
            for x, y in variances
        ]  # fmt: skip
        saved = np.zeros(world.hypotheses if robust else 0, self.orientations[0].banks.hypotheses.dtype)
        self.memory = saved, aligned_zeros((1,), MEASURED), np.zeros(LANES, np.bool_)
        self.log_likelihood, self.innovations = np.zeros(shape), np.zeros((*shape, 3))
        self.sensors = sensors_of(world)
        none = np.zeros(0, np.bool_), np.zeros((components, 0, ANCHOR_COLUMNS)), np.zeros((0, 2))
        banks, *rest = self.orientations[0]
        prepare(_filter_tick, banks, *none, self.radii, self.sensors, *rest, *self.memory)

    def advance(
        self, rows: Observations, begins: BoolArray, anchors: FloatArray, sensed: FloatArray | None = None
    ) -> None:
        """Start the filters of some tracks, then advance all by the measurement of their rows.

        Args:
            rows: (N, width).
            begins: (N,) tracks whose filters start.
            anchors: (C, N, 14), see `ANCHOR_COLUMNS`.
            sensed: (N, 15) from `sensed_of`; None without sensors.

        Raises:
            ArgumentError: the world has sensors, and `sensed` is None.
        """
        if self.world.sensors:
            if sensed is None:
                raise reject(
                    "observation", "a row of the environment", "what `observe` returns, with sensors"
                )
            measured, origin, heading = np.split(sensed, np.cumsum(SENSED[:2]), axis=1)
            _, *rest = self.orientations[0]
            _filter_tick(
                self.orientations[0].banks, begins, in_world(anchors, origin, heading),
                np.ascontiguousarray(measured), self.radii, self.sensors, *rest, *self.memory,
            )  # fmt: skip
            self.log_likelihood, found = self.orientations[0][3:]
            self.innovations = found.copy()
            c, s = heading.T[..., None]
            self.innovations[..., 0] = c * found[..., 0] + s * found[..., 1]
            self.innovations[..., 1] = c * found[..., 1] - s * found[..., 0]
            return
        deviation = np.exp(0.5 * self.layout.read(rows, "log_noise"))[:, None]
        names = ("displacement_along", "displacement_across")
        measurements = deviation * np.stack([self.layout.read(rows, name) for name in names], axis=-1)
        if self.world.missed > 0.0:
            measurements[without_measurement(self.layout, rows)] = np.nan
        for banks, *rest in self.orientations:
            _filter_tick(banks, begins, anchors, measurements, self.radii, self.sensors, *rest, *self.memory)
        if len(self.orientations) == 1:
            self.log_likelihood, self.innovations = self.orientations[0][3:]
            return
        joint = np.stack([one.log_likelihood for one in self.orientations])
        largest = joint.max(0)
        share = np.exp(joint - largest)
        self.log_likelihood = largest + np.log(share.mean(0))
        share /= share.sum(0)
        each = np.stack([one.innovations for one in self.orientations])
        self.innovations = (share[..., None] * each).sum(0)

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all arrays that determine the next ticks; writing into them changes the filters."""
        return {
            f"{k}.{name}.{field}": records[field]
            for k, one in enumerate(self.orientations)
            for name, records in one.banks._asdict().items()
            for field in records.dtype.names
        }

    def select_tracks(self, tracks: BoolArray) -> "ComponentFilters":
        """Return the filters of the tracks selected by a mask (N,)."""
        components = len(self.log_likelihood)
        selected = ComponentFilters(self.bank, components, int(tracks.sum()), self.world, self.robust)
        lanes = np.flatnonzero(np.tile(tracks, components))
        blocks, lane = np.divmod(np.arange(lanes.size), LANES)
        for mine, others in zip(self.orientations, selected.orientations, strict=True):
            for old, new in zip(mine.banks, others.banks, strict=True):
                if old.ndim > 1 and len(old) == len(mine.banks.hypotheses):  # the others are temporary memory
                    for name in old.dtype.names:
                        new[name][blocks, ..., lane] = old[name][lanes // LANES, ..., lanes % LANES]
        return selected


def sensed_of(tracks: Any) -> FloatArray | None:
    """Return what the sensors of a `World` measured, anchors and headings, (N, 15); None without sensors."""
    names = ("measurement", "noise", "rates", "anchor", "heading")
    return np.hstack([tracks.field(name) for name in names]) if tracks.options.sensors else None


def observe_sensed(tracks: Any) -> NDArray[Any]:
    """Return the rows of a `World`, with sensors followed by `sensed_of`."""
    rows, sensed = tracks.take_rows(), sensed_of(tracks)
    return np.asarray(rows if sensed is None else np.hstack([rows, sensed]))


def split_sensed(layout: Layout, observation: NDArray[Any]) -> tuple[NDArray[Any], FloatArray | None]:
    """Return the rows of an observation, and `sensed_of` if it has it."""
    longer = observation.ndim == 2 and observation.shape[1] == layout.width + sum(SENSED)
    return (observation[:, : layout.width], observation[:, layout.width :]) if longer else (observation, None)


def in_world(anchors: FloatArray, origin: FloatArray, heading: FloatArray) -> FloatArray:
    """Return anchors (C, N, 14) in the heading frames of estimates (N, 4) as anchors in the world."""
    c, s = heading.T
    turn = np.zeros((len(heading), 4, 4))
    turn[:, (0, 1, 2, 3), (0, 1, 2, 3)] = c[:, None]
    turn[:, (0, 1), (2, 3)], turn[:, (2, 3), (0, 1)] = -s[:, None], s[:, None]
    turned = np.empty_like(anchors)
    turned[..., :4] = (turn @ anchors[..., :4, None])[..., 0] + origin * [1.0, 0.0, 1.0, 0.0]
    P = turn @ anchors[..., 4:][..., SQUARE] @ turn.swapaxes(1, 2)
    turned[..., 4:] = P[..., TRIANGLE[0], TRIANGLE[1]]
    return turned


def without_measurement(layout: Layout, rows: Observations) -> BoolArray:
    """Return whether the ticks of rows have no measurement, (N,): then all innovations are exactly zero."""
    names = ("innovation_along", "innovation_across")
    return ~np.any([layout.read(rows, name).any(-1) for name in names], axis=0)


def joint_posterior(log_likelihood: FloatArray, log_weights: FloatArray) -> FloatArray:
    """Return the joint posterior of components and hypotheses, (C, N, M); hypotheses have equal priors.

    Args:
        log_likelihood: (C, N, M).
        log_weights: (N, C) logarithms of the prior probabilities of the components.
    """
    joint = log_likelihood + log_weights.T[..., None]
    share = np.exp(joint - joint.max((0, 2), keepdims=True))
    return np.asarray(share / share.sum((0, 2), keepdims=True))


def anchor_rows(
    layout: Layout, rows: Observations, mean: FloatArray | float, covariance: FloatArray
) -> FloatArray:
    """Return the estimate in the heading frame with its covariance, (N, 14).

    Args:
        layout: layout of the rows.
        rows: (N, width).
        mean: (N, 4) mean error.
        covariance: (N, 4, 4).
    """
    anchors = np.zeros((len(rows), ANCHOR_COLUMNS))
    anchors[:, 1] = layout.read(rows, "speed")
    anchors[:, :4] += mean
    anchors[:, 4:] = covariance[:, TRIANGLE[0], TRIANGLE[1]]
    return anchors


def stated_covariance(layout: Layout, rows: Observations) -> FloatArray:
    """Return the covariance of the anchor as stated by the bank, (N, 4, 4), the mean over the axes."""
    noise = np.exp(layout.read(rows, "log_noise"))
    xx, xv, vv = (noise * layout.read(rows, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv"))
    covariance = np.zeros((len(rows), 4, 4))
    for k in (0, 2):
        covariance[:, k, k], covariance[:, k + 1, k + 1] = xx, vv
        covariance[:, k, k + 1] = covariance[:, k + 1, k] = xv
    return covariance
