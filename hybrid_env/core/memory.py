"""The memory of the compiled core, declared once: records, the arrays of N tracks and of their
banks, and the parameters with their addresses. Allocation, addresses, saved states and their checks
follow from these declarations.

Tracks are stored in blocks of `LANES`. Every field of a block holds one number per track, so that a
loop over lanes has a constant stride and compiles to SIMD code. A named tuple of arrays declares
each of them by `Annotated[NDArray[...], Array(dtype, sizes)]`. A size is a number or a field of the
parameter record; the address is in the field with the name of the array.
"""

import math
import mmap
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined, internal

FloatArray = NDArray[np.float64]
Flags = NDArray[np.bool_]
Records = NDArray[Any]
Owner = Literal["tracks", "options", "thread"]

# Tracks per block. Eight float64 fill a cache line and the widest vector register.
LANES = 8


State = tuple[float, float, float, float]
Triangle4 = tuple[float, float, float, float, float, float, float, float, float, float]
"""Covariance of [x, vx, y, vy], upper triangle row by row."""


def lanes_of(*fields: tuple[str, type, tuple[int, ...]]) -> np.dtype[Any]:
    """Return a record type whose fields have the shape (*shape, LANES)."""
    return np.dtype([(name, kind, (*shape, LANES)) for name, kind, shape in fields])


@inlined
def state_of(array: FloatArray, lane: int) -> State:
    """Return the values of a lane of an array, (4, LANES)."""
    return array[0, lane], array[1, lane], array[2, lane], array[3, lane]


@inlined
def triangle_of(p: FloatArray, lane: int) -> Triangle4:
    """Return the values of a lane of an array, (10, LANES)."""
    return (
        p[0, lane],
        p[1, lane],
        p[2, lane],
        p[3, lane],
        p[4, lane],
        p[5, lane],
        p[6, lane],
        p[7, lane],
        p[8, lane],
        p[9, lane],
    )


@inlined
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
        # [rad], 0 is a position sensor; [m/s].
        ("bearing_deviation", np.float64),
        ("rate_deviation", np.float64),
        # Of the range rate in `MEASURED`, -1 without one; [ticks].
        ("rate_row", np.int64),
        ("period", np.int64),
    ]
)
"""A sensor; see `hybrid_env.sensors`."""

# Radars of a list that measure the range rate.
MOST_RATES = 4

MEASURED_FIELDS = (
    # [m], NaN without one.
    ("measurement", np.float64, (2,)),
    # Covariance xx, xy, yy of the fused measurement over R.
    ("noise", np.float64, (3,)),
    # Range rates of the sensors with one [m/s], NaN if not measured.
    ("rates", np.float64, (MOST_RATES,)),
)
# What the sensors measure in a tick.
MEASURED = lanes_of(*MEASURED_FIELDS)

TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""The fields of a block that describe the current tick, in the order of `info`."""

BLOCK = lanes_of(
    # [x, vx, y, vy] [m, m/s].
    ("truth", np.float64, (4,)),
    MEASURED_FIELDS[0],
    # Of the active filter, or merged over the bank.
    ("estimate", np.float64, (4,)),
    ("segment", np.int64, ()),
    ("true_mode", np.int64, ()),
    # Since the switch, or the beginning of the episode; 1 at the first measurement.
    ("tick", np.int64, ()),
    # Initial state of the bank: the estimate, or the true state for the oracle.
    ("anchor", np.float64, (4,)),
    # Object and measurements.
    ("random_state", np.uint64, (4,)),
    # [m]
    ("true_centre", np.float64, (2,)),
    # From `motion.motion_coefficients`.
    ("true_motion", np.float64, (3,)),
    # Of the segment [ticks].
    ("length", np.int64, ()),
    # Ticks of the episode, only counted for the periods of sensors.
    ("clock", np.int64, ()),
    *MEASURED_FIELDS[1:],
    # Of the estimate, at the switch or, if switches are unknown, in the tick: upper triangle row by
    # row.
    ("covariance", np.float64, (10,)),
    # Announced switches
    # Unit vector of the anchor's velocity.
    ("heading", np.float64, (2,)),
    # Of the anchor [m/s].
    ("speed", np.float64, ()),
    # Of the estimated position, summed over the segment [m^2].
    ("squared_error", np.float64, ()),
    # The last decided mode, q_A of ATE.
    ("active_mode", np.int64, ()),
    # Rows written to the trace in this step.
    ("trace_length", np.int64, ()),
    # Unknown switches
    # Ticks of the episode, 1 at the first measurement.
    ("time", np.int64, ()),
    # The last statement; only valid if `stated_ticks` > 0.
    ("stated_mode", np.int64, ()),
    # Number of consecutive statements of this mode, 0 before the first.
    ("stated_ticks", np.int64, ()),
)
"""State of `LANES` tracks."""

SCRATCH = lanes_of(
    # 1 if the track advances in this tick.
    ("running", np.int64, ()),
    # From `noise.draw_noise`.
    ("noise", np.float64, (7,)),
    # Maximum log-likelihood of the hypotheses.
    ("largest", np.float64, ()),
    # Number of other hypotheses with the maximum.
    ("ties", np.float64, ()),
    # ln(1 - maximum posterior), equal priors.
    ("log_error", np.float64, ()),
    # Likelihoods of straight, left and right over the largest of a hypothesis.
    ("types", np.float64, (3,)),
    # ln(1 - maximum posterior of a type), equal priors of the hypotheses.
    ("log_type_error", np.float64, ()),
)
"""Temporary values of one tick of one block. The blocks of a thread share this memory in the L1
cache.
"""

BANK_COLUMNS = {
    "innovations": 2,
    "innovation_covariances": 3,
    "estimates": 4,
    "covariances": 10,
}
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
)
"""Columns of the trace. It has one row per tick, including fast-forwarded ticks."""


@dataclass(frozen=True)
class Array:
    """The declaration of an array: its type, and its shape as numbers or fields of the parameter
    record.
    """

    dtype: Any
    sizes: tuple[int | str, ...]
    # Whose state it holds; "options" do not change, "thread" is temporary, shared by its blocks.
    of: Owner = "tracks"
    # Field with its address, if that is not its name: another view of the same memory.
    at: str = ""


def declared(arrays: type, *owners: Owner) -> dict[str, Array]:
    """Return the declarations of a named tuple by name, of all owners or of some; views are left
    out.
    """
    arrays_by_name = {name: array.__metadata__[0] for name, array in arrays.__annotations__.items()}
    return {
        name: array
        for name, array in arrays_by_name.items()
        if not array.at and (not owners or array.of in owners)
    }


def aligned_zeros(
    shape: tuple[int, ...],
    dtype: Any,
    cache_line: int = 64,
    huge_page: int = 1 << 21,
) -> NDArray[Any]:
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


def allocate(array: Array, sizes: Mapping[str, int] | np.void) -> NDArray[Any]:
    """Return an array of zeros with the declared type and shape."""
    shape = tuple(size if isinstance(size, int) else int(sizes[size]) for size in array.sizes)
    return aligned_zeros(shape, array.dtype)


@intrinsic
def _pointer_to(_typing: Any, address: Any) -> Any:
    """Convert an integer to a pointer for `numba.carray`."""

    def build(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(types.voidptr))

    return types.voidptr(address), build


@inlined
def array_at(address: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """Return the C-ordered array at an address; for compiled code only."""
    # Of an intrinsic, the type checker sees the typing context as an argument.
    return carray(_pointer_to(address), shape, dtype)  # type: ignore[call-arg]


# In compiled code a tuple of different types is built by a tree of functions, with one leaf for
# each element.


def _size_reader(size: int | str) -> Any:
    if isinstance(size, str):
        return inlined(lambda setting: setting[size])
    return inlined(lambda setting: size)


def _tuple_reader(readers: list[Any]) -> Any:
    """Return the compiled function of the tuple of the values of compiled functions of one
    argument.
    """
    if len(readers) == 1:
        first = readers[0]
        return inlined(lambda source: (first(source),))
    if len(readers) == 2:
        first, second = readers
        return inlined(lambda source: (first(source), second(source)))
    half = len(readers) // 2
    first = _tuple_reader(readers[:half])
    second = _tuple_reader(readers[half:])
    return inlined(lambda source: first(source) + second(source))


def _array_reader(name: str, array: Array) -> Any:
    address, dtype = array.at or name, array.dtype
    shape = _tuple_reader([_size_reader(size) for size in array.sizes])
    return inlined(lambda setting: array_at(setting[address], shape(setting), dtype))


def reader(arrays: type) -> Callable[[Any], Any]:
    """Return the compiled function that finds the arrays of a named tuple by a parameter record."""
    values = _tuple_reader(
        [
            _array_reader(name, array.__metadata__[0])
            for name, array in arrays.__annotations__.items()
        ]
    )
    read: Callable[[Any], Any] = inlined(lambda setting: arrays(*values(setting)))
    return read


def block_reader(bank: type) -> Callable[[Any, int], Any]:
    """Return the compiled function of the bank of one block, from the banks of all blocks."""

    def of_block(k: int, array: Array) -> Any:
        if array.of == "tracks":
            return inlined(lambda source: source[0][k][source[1]])
        return inlined(lambda source: source[0][k])

    values = _tuple_reader([of_block(k, array) for k, array in enumerate(declared(bank).values())])
    read: Callable[[Any, int], Any] = internal(lambda banks, block: bank(*values((banks, block))))
    return read


INNOVATION = lanes_of(
    # Innovation / standard deviation.
    *((name, np.float64, ()) for name in ("white_x", "white_y")),
    # Ln of the innovation variance [m^2], mean of the axes.
    ("log_variance", np.float64, ()),
)
"""Innovation of one filter at the current tick."""


HYPOTHESIS = lanes_of(
    # Estimate [m, m/s].
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),
    # Of the turn [m].
    *((name, np.float64, ()) for name in ("centre_x", "centre_y")),
    # Cumulative since the switch.
    ("log_likelihood", np.float64, ()),
)
"""State of one filter."""

COVARIANCE = lanes_of(
    # Of the transition.
    *((name, np.float64, ()) for name in ("cosine", "sine_velocity", "sine_position")),
    # Of (position, velocity) [m^2, m^2/s, m^2/s^2].
    *((name, np.float64, ()) for name in ("xx", "xv", "vv")),
)
"""Transition and covariance on one axis, shared by the filters of one radius."""

GAIN = lanes_of(
    # Of position and velocity.
    *((name, np.float64, ()) for name in ("gain_x", "gain_v")),
    # 1 / standard deviation of the innovation [1/m].
    ("whitener", np.float64, ()),
    # Ln of the innovation variance [m^2].
    ("log_variance", np.float64, ()),
)
"""Gain and innovation variance on one axis at the current tick, shared by the filters of one
radius.
"""


class PublishedBank(NamedTuple):
    """The bank of a block of tracks, for n radii, M = 2n + 1 hypotheses and A = 1 or 2 distinct
    axes. Column 0 of covariances and gains is straight, column c uses radius c - 1. The blocks of a
    thread share innovations and gains.
    """

    hypotheses: Annotated[Records, Array(HYPOTHESIS, ("blocks_count", "modes"))]
    covariances: Annotated[Records, Array(COVARIANCE, ("blocks_count", "axes", "columns"))]
    innovations: Annotated[Records, Array(INNOVATION, ("modes",), "thread")]
    gains: Annotated[Records, Array(GAIN, ("axes", "columns"), "thread")]


AWARE_HYPOTHESIS = lanes_of(
    # Estimate [m, m/s].
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),
    # Of the turn [m].
    *((name, np.float64, ()) for name in ("centre_x", "centre_y")),
    # [rad/s]
    ("turn_rate", np.float64, ()),
    # Of the seven states, upper triangle row by row.
    ("covariance", np.float64, (28,)),
    # Cumulative since the switch.
    ("log_likelihood", np.float64, ()),
)
"""State of one filter."""


class AnchorAwareBank(NamedTuple):
    """The bank of a block of tracks, M hypotheses. The blocks of a thread share the innovations."""

    hypotheses: Annotated[Records, Array(AWARE_HYPOTHESIS, ("blocks_count", "modes"))]
    innovations: Annotated[Records, Array(INNOVATION, ("modes",), "thread")]


SUMS = lanes_of(("largest", np.float64, ()), ("total", np.float64, ()))
"""Maximum log probability of the hypotheses before normalization, and the sum relative to it."""


IMM_HYPOTHESIS = lanes_of(
    # Estimate [m, m/s].
    *((name, np.float64, ()) for name in ("x", "vx", "y", "vy")),
    # Upper triangle row by row.
    ("covariance", np.float64, (10,)),
    ("log_probability", np.float64, ()),
    # Of the current tick.
    ("log_likelihood", np.float64, ()),
)
"""State of one filter."""


class ImmBank(NamedTuple):
    """The bank of a block of tracks, M hypotheses. The blocks of a thread share innovations and
    sums.
    """

    hypotheses: Annotated[Records, Array(IMM_HYPOTHESIS, ("blocks_count", "modes"))]
    innovations: Annotated[Records, Array(INNOVATION, ("modes",), "thread")]
    sums: Annotated[Records, Array(SUMS, (1,), "thread")]


BANKS: dict[str, type] = {
    "published": PublishedBank,
    "oracle": PublishedBank,
    "anchor_aware": AnchorAwareBank,
}
"""The bank of each value of the option `bank`."""


class Arrays(NamedTuple):
    """The arrays of N tracks except their banks. A size is a field of `PARAMETERS`."""

    actions: Annotated[NDArray[np.int64], Array(np.int64, ("tracks",))]
    blocks: Annotated[Records, Array(BLOCK, ("blocks_count",))]
    observations: Annotated[NDArray[np.float32], Array(np.float32, ("tracks", "width"))]
    # 1 where an action counts; a declaration with 0 waits.
    action_mask: Annotated[NDArray[np.int8], Array(np.int8, ("tracks", "action_count"))]
    # Every filter at the present tick, if it is asked for.
    bank_ticks: Annotated[
        FloatArray, Array(np.float64, ("tracks", "bank_rows", sum(BANK_COLUMNS.values())))
    ]
    rewards: Annotated[FloatArray, Array(np.float64, ("tracks",))]
    terminated: Annotated[Flags, Array(np.bool_, ("tracks",))]
    # Whether the random stream has been seeded.
    seeded: Annotated[Flags, Array(np.bool_, ("tracks",))]
    trace: Annotated[FloatArray, Array(np.float64, ("tracks", "trace_rows", len(TRACE_COLUMNS)))]
    decisions: Annotated[NDArray[np.int64], Array(np.int64, (len(DECISION), "tracks"))]
    decision_flags: Annotated[Flags, Array(np.bool_, (len(DECISION_FLAGS), "tracks"))]
    # The decisions again: one row has the bits of a float64.
    decided_numbers: Annotated[
        FloatArray, Array(np.float64, (len(DECISION), "tracks"), at="decisions")
    ]
    # Squared position error of every filter, summed over the segment, if it may be recalculated
    # [m^2].
    errors: Annotated[FloatArray, Array(np.float64, ("blocks_count", "recalculated", LANES))]
    scratch: Annotated[Records, Array(SCRATCH, (1,), "thread")]
    # [m]
    radii: Annotated[FloatArray, Array(np.float64, ("radii_count",), "options")]
    # See `scheme.segment_table`.
    table: Annotated[FloatArray, Array(np.float64, ("table_rows", len(SEGMENT_COLUMNS)), "options")]
    # Cumulative probabilities of the durations of the first and of other segments, for unknown
    # switches, each of straight segments and of turns.
    durations: Annotated[FloatArray, Array(np.float64, (4, "ticks"), "options")]
    # Probabilities of the next mode, by the present one; empty if all are equally likely.
    order: Annotated[FloatArray, Array(np.float64, ("order_rows", "order_rows"), "options")]
    # The same of each track, and its law of durations, if they are drawn, else empty; see `habits`.
    drawn_order: Annotated[FloatArray, Array(np.float64, ("tracks", "drawn_modes", "drawn_modes"))]
    drawn_law: Annotated[FloatArray, Array(np.float64, ("tracks", "drawn_laws", 2, 3))]
    sensors: Annotated[Records, Array(SENSOR, ("sensor_count",), "options")]


# Return the `Arrays` at the addresses in a record `PARAMETERS`.
arrays_of = reader(Arrays)
PARAMETERS = np.dtype(
    [
        *(
            (name, np.float64)
            for name in (
                # [s, m/s, rad]; NaN draws the heading uniformly.
                "tau",
                "speed",
                "heading",
                # Q [m^2/s^2], and R of each axis [m^2].
                "process_variance",
                "variance_x",
                "variance_y",
                # sqrt(Q) of the object [m/s], and sqrt(R) of each axis [m].
                "process_deviation",
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
                # n radii, n + 1 with the straight line, M = 2 n + 1 hypotheses.
                "radii_count",
                "columns",
                "modes",
                # Number of distinct covariances, 1 or 2, and of actions.
                "axes",
                "action_count",
                # What the row holds, see `observation_row.OBSERVATIONS`.
                "observation",
                # M if every tick of the bank is recorded, or 0.
                "bank_rows",
                # M if a declaration recalculates the estimates since the switch, or 0.
                "recalculated",
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
                # 0 or M; the last one 0 or 2.
                "order_rows",
                "drawn_modes",
                "drawn_laws",
            )
        ),
        *(
            (name, np.bool_)
            for name in (
                # Measurements may be missing or of different variances; a sensor is a radar.
                "irregular",
                "radar",
                # The radius must be correct, not only the type.
                "exact",
                # An action declares the most likely hypothesis of a type.
                "declare_type",
                # Action 1 declares the most likely hypothesis; see the option `undecided`.
                "declare_best",
                "keep_undecided",
                # All filters run on after a decision: the estimate is that of the bank, or of the
                # likeliest.
                "merged",
                "refined",
                # An oracle bank is anchored at the true state.
                "reset_covariance",
                "oracle",
                "random_scheme",
                # The bank knows the first mode.
                "start_known",
            )
        ),
        # The addresses of the arrays.
        *(
            dict.fromkeys(
                (name, np.uintp)
                for arrays in (Arrays, *BANKS.values(), ImmBank)
                for name in declared(arrays)
            )
        ),
    ]
)
"""The options of an environment in the form used by the kernel, and the addresses of its arrays.
Passing an array from Python takes longer than the tick of a track: the kernel is given the address
of such a record, one for each thread.
"""
