"""The memory of the compiled core, declared once: records, the arrays of N tracks and of their
banks, and the parameters with their addresses. Allocation, addresses, saved states and their checks
follow from these declarations.

Tracks are stored in blocks of `LANES`. Every field of a block holds one number per track, so that a
loop over lanes has a constant stride and compiles to SIMD code. A named tuple of arrays declares
each of them by a default value `Array(dtype, sizes)`. A size is a number or a field of the
parameter record; the address is in the field with the name of the array.
"""

import functools
import math
import mmap
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import carray, types
from numpy.typing import NDArray

from hybrid_env.core.arrays import AnyArray, FloatArray
from hybrid_env.core.compilation import inlined, internal, intrinsic

# Tracks per block. Eight float64 fill a cache line and the widest vector register.
LANES = 8


State = tuple[float, float, float, float]
Triangle4 = tuple[float, float, float, float, float, float, float, float, float, float]
"""Covariance of [x, vx, y, vy], upper triangle row by row."""


def lanes_of(**fields: Any) -> np.dtype[Any]:
    """Return a record type of fields that hold one or k numbers of each track, of a type or (type,
    k), with the shape (LANES,) or (k, LANES).
    """
    kinds = {name: kind if isinstance(kind, tuple) else (kind,) for name, kind in fields.items()}
    return np.dtype([(name, kind, (*rows, LANES)) for name, (kind, *rows) in kinds.items()])


@internal
def four_of(array: FloatArray, k: int, lane: int) -> State:
    """Return the values k .. k + 3 of a lane of an array, (n, LANES)."""
    return array[k, lane], array[k + 1, lane], array[k + 2, lane], array[k + 3, lane]


@internal
def state_of(array: FloatArray, lane: int) -> State:
    """Return the values of a lane of an array, (4, LANES)."""
    return four_of(array, 0, lane)


@internal
def triangle_of(array: FloatArray, lane: int) -> Triangle4:
    """Return the values of a lane of an array, (10, LANES)."""
    last = array[8, lane], array[9, lane]
    return four_of(array, 0, lane) + four_of(array, 4, lane) + last


@internal
def write_four(array: FloatArray, k: int, lane: int, values: State) -> None:
    """Write the values k .. k + 3 of a lane of an array, (n, LANES)."""
    array[k, lane], array[k + 1, lane], array[k + 2, lane], array[k + 3, lane] = values


@internal
def write_lane(array: FloatArray, lane: int, values: tuple[float, ...]) -> None:
    """Write k values to a lane of an array, (k, LANES)."""
    for k, value in enumerate(values):
        array[k, lane] = value


SENSOR = np.dtype(
    [
        # [m]
        *((name, np.float64) for name in ("x", "y", "range")),
        # Of a coordinate or the range [m]; R over its square.
        ("deviation", np.float64),
        ("precision", np.float64),
        # [rad], 0 is a position sensor.
        ("bearing_deviation", np.float64),
        # Whether it measures a position.
        ("places", np.bool_),
        # First row of `rates` in `MEASURED`, and number of them; what they are, see `polar`, and
        # their deviations [m, rad, m/s].
        ("rate_row", np.int64),
        ("rates", np.int64),
        ("kinds", np.int64, 2),
        ("deviations", np.float64, 2),
        # [ticks]
        ("period", np.int64),
    ]
)
"""A sensor; see `hybrid_env.sensors`."""

# Numbers beside positions that the sensors of a list measure.
MOST_RATES = 4

MEASURED_FIELDS = {
    # [m], NaN without one.
    "measurement": (float, 2),
    # Covariance xx, xy, yy of the fused measurement over R.
    "noise": (float, 3),
    # What sensors measure beside positions, see `polar`, NaN if not measured.
    "rates": (float, MOST_RATES),
}
# What the sensors measure in a tick.
MEASURED = lanes_of(**MEASURED_FIELDS)

# Of a track whose modes climb or descend.
HEIGHT_FIELDS = {
    # True height and its rate [m, m/s].
    "true_height": (float, 2),
    # Measured [m], NaN without a measurement.
    "height": float,
    # Of the estimate at the switch [m].
    "anchor_height": float,
    # [z, vz] of the active filter, or merged over the bank, and their variances.
    "height_estimate": (float, 2),
    "height_variances": (float, 2),
}
# In `info` of ticks with a measurement only.
MEASURED_NAMES = "measurement", "innovations", "height"
TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""The fields of a block that describe the current tick, in the order of `info`."""

BLOCK = lanes_of(
    # [x, vx, y, vy] [m, m/s].
    truth=(float, 4),
    # sqrt(Q) of the object in this episode [m/s].
    process_deviation=float,
    measurement=MEASURED_FIELDS["measurement"],
    # Of the active filter, or merged over the bank.
    estimate=(float, 4),
    segment=int,
    true_mode=int,
    # Since the switch, or the beginning of the episode; 1 at the first measurement.
    tick=int,
    # Initial state of the bank: the estimate, or the true state for the oracle.
    anchor=(float, 4),
    # Object and measurements.
    random_state=(np.uint64, 4),
    # [m]
    true_centre=(float, 2),
    # From `motion.motion_coefficients`.
    true_motion=(float, 3),
    # [m/s^2], of a mode of the user.
    true_acceleration=(float, 2),
    # Of the segment [ticks].
    length=int,
    # Ticks of the episode, only counted for the periods of sensors.
    clock=int,
    noise=MEASURED_FIELDS["noise"],
    rates=MEASURED_FIELDS["rates"],
    # Of the estimate, at the switch or, if switches are unknown, in the tick: upper triangle row by
    # row.
    covariance=(float, 10),
    # Announced switches
    # Unit vector of the anchor's velocity.
    heading=(float, 2),
    # Of the anchor [m/s].
    speed=float,
    # Of the estimated position, summed over the segment [m^2].
    squared_error=float,
    # The last decided mode, q_A of ATE.
    active_mode=int,
    # Rows written to the trace in this step.
    trace_length=int,
    # Unknown switches
    # Ticks of the episode, 1 at the first measurement.
    time=int,
    # The last statement; only valid if `stated_ticks` > 0.
    stated_mode=int,
    # Number of consecutive statements of this mode, 0 before the first.
    stated_ticks=int,
    **HEIGHT_FIELDS,
)
"""State of `LANES` tracks."""


BANK_COLUMNS = {"innovations": 2, "innovation_covariances": 3, "estimates": 4, "covariances": 10}
"""Columns of what is told of a filter at a tick: innovation (x, y) [m], upper triangles of
covariances row by row, and the corrected estimate [x, vx, y, vy] [m, m/s].
"""

DECISION = ("decided_mode", "decided_true_mode", "ticks", "decided_length", "decided_squared_error")
"""Rows of the array of decisions made in a step; the last has the bits of a float64. Zero
without a decision.
"""

DECISION_FLAGS = ("has_decision", "correct", "type_correct", "forced")
"""Rows of the Boolean array of decisions; "correct" is by hypothesis or by type, as in the
reward.
"""

SEGMENT_COLUMNS = ("signed_radius", "mode", "length")
"""Columns of the segment table: radius [m], positive to the left; mode (hypothesis); length
[ticks].
"""

# States of a mode of the user: [x, vx, y, vy, ax, ay].
MOTION_STATES = 6

MOTION = np.dtype(
    [
        # Of a turn [m], positive to the left; 0 is a linear mode.
        ("signed_radius", np.float64),
        # Along the heading at the switch [m/s^2].
        ("acceleration", np.float64),
        # x' = F x + B + w of a tick, w of covariance Q, which is `noise` `noise`'.
        ("F", np.float64, (MOTION_STATES, MOTION_STATES)),
        ("B", np.float64, MOTION_STATES),
        ("Q", np.float64, (MOTION_STATES, MOTION_STATES)),
        ("noise", np.float64, (MOTION_STATES, MOTION_STATES)),
        # Vertical, of a mode that climbs or descends [m/s].
        ("climb_rate", np.float64),
        # Else the process noise is that of all modes, on the velocities.
        ("own_noise", np.bool_),
        # Else it is straight motion or a turn of a radius.
        ("linear", np.bool_),
        # Whether the object has no velocity: that in the state is the one with which it moves on.
        ("stands", np.bool_),
    ],
    align=True,
)
"""A mode of motion, see `hybrid_env.modes`."""

TRACE_COLUMNS = (
    "x",
    "vx",
    "y",
    "vy",
    "measured_x",
    "measured_y",
    "estimate_x",
    "estimate_y",
    "active_mode",
    "segment",
    "true_mode",
    "z",
    "measured_z",
    "estimate_z",
)
"""Columns of the trace. It has one row per tick of a step, including fast-forwarded ticks; with
unknown switches the active mode is the statement before the tick."""


@dataclass(frozen=True)
class Array:
    """The declaration of an array: its type, and its shape as numbers or fields of the parameter
    record.
    """

    dtype: Any
    sizes: tuple[int | str, ...]
    # Whose state it holds, "block" in a bank; "options" do not change, "thread" is temporary,
    # shared by its blocks.
    of: Literal["tracks", "block", "options", "thread"] = "tracks"


def declared(arrays: type, *owners: str) -> dict[str, Array]:
    """Return the declarations of a named tuple by name, of all owners or of some."""
    arrays_by_name: dict[str, Array] = vars(arrays)["_field_defaults"]
    return {
        name: array for name, array in arrays_by_name.items() if not owners or array.of in owners
    }


def aligned_zeros(
    shape: tuple[int, ...], dtype: Any, cache_line: int = 64, huge_page: int = 1 << 21
) -> AnyArray:
    """Return an array of zeros aligned to a cache line, so that the eight lanes of a field fill one
    line. Large arrays request huge pages: with pages of 4 kB the address cache misses every few
    tracks, which takes longer than the computation. cache_line, huge_page: in bytes.
    """
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    memory: NDArray[np.uint8]
    line = cache_line
    if size >= huge_page // 2 and hasattr(mmap, "MADV_HUGEPAGE"):
        line = huge_page
        # Private mapping: a forked process gets a copy, and huge pages require it.
        pages = mmap.mmap(-1, size + 2 * huge_page, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        # The system has no huge pages.
        with suppress(OSError):
            pages.madvise(mmap.MADV_HUGEPAGE)
        memory = np.frombuffer(pages, np.uint8)
    else:
        memory = np.zeros(size + cache_line, np.uint8)
    start = -memory.ctypes.data % line
    return memory[start : start + size].view(kind).reshape(shape)


def allocate(array: Array, sizes: Mapping[str, int] | np.void) -> AnyArray:
    """Return an array of zeros with the declared type and shape."""
    shape = tuple(size if isinstance(size, int) else int(sizes[size]) for size in array.sizes)
    return aligned_zeros(shape, array.dtype)


def address_as(kind: Any) -> Any:
    """Return the compiled function that converts an integer to a pointer of a type."""

    @intrinsic
    def convert(_typing: Any, address: Any) -> Any:
        def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(kind))

        return kind(address), build

    return convert


# For `numba.carray`.
_pointer_to = address_as(types.voidptr)


@internal
def parameters_at(address: int) -> Any:
    """Return the record `PARAMETERS` at an address; for compiled code only."""
    return carray(_pointer_to(address), (1,), PARAMETERS)[0]


def _joined(readers: list[Any]) -> Any:
    """Return the compiled function of the tuple of the values of compiled functions of two
    arguments. numba has no loop that builds a tuple of different types.
    """
    if len(readers) == 1:
        first = readers[0]
        return inlined(lambda setting, b: (first(setting, b),))
    half = len(readers) // 2
    left, right = _joined(readers[:half]), _joined(readers[half:])
    return inlined(lambda setting, b: left(setting, b) + right(setting, b))


def _size_reader(size: int | str) -> Any:
    if isinstance(size, str):
        return inlined(lambda setting, b: setting[size])
    return inlined(lambda setting, b: size)


def _array_reader(name: str, array: Array) -> Any:
    dtype, shape = array.dtype, _joined(list(map(_size_reader, array.sizes)))
    whole = internal(
        lambda setting, b: carray(_pointer_to(setting[name]), shape(setting, b), dtype)
    )
    return internal(lambda setting, b: whole(setting, b)[b]) if array.of == "block" else whole


@functools.cache
def reader(arrays: type) -> Callable[[type, Any, int], Any]:
    """Return the compiled function that finds the arrays of a named tuple by its class and a
    parameter record; of a bank those of block b.
    """
    values = _joined([_array_reader(name, array) for name, array in declared(arrays).items()])
    read: Callable[[type, Any, int], Any]
    read = internal(lambda kind, setting, b: kind(*values(setting, b)))
    return read


INNOVATION = lanes_of(
    # Innovation / standard deviation.
    white_x=float,
    white_y=float,
    # Ln of the innovation variance [m^2], mean of the axes.
    log_variance=float,
)
"""Innovation of one filter at the current tick."""


SUMS = Array(
    lanes_of(
        # Maximum log posterior, up to a constant.
        largest=float,
        # The first hypothesis with the maximum.
        likeliest=int,
        # Sum of the likelihoods of the others over the largest; 1 / (1 + this sum).
        others=float,
        inverse=float,
    ),
    (1,),
    "thread",
)
"""Of the posterior of a bank, see `banks.posterior`."""

LIKELIHOODS = Array(np.float64, ("modes", LANES), "thread")
"""Of the hypotheses, over the largest."""


class PublishedBank(NamedTuple):
    """The bank of a block of tracks, for n radii, M = 2n + 1 hypotheses and A = 1 or 2 distinct
    axes. Column 0 of covariances and gains is straight, column c uses radius c - 1. The blocks of a
    thread share innovations and gains.
    """

    # State of one filter.
    hypotheses: Any = Array(
        lanes_of(
            # Estimate [m, m/s].
            x=float,
            vx=float,
            y=float,
            vy=float,
            # Of the turn [m].
            centre_x=float,
            centre_y=float,
            # Cumulative since the switch.
            log_likelihood=float,
        ),
        ("blocks_count", "modes"),
        "block",
    )
    # Transition and covariance on one axis, shared by the filters of one radius.
    covariances: Any = Array(
        lanes_of(
            # Of the transition.
            cosine=float,
            sine_velocity=float,
            sine_position=float,
            # Of (position, velocity) [m^2, m^2/s, m^2/s^2].
            xx=float,
            xv=float,
            vv=float,
        ),
        ("blocks_count", "axes", "columns"),
        "block",
    )
    innovations: Any = Array(INNOVATION, ("modes",), "thread")
    # Gain and innovation variance on one axis at the current tick, shared in the same way.
    gains: Any = Array(
        lanes_of(
            # Of position and velocity.
            gain_x=float,
            gain_v=float,
            # 1 / standard deviation of the innovation [1/m].
            whitener=float,
            # Ln of the innovation variance [m^2].
            log_variance=float,
        ),
        ("axes", "columns"),
        "thread",
    )
    sums: Any = SUMS
    likelihoods: Any = LIKELIHOODS


AWARE_FIELDS: dict[str, Any] = {
    # Estimate [m, m/s].
    "x": float,
    "vx": float,
    "y": float,
    "vy": float,
    # Of the turn [m], or accelerations of a linear mode of the user [m/s^2].
    "centre_x": float,
    "centre_y": float,
    # [rad/s]
    "turn_rate": float,
    # Of the seven states, upper triangle row by row.
    "covariance": (float, 28),
    # Cumulative since the switch, or with unknown switches of the current tick.
    "log_likelihood": float,
}
AWARE_HYPOTHESIS = lanes_of(**AWARE_FIELDS)
"""State of one filter."""


class AnchorAwareBank(NamedTuple):
    """The bank of a block of tracks, M hypotheses. The blocks of a thread share all but the
    filters.
    """

    hypotheses: Any = Array(AWARE_HYPOTHESIS, ("blocks_count", "modes"), "block")
    innovations: Any = Array(INNOVATION, ("modes",), "thread")
    sums: Any = SUMS
    likelihoods: Any = LIKELIHOODS


HEIGHTS = Array(np.float64, ("blocks_count", "height_rows", 7, LANES), "block")
"""The filters of the heights of the hypotheses, see `banks.height`: estimate [z, vz] [m, m/s], its
covariance zz, zv, vv, innovation of the tick, NaN without a measurement, and its variance.
"""


class DenseBank(NamedTuple):
    """The same bank for modes of the user."""

    hypotheses: Any = Array(AWARE_HYPOTHESIS, ("blocks_count", "modes"), "block")
    innovations: Any = Array(INNOVATION, ("modes",), "thread")
    sums: Any = SUMS
    likelihoods: Any = LIKELIHOODS
    motions: Any = Array(MOTION, ("modes",), "options")
    heights: Any = HEIGHTS


IMM_HYPOTHESIS = lanes_of(
    # Estimate [m, m/s].
    x=float,
    vx=float,
    y=float,
    vy=float,
    # Upper triangle row by row.
    covariance=(float, 10),
    log_probability=float,
    # Of the current tick.
    log_likelihood=float,
)
DENSE_IMM_HYPOTHESIS = lanes_of(**AWARE_FIELDS, log_probability=float)
"""State of one filter, with unknown switches."""


class ImmBank(NamedTuple):
    """The bank of a block of tracks with unknown switches, M hypotheses."""

    hypotheses: Any = Array(IMM_HYPOTHESIS, ("blocks_count", "modes"), "block")
    innovations: Any = Array(INNOVATION, ("modes",), "thread")
    sums: Any = SUMS
    likelihoods: Any = LIKELIHOODS
    # Initial conditions of the filters in a tick.
    mixed: Any = Array(IMM_HYPOTHESIS, ("modes",), "thread")


class DenseImmBank(NamedTuple):
    """The same bank for modes of the user or any transition matrix."""

    hypotheses: Any = Array(DENSE_IMM_HYPOTHESIS, ("blocks_count", "modes"), "block")
    innovations: Any = Array(INNOVATION, ("modes",), "thread")
    sums: Any = SUMS
    likelihoods: Any = LIKELIHOODS
    mixed: Any = Array(DENSE_IMM_HYPOTHESIS, ("modes",), "thread")
    motions: Any = Array(MOTION, ("modes",), "options")
    # Probability of a mode (column) in a tick by that in the tick before.
    transitions: Any = Array(np.float64, ("modes", "modes"), "options")
    heights: Any = HEIGHTS
    mixed_heights: Any = Array(np.float64, HEIGHTS.sizes[1:], "thread")


class Arrays(NamedTuple):
    """The arrays of N tracks except their banks. A size is a field of `PARAMETERS`."""

    actions: Any = Array(np.int64, ("tracks",))
    blocks: Any = Array(BLOCK, ("blocks_count",))
    observations: Any = Array(np.float32, ("tracks", "width"))
    # 1 where an action counts; a declaration with 0 waits.
    action_mask: Any = Array(np.int8, ("tracks", "action_count"))
    # Every filter at the present tick, if it is asked for.
    bank_ticks: Any = Array(np.float64, ("tracks", "bank_rows", sum(BANK_COLUMNS.values())))
    rewards: Any = Array(np.float64, ("tracks",))
    terminated: Any = Array(np.bool_, ("tracks",))
    # Whether the random stream has been seeded.
    seeded: Any = Array(np.bool_, ("tracks",))
    trace: Any = Array(np.float64, ("tracks", "trace_rows", len(TRACE_COLUMNS)))
    decisions: Any = Array(np.int64, (len(DECISION), "tracks"))
    decision_flags: Any = Array(np.bool_, (len(DECISION_FLAGS), "tracks"))
    # Temporary values of one tick of one block, which the blocks of a thread share in the L1 cache.
    scratch: Any = Array(
        lanes_of(
            # 1 if the track advances in this tick.
            running=int,
            # From `noise.draw_noise`.
            noise=(float, 7),
            # ln(1 - maximum posterior), equal priors.
            log_error=float,
            # The likelihood of all other types over that of the likeliest one.
            type_ratio=float,
        ),
        (1,),
        "thread",
    )
    # Likelihoods of the types over the largest of a hypothesis, as in `scratch`.
    type_likelihoods: Any = Array(np.float64, ("type_count", LANES), "thread")
    # [m]
    radii: Any = Array(np.float64, ("radii_count",), "options")
    # Of every mode [1/m], positive to the left; and its type, from 0 on.
    curvatures: Any = Array(np.float64, ("modes",), "options")
    types: Any = Array(np.int64, ("modes",), "options")
    # See `scheme.segment_table`.
    table: Any = Array(np.float64, ("table_rows", len(SEGMENT_COLUMNS)), "options")
    # Cumulative probabilities of the durations of the first and of other segments, for unknown
    # switches, each by several laws; and the law of every mode.
    durations: Any = Array(np.float64, ("duration_rows", "ticks"), "options")
    law_places: Any = Array(np.int64, ("modes",), "options")
    # Probabilities of the next mode, by the present one; empty if all are equally likely.
    order: Any = Array(np.float64, ("order_rows", "order_rows"), "options")
    # The same of each track, and its law of durations, if they are drawn, else empty; see `habits`.
    drawn_order: Any = Array(np.float64, ("tracks", "drawn_modes", "drawn_modes"))
    drawn_law: Any = Array(np.float64, ("tracks", "drawn_laws", 2, 3))
    sensors: Any = Array(SENSOR, ("sensor_count",), "options")


_read_arrays = reader(Arrays)


@internal
def arrays_of(setting: Any) -> Any:
    """Return the `Arrays` at the addresses in a record `PARAMETERS`."""
    return _read_arrays(Arrays, setting, 0)


PARAMETERS = np.dtype(
    [
        *(
            (name, np.float64)
            for name in (
                # [s, m/s, rad]; NaN draws the heading uniformly.
                "tau",
                "speed",
                "heading",
                # Q [m^2/s^2], of the drift, and R of each axis [m^2].
                "process_variance",
                "drift_variance",
                # The same of the vertical rate, and R of the height.
                "climb_variance",
                "height_variance",
                "variance_x",
                "variance_y",
                # Smallest sqrt(Q) of an object [m/s], logarithm of the largest one over it, and
                # sqrt(R) of each axis [m].
                "process_deviation",
                "process_range",
                "deviation_x",
                "deviation_y",
                # Variances of the first estimate: over R, and [m^2/s^2].
                "initial_position",
                "initial_velocity",
                # Share of outliers, index, or degrees of freedom.
                "noise_shape",
                # Of a stable law, or ratio of the deviations of outliers; largest error over
                # sqrt(R).
                "noise_scale",
                "noise_clip",
                # Probability that a tick has no measurement, of each sensor.
                "missed",
                # 1: the anchor-aware bank treats centre and turn rate as exact.
                "exact_anchor",
                # Of the Student t likelihood of the bank; 0 is the normal one.
                "freedom",
                # Ln R, mean of the axes; 1 / sqrt(R) [1/m].
                "log_noise",
                "noise_whitener",
                # A declaration counts from this ln(1 - posterior) of a mode, or a type, on.
                "log_error_allowed",
                # Of a step, and of a change of the statement to a wrong mode.
                "delay_cost",
                "change_cost",
                # Entries of the transition matrix that the bank assumes.
                "stay_probability",
                "switch_probability",
            )
        ),
        *(
            (name, np.int64)
            for name in (
                # Of the measurements, see `noise`.
                "noise_law",
                # n radii, n + 1 with the straight line, M hypotheses, and their types.
                "radii_count",
                "columns",
                "modes",
                "type_count",
                # Number of distinct covariances, 1 or 2, and of actions.
                "axes",
                "action_count",
                # What the row holds, see `observation_row.OBSERVATIONS`.
                "observation",
                # M if every tick of the bank is recorded, or 0.
                "bank_rows",
                # M if modes climb or descend, or 0.
                "height_rows",
                # Between two decisions [ticks].
                "decide_every",
                # Of a random scheme, and of an episode with unknown switches.
                "segments",
                "shortest",
                "longest",
                "ticks",
                # Blocks first_block .. last_block - 1 are stepped.
                "tracks",
                "blocks_count",
                "first_block",
                "last_block",
                # Of arrays.
                "width",
                "trace_rows",
                "table_rows",
                "sensor_count",
                "duration_rows",
                # 0 or M; the last one 0 or 2.
                "order_rows",
                "drawn_modes",
                "drawn_laws",
            )
        ),
        *(
            (name, np.bool_)
            for name in (
                # Measurements may be missing or of different variances.
                "irregular",
                # The radius must be correct, not only the type.
                "exact",
                # An action declares the most likely hypothesis of a type.
                "declare_type",
                # See the option `undecided`.
                "keep_undecided",
                # All filters run on after a decision: the estimate is that of the bank.
                "merged",
                # An oracle bank is anchored at the true state.
                "reset_covariance",
                "oracle",
                "random_scheme",
                # The bank knows the first mode.
                "start_known",
                # Set by the kernel: the function of a law of the user has raised an exception.
                "noise_failed",
            )
        ),
        # The address of the function of a law of the user, see `noise`.
        ("noise_function", np.uintp),
        # The address of the kernel, see `bitcode`.
        ("kernel", np.uintp),
        # The addresses of the arrays.
        *(
            dict.fromkeys(
                (name, np.uintp)
                for arrays in (
                    Arrays,
                    PublishedBank,
                    AnchorAwareBank,
                    DenseBank,
                    ImmBank,
                    DenseImmBank,
                )
                for name in declared(arrays)
            )
        ),
    ]
)
"""The options of an environment in the form used by the kernel, and the addresses of its arrays.
Passing an array from Python takes longer than the tick of a track: the kernel is given the address
of such a record, one for each thread.
"""
