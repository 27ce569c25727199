"""Distribution of the error of the anchor, the estimate at a switch, computed from what is known at
the declaration. Each filter of a decider gives the state of the object if its hypothesis is true.
Up to the switch the object moves by this hypothesis, and the environment lets its filter of the
declared hypothesis run on. Both are linear but for the turn rate. Their joint normal distribution
is propagated tick by tick, and gives the error of the anchor for each hypothesis.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from baselines.rules.component_filters import (
    ComponentFilters,
    anchor_rows,
    stated_covariance,
)
from baselines.rules.decider import Observations
from baselines.rules.measurements import run_compiled
from baselines.rules.msprt import mode_types
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, OwnState
from hybrid_env.compiled import (
    AWARE_HYPOTHESIS,
    INNOVATION,
    LANES,
    MEASURED,
    TRACE_COLUMNS,
    FilterModel,
    State,
    aligned_zeros,
    compiled,
    internal,
    sense_hypothesis,
    turn_coefficients,
)
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

TRUTH = [TRACE_COLUMNS.index(name) for name in ("x", "vx", "y", "vy")]
# Of a filter: [x, vx, y, vy, centre_x, centre_y, turn_rate].
STATES = 7
# Entries of y in a covariance of the seven states, upper triangle row by row.
OF_Y = 2, 8, 13, 14, 15, 16, 17
# Filters of a decider whose hypotheses are propagated, the likeliest ones.
COURSES = 12
# Components of the distribution.
COMPONENTS = 4
# Smallest weight of a filter that is propagated.
NEGLIGIBLE = 1e-7


class _Memory(NamedTuple):
    """Temporary memory of a propagation."""

    # (14, 14) covariance of the seven states of the object and of the bank's filter.
    joint: FloatArray
    # (14,)
    mean: FloatArray
    # (2, 7) covariances of x and y of the bank's filter.
    measured_rows: FloatArray
    # (5, 14) from deviations of the states to error and speed.
    frame: FloatArray
    # (1,) record `AWARE_HYPOTHESIS`
    kalman: AnyArray
    # (1,) record `INNOVATION`
    innovation: AnyArray
    # (1,) record `MEASURED`
    measured: AnyArray


@internal
def _read_filter(
    kalman: Any,
    lane: int,
    mean: FloatArray,
    covariance: FloatArray,
) -> None:
    """Write the seven states of a filter, (7,), and their covariance, (7, 7)."""
    mean[0] = kalman.x[lane]
    mean[1] = kalman.vx[lane]
    mean[2] = kalman.y[lane]
    mean[3] = kalman.vy[lane]
    mean[4] = kalman.centre_x[lane]
    mean[5] = kalman.centre_y[lane]
    mean[6] = kalman.turn_rate[lane]
    entry = 0
    for i in range(STATES):
        for j in range(i, STATES):
            covariance[i, j] = kalman.covariance[entry, lane]
            covariance[j, i] = covariance[i, j]
            entry += 1


@internal
def _mix_rows(
    rows: FloatArray,
    position: int,
    centre: int,
    rate: int,
    turn: State,
    by_rate: tuple[float, float],
) -> None:
    """Replace the rows of a position and its velocity by combinations of both, of the centre and of
    the turn rate.
    """
    C, S, W, D = turn
    p = rows[position]
    v = rows[position + 1]
    c = rows[centre]
    moved = C * p + S * v + D * c + by_rate[0] * rows[rate]
    rows[position + 1] = C * v + W * (c - p) + by_rate[1] * rows[rate]
    rows[position] = moved


@internal
def _move(
    joint: FloatArray,
    mean: FloatArray,
    first: int,
    tau: float,
) -> None:
    """Move the seven states from `first` on by a tick, linearised in the turn rate."""
    rate = first + 6
    C, S, W, D, dC, dS, dW = turn_coefficients(mean[rate], tau)
    turn = (C, S, W, D)
    for axis in range(2):
        position = first + 2 * axis
        centre = first + 4 + axis
        offset = mean[position] - mean[centre]
        velocity = mean[position + 1]
        by_rate = (dC * offset + dS * velocity, dC * velocity - dW * offset)
        mean[position] = mean[centre] + C * offset + S * velocity
        mean[position + 1] = C * velocity - W * offset
        _mix_rows(
            joint,
            position,
            centre,
            rate,
            turn,
            by_rate,
        )
        _mix_rows(
            joint.T,
            position,
            centre,
            rate,
            turn,
            by_rate,
        )


@internal
def _correct_rows(rows: FloatArray, gains: FloatArray) -> None:
    """Add the gains times (position of the object - that of the filter) to the rows of the
    filter.
    """
    x = rows[0] - rows[STATES]
    y = rows[2] - rows[STATES + 2]
    for j in range(STATES):
        rows[STATES + j] += gains[0, j] * x + gains[1, j] * y


@internal
def _tick(
    memory: _Memory,
    lane: int,
    precision: FloatArray,
    noise: FloatArray,
    sensors: AnyArray,
    model: FilterModel,
) -> None:
    """Advance object and filter by a tick with a measurement. precision: (2, 2) inverse of its
    covariance in the model of the filter; noise: (2, 2) covariance of its errors.
    """
    joint = memory.joint
    mean = memory.mean
    kalman = memory.kalman[0]
    _move(joint, mean, 0, model.tau)
    _move(joint, mean, STATES, model.tau)
    joint[1, 1] += model.process_variance
    joint[3, 3] += model.process_variance
    memory.measured[0].measurement[0, lane] = mean[0]
    memory.measured[0].measurement[1, lane] = mean[2]
    sense_hypothesis(
        kalman,
        memory.innovation[0],
        np.uint64(lane),
        np.uint64(lane + 1),
        memory.measured[0],
        sensors,
        model,
    )
    # K = P H' / R with the corrected P.
    for j in range(STATES):
        memory.measured_rows[0, j] = kalman.covariance[j, lane]
        memory.measured_rows[1, j] = kalman.covariance[OF_Y[j], lane]
    gains = precision @ memory.measured_rows
    x = mean[0] - mean[STATES]
    y = mean[2] - mean[STATES + 2]
    mean[STATES:] += gains[0] * x + gains[1] * y
    _correct_rows(joint, gains)
    _correct_rows(joint.T, gains)
    joint[STATES:, STATES:] += gains.T @ (noise @ gains)


@internal
def _write_error(result: FloatArray, memory: _Memory) -> None:
    """Write the mean error (4,) of the anchor in its heading frame, its mean speed, and their
    covariance (5, 5), to first order in the deviations of the states.
    """
    mean = memory.mean
    frame = memory.frame
    speed = max(math.hypot(mean[STATES + 1], mean[STATES + 3]), 1e-12)
    c = mean[STATES + 1] / speed
    s = mean[STATES + 3] / speed
    frame[:] = 0.0
    # Position, then velocity.
    for j in range(2):
        x = mean[j] - mean[STATES + j]
        y = mean[j + 2] - mean[STATES + j + 2]
        along = c * x + s * y
        across = c * y - s * x
        result[j] = along
        result[j + 2] = across
        frame[j, j] = c
        frame[j, j + 2] = s
        frame[j + 2, j] = -s
        frame[j + 2, j + 2] = c
        frame[:4, STATES + j] = -frame[:4, j]
        frame[:4, STATES + j + 2] = -frame[:4, j + 2]
    # The heading deviates too.
    for j in range(4):
        turned = result[j + 2] if j < 2 else -result[j - 2]
        frame[j, STATES + 1] -= turned * s / speed
        frame[j, STATES + 3] += turned * c / speed
    result[4] = speed
    frame[4, STATES + 1] = c
    frame[4, STATES + 3] = s
    result[5:] = (frame @ (memory.joint @ frame.T)).ravel()


@compiled
def _propagate(
    results: FloatArray,
    courses: IntArray,
    noise: FloatArray,
    ratios: FloatArray,
    filters: AnyArray,
    bank: AnyArray,
    sensors: AnyArray,
    model: FilterModel,
    memory: _Memory,
) -> None:
    """Write what `_write_error` does, (K, 30), of K courses, (K, 8): assumption, block, hypothesis
    and lane of a filter of the decider; block, declared hypothesis and lane of the bank; ticks to
    the switch. noise: (K, 3), covariance of a measurement xx, xy, yy over R, and `ratios` of that
    of the errors by the assumptions.
    """
    R = np.empty((2, 2))
    for k in range(len(courses)):
        assumption, block, h, lane, bank_block, declared, bank_lane, ticks = courses[k]
        memory.kalman[0] = bank[bank_block, declared]
        memory.joint[:] = 0.0
        # Its covariance is replaced by that of the object: the state of the bank is known.
        _read_filter(
            memory.kalman[0],
            bank_lane,
            memory.mean[STATES:],
            memory.joint,
        )
        _read_filter(
            filters[assumption, block, h],
            lane,
            memory.mean[:STATES],
            memory.joint,
        )
        R[0, 0] = model.variance_x * noise[k, 0]
        R[0, 1] = model.variance_x * noise[k, 1]
        R[1, 0] = R[0, 1]
        R[1, 1] = model.variance_y * noise[k, 2]
        for row in range(3):
            memory.measured[0].noise[row, bank_lane] = noise[k, row]
        precision = np.linalg.inv(R)
        errors = ratios[assumption] * R
        for _ in range(ticks):
            _tick(
                memory,
                bank_lane,
                precision,
                errors,
                sensors,
                model,
            )
        _write_error(results[k], memory)


class AnchorErrors(OwnState):
    """A copy of the bank of the environment for each of N tracks, and the distribution of its error
    at the next switch.
    """

    def __init__(self, tracks: int, world: WorldOptions):
        self.world, self.tracks = world, tracks
        self.layout = Layout(world.hypotheses)
        kind = "anchor_aware" if world.bank == "anchor_aware" else "published"
        self.bank = ComponentFilters(
            kind,
            1,
            tracks,
            world,
            oriented=True,
        )
        self.resets = bool(world.parameters()["reset_covariance"])
        # Of the present segment, and to the next switch, (N,).
        self.ticks = np.ones(tracks)
        self.ticks_left = np.zeros(tracks)
        # (N, 3) sum of the inverse covariances of the measurements of the sensors, times R.
        self.information = np.zeros((tracks, 3))
        self.memory = _Memory(
            np.zeros((2 * STATES, 2 * STATES)),
            np.zeros(2 * STATES),
            np.zeros((2, STATES)),
            np.zeros((5, 2 * STATES)),
            aligned_zeros((1,), AWARE_HYPOTHESIS),
            aligned_zeros((1,), INNOVATION),
            aligned_zeros((1,), MEASURED),
        )
        # Range rates are left out.
        self.memory.measured["rates"] = np.nan

    def advance(
        self,
        rows: Observations,
        begins: BoolArray,
        sensed: FloatArray | None,
    ) -> None:
        """Start the bank of tracks that begin, (N,), and advance all by a tick of rows; `sensed` is
        from `sensed_of`.
        """
        covariance = stated_covariance(self.layout, rows)
        if self.resets:
            covariance[:] = np.eye(4)
        mean = np.zeros((self.tracks, 1, 4))
        log_weights = np.zeros((self.tracks, 1))
        anchors = anchor_rows(
            self.layout,
            rows,
            mean,
            covariance[:, None],
        )
        self.bank.advance(
            rows,
            begins,
            anchors,
            log_weights,
            begins,
            sensed,
        )
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

    def after(
        self,
        filters: ComponentFilters,
        log_weights: FloatArray,
        rows: Observations,
        tracks: IntArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return weights (n, C), means (n, C, 4) and covariances (n, C, 4, 4) of (true state -
        anchor) in the heading frame, [x, vx, y, vy], of tracks (n,) that begin a segment. rows: (n,
        width) their first ones; filters: at the declaration; log_weights: (N, C) of these.
        """
        share = filters.shares(log_weights)[:, :, tracks].transpose(2, 0, 1, 3)
        of_course = share.reshape(len(tracks), -1)
        chosen = np.argsort(-of_course, axis=1)[:, :COURSES]
        weight = np.take_along_axis(
            of_course,
            chosen,
            axis=1,
        )
        assumption, component, h = np.unravel_index(chosen, share.shape[1:])
        previous = self.layout.read(rows, "previous").argmax(-1)[:, None]
        # What runs on if the hypothesis is true.
        types = mode_types(self.world.hypotheses)
        refined = self.world.refine_radius & (types[h] == types[previous])
        declared = np.where(refined | (self.world.follow == "bank"), h, previous)
        likely = weight > NEGLIGIBLE
        ticks = np.where(likely, self.ticks_left[tracks, None], 0)
        indices = assumption, component, h, declared
        mean, covariance = self.errors_of(
            filters,
            *indices,
            tracks,
            ticks,
        )
        # The speed of the anchor is known.
        speed = mean[..., 4]
        variance = covariance[..., 4, 4] + (1e-6 * speed) ** 2
        gain = covariance[..., :4, 4] / variance[..., None]
        innovation = self.layout.read(rows, "speed")[:, None] - speed
        log_weight = np.log(np.maximum(weight, NEGLIGIBLE)) - 0.5 * (
            np.log(variance) + innovation**2 / variance
        )
        log_weight[~likely] = -np.inf
        weight = np.exp(log_weight - log_weight.max(1, keepdims=True))
        return merged(
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
        of_bank = np.broadcast_to(
            tracks[:, None],
            hypothesis.shape,
        )
        block, lane = np.divmod(
            component * self.tracks + of_bank,
            LANES,
        )
        indices = assumption, block, hypothesis, lane, of_bank // LANES, declared, of_bank % LANES
        results = np.zeros((n * courses, 30))
        # As much information in every tick as on average.
        R = np.sqrt(
            np.prod(
                np.broadcast_to(
                    self.world.variances,
                    2,
                )
            )
        )
        R /= 1.0 if self.world.sensors else 1.0 - self.world.missed
        run_compiled(
            _propagate,
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
    weight: FloatArray,
    mean: FloatArray,
    covariance: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mixtures (n, C) of the heaviest components of others, (n, K), and of one that has the
    moments of all others.
    """
    order = np.argsort(-weight, axis=1)
    weight = np.take_along_axis(
        weight,
        order,
        axis=1,
    )
    mean = np.take_along_axis(
        mean,
        order[..., None],
        axis=1,
    )
    covariance = np.take_along_axis(
        covariance,
        order[..., None, None],
        axis=1,
    )
    last = COMPONENTS - 1
    rest = np.maximum(weight[:, last:], 1e-300)
    total = rest.sum(1)
    share = rest / total[:, None]
    centre = np.einsum(
        "nk,nki->ni",
        share,
        mean[:, last:],
    )
    centred = mean[:, last:] - centre[:, None]
    spread = covariance[:, last:] + centred[..., None] * centred[..., None, :]
    covariance[:, last] = np.einsum(
        "nk,nkij->nij",
        share,
        spread,
    )
    mean[:, last] = centre
    weight[:, last] = total
    return (
        weight[:, :COMPONENTS],
        mean[:, :COMPONENTS],
        covariance[:, :COMPONENTS],
    )


def anchor_errors(env: HybridTrackVectorEnv, tracks: IntArray, before: FloatArray) -> FloatArray:
    """Return (true state - anchor) of tracks that have just been switched, (n, 4), in the heading
    frame. `env` has a trace longer than the longest segment; `before` are the true states before
    the step, (n, 4).
    """
    # The last tick of the segment.
    last = env.world.field("trace_length")[tracks] - 2
    anchor = env.world.field("anchor")[tracks]
    truth = np.where((last < 0)[:, None], before, env.world.trace[tracks, last][:, TRUTH])
    errors = truth - anchor
    along = anchor[:, [1, 3]] / np.maximum(np.hypot(anchor[:, 1], anchor[:, 3]), 1e-300)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    position = errors[:, [0, 2]]
    velocity = errors[:, [1, 3]]
    return np.stack(
        [(part * axis).sum(-1) for axis in (along, across) for part in (position, velocity)],
        axis=-1,
    )
