"""The state of N tracks, declared once: the arrays of the kernel, and the parameters with their
addresses. Allocation, addresses, saved states and their checks follow from these declarations and
those of the banks.
"""

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core import records
from hybrid_env.core.arrays import Array, FloatArray, Records, declared, reader
from hybrid_env.core.banks.anchor_aware import AnchorAwareBank
from hybrid_env.core.banks.imm import ImmBank
from hybrid_env.core.banks.published import PublishedBank
from hybrid_env.core.records import BLOCK, LANES, SCRATCH, SENSOR

Flags = NDArray[np.bool_]

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
        FloatArray, Array(np.float64, ("tracks", "bank_rows", sum(records.BANK_COLUMNS.values())))
    ]
    rewards: Annotated[FloatArray, Array(np.float64, ("tracks",))]
    terminated: Annotated[Flags, Array(np.bool_, ("tracks",))]
    # Whether the random stream has been seeded.
    seeded: Annotated[Flags, Array(np.bool_, ("tracks",))]
    trace: Annotated[
        FloatArray, Array(np.float64, ("tracks", "trace_rows", len(records.TRACE_COLUMNS)))
    ]
    decisions: Annotated[NDArray[np.int64], Array(np.int64, (len(records.DECISION), "tracks"))]
    decision_flags: Annotated[Flags, Array(np.bool_, (len(records.DECISION_FLAGS), "tracks"))]
    # The decisions again: one row has the bits of a float64.
    decided_numbers: Annotated[
        FloatArray, Array(np.float64, (len(records.DECISION), "tracks"), at="decisions")
    ]
    # Squared position error of every filter, summed over the segment, if it may be recalculated
    # [m^2].
    errors: Annotated[FloatArray, Array(np.float64, ("blocks_count", "recalculated", LANES))]
    scratch: Annotated[Records, Array(SCRATCH, (1,), "thread")]
    # [m]
    radii: Annotated[FloatArray, Array(np.float64, ("radii_count",), "options")]
    # See `scheme.segment_table`.
    table: Annotated[
        FloatArray, Array(np.float64, ("table_rows", len(records.SEGMENT_COLUMNS)), "options")
    ]
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
_TUPLES = (Arrays, *BANKS.values(), ImmBank)
ADDRESSES = tuple(dict.fromkeys(name for kind in _TUPLES for name in declared(kind)))
"""The fields of `PARAMETERS` with the address of an array."""

FLOATS = (
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
    # Of a stable law, or ratio of the deviations of outliers; largest error over sqrt(R).
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
INTEGERS = (
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
FLAGS = (
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
    # All filters run on after a decision: the estimate is that of the bank, or of the likeliest.
    "merged",
    "refined",
    # An oracle bank is anchored at the true state.
    "reset_covariance",
    "oracle",
    "random_scheme",
    # The bank knows the first mode.
    "start_known",
)
PARAMETERS = np.dtype(
    [
        *((name, np.float64) for name in FLOATS),
        *((name, np.int64) for name in INTEGERS),
        *((name, np.bool_) for name in FLAGS),
        *((name, np.uintp) for name in ADDRESSES),
    ]
)
"""The options of an environment in the form used by the kernel, and the addresses of its arrays.
Passing an array from Python takes longer than the tick of a track: the kernel is given the address
of such a record, one for each thread.
"""
