"""The state of N tracks, declared once: the arrays of the kernel, and the parameters with their addresses. Allocation,
addresses, saved states and their checks follow from these declarations and those of the banks.
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

BANKS: dict[str, type] = {"published": PublishedBank, "oracle": PublishedBank, "anchor_aware": AnchorAwareBank}
"""The bank of each value of the option `bank`."""


class Arrays(NamedTuple):
    """The arrays of N tracks except their banks. A size is a field of `PARAMETERS`."""

    actions: Annotated[NDArray[np.int64], Array(np.int64, ("tracks",))]
    blocks: Annotated[Records, Array(BLOCK, ("blocks_count",))]
    observations: Annotated[NDArray[np.float32], Array(np.float32, ("tracks", "width"))]
    # 1 where an action counts; a declaration with 0 waits
    action_mask: Annotated[NDArray[np.int8], Array(np.int8, ("tracks", "action_count"))]
    # every filter at the present tick, if it is asked for
    bank_ticks: Annotated[FloatArray, Array(np.float64, ("tracks", "bank_rows", sum(records.BANK_COLUMNS.values())))]
    rewards: Annotated[FloatArray, Array(np.float64, ("tracks",))]
    terminated: Annotated[Flags, Array(np.bool_, ("tracks",))]
    seeded: Annotated[Flags, Array(np.bool_, ("tracks",))]  # whether the random stream has been seeded
    trace: Annotated[FloatArray, Array(np.float64, ("tracks", "trace_rows", len(records.TRACE_COLUMNS)))]
    decisions: Annotated[NDArray[np.int64], Array(np.int64, (len(records.DECISION), "tracks"))]
    decision_flags: Annotated[Flags, Array(np.bool_, (len(records.DECISION_FLAGS), "tracks"))]
    # the decisions again: one row has the bits of a float64
    decided_numbers: Annotated[FloatArray, Array(np.float64, (len(records.DECISION), "tracks"), at="decisions")]
    # squared position error of every filter, summed over the segment, if it may be recalculated [m^2]
    errors: Annotated[FloatArray, Array(np.float64, ("blocks_count", "recalculated", LANES))]
    scratch: Annotated[Records, Array(SCRATCH, (1,), "thread")]
    radii: Annotated[FloatArray, Array(np.float64, ("radii_count",), "options")]  # [m]
    # see `scheme.segment_table`
    table: Annotated[FloatArray, Array(np.float64, ("table_rows", len(records.SEGMENT_COLUMNS)), "options")]
    # cumulative probabilities of the durations of the first and of other segments, for unknown switches, each
    # of straight segments and of turns
    durations: Annotated[FloatArray, Array(np.float64, (4, "ticks"), "options")]
    # probabilities of the next mode, by the present one; empty if all are equally likely
    order: Annotated[FloatArray, Array(np.float64, ("order_rows", "order_rows"), "options")]
    # the same of each track, and its law of durations, if they are drawn, else empty; see `habits`
    drawn_order: Annotated[FloatArray, Array(np.float64, ("tracks", "drawn_modes", "drawn_modes"))]
    drawn_law: Annotated[FloatArray, Array(np.float64, ("tracks", "drawn_laws", 2, 3))]
    sensors: Annotated[Records, Array(SENSOR, ("sensor_count",), "options")]


arrays_of = reader(Arrays)  # return the `Arrays` at the addresses in a record `PARAMETERS`
_TUPLES = (Arrays, *BANKS.values(), ImmBank)
ADDRESSES = tuple(dict.fromkeys(name for kind in _TUPLES for name in declared(kind)))
"""The fields of `PARAMETERS` with the address of an array."""

FLOATS = (
    "tau", "speed", "heading",  # [s, m/s, rad]; NaN draws the heading uniformly
    "process_variance", "variance_x", "variance_y",  # Q [m^2/s^2], and R of each axis [m^2]
    "process_deviation", "deviation_x", "deviation_y",  # sqrt(Q) of the object [m/s], and sqrt(R) of each axis [m]
    "initial_position", "initial_velocity",  # variances of the first estimate: over R, and [m^2/s^2]
    "noise_shape",  # share of outliers, index, or degrees of freedom
    "noise_scale", "noise_clip",  # of a stable law, or ratio of the deviations of outliers; largest error over sqrt(R)
    "missed",  # probability that a tick has no measurement, of each sensor
    "exact_anchor",  # 1: the anchor-aware bank treats centre and turn rate as exact
    "freedom",  # of the Student t likelihood of the bank; 0 is the normal one
    "log_noise", "noise_whitener",  # ln R, mean of the axes; 1 / sqrt(R) [1/m]
    # a declaration counts from this ln(1 - posterior) of a mode, or a type, on
    "log_error_allowed",
    "delay_cost", "change_cost",  # of a step, and of a change of the statement to a wrong mode
    "stay_probability", "switch_probability",  # entries of the transition matrix that the bank assumes
)  # fmt: skip
INTEGERS = (
    "noise_law",  # of the measurements, see `noise`
    "radii_count", "columns", "modes",  # n radii, n + 1 with the straight line, M = 2 n + 1 hypotheses
    "axes", "action_count",  # number of distinct covariances, 1 or 2, and of actions
    "observation",  # what the row holds, see `observation_row.OBSERVATIONS`
    "bank_rows",  # M if every tick of the bank is recorded, or 0
    "recalculated",  # M if a declaration recalculates the estimates since the switch, or 0
    "segments", "shortest", "longest", "ticks",  # of a random scheme, and of an episode with unknown switches
    "tracks", "blocks_count", "first_block", "last_block",  # blocks first_block .. last_block - 1 are stepped
    "width", "trace_rows", "table_rows", "sensor_count",  # of arrays
    "order_rows", "drawn_modes", "drawn_laws",  # 0 or M; the last one 0 or 2
)  # fmt: skip
FLAGS = (
    "irregular", "radar",  # measurements may be missing or of different variances; a sensor is a radar
    "exact",  # the radius must be correct, not only the type
    "declare_type",  # an action declares the most likely hypothesis of a type
    "declare_best", "keep_undecided",  # action 1 declares the most likely hypothesis; see the option `undecided`
    "merged", "refined",  # all filters run on after a decision: the estimate is that of the bank, or of the likeliest
    "reset_covariance", "oracle", "random_scheme",  # an oracle bank is anchored at the true state
    "start_known",  # the bank knows the first mode
)  # fmt: skip
PARAMETERS = np.dtype(
    [
        *((name, np.float64) for name in FLOATS),
        *((name, np.int64) for name in INTEGERS),
        *((name, np.bool_) for name in FLAGS),
        *((name, np.uintp) for name in ADDRESSES),
    ]
)
"""The options of an environment in the form used by the kernel, and the addresses of its arrays. Passing an array from
Python takes longer than the tick of a track: the kernel is given the address of such a record, one for each thread.
"""
