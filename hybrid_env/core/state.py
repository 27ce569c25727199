"""The state of N tracks, declared once: the arrays of the kernel, and the parameters with their addresses.

Allocation, addresses, saved states and their checks follow from these declarations and those of the banks.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core import records
from hybrid_env.core.arrays import Array, declared, reader
from hybrid_env.core.banks.anchor_aware import AnchorAwareBank
from hybrid_env.core.banks.imm import ImmBank
from hybrid_env.core.banks.published import PublishedBank
from hybrid_env.core.records import BLOCK, LANES, SCRATCH, SENSOR

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

BANKS: dict[str, type] = {"published": PublishedBank, "oracle": PublishedBank, "anchor_aware": AnchorAwareBank}
"""The bank of each value of the option `bank`."""


class Arrays(NamedTuple):
    """The arrays of N tracks except their banks. A size is a field of `PARAMETERS`."""

    actions: Annotated[NDArray[np.int64], Array(np.int64, ("tracks",))]
    blocks: Annotated[NDArray[Any], Array(BLOCK, ("blocks_count",))]
    observations: Annotated[NDArray[np.float32], Array(np.float32, ("tracks", "width"))]
    rewards: Annotated[Floats, Array(np.float64, ("tracks",))]
    terminated: Annotated[Flags, Array(np.bool_, ("tracks",))]
    seeded: Annotated[Flags, Array(np.bool_, ("tracks",))]  # whether the random stream has been seeded
    trace: Annotated[Floats, Array(np.float64, ("tracks", "trace_rows", len(records.TRACE_COLUMNS)))]
    decisions: Annotated[NDArray[np.int64], Array(np.int64, (len(records.DECISION), "tracks"))]
    decision_flags: Annotated[Flags, Array(np.bool_, (len(records.DECISION_FLAGS), "tracks"))]
    # the decisions again: one row has the bits of a float64
    decided_numbers: Annotated[Floats, Array(np.float64, (len(records.DECISION), "tracks"), at="decisions")]
    # squared position error of every filter, summed over the segment, if it may be recalculated [m^2]
    errors: Annotated[Floats, Array(np.float64, ("blocks_count", "recalculated", LANES))]
    scratch: Annotated[NDArray[Any], Array(SCRATCH, (1,), "thread")]
    radii: Annotated[Floats, Array(np.float64, ("radii_count",), "options")]  # [m]
    # see `scheme.segment_table`
    table: Annotated[Floats, Array(np.float64, ("table_rows", len(records.SEGMENT_COLUMNS)), "options")]
    # cumulative probabilities of the durations of the first and of other segments, for unknown switches, each
    # of straight segments and of turns
    durations: Annotated[Floats, Array(np.float64, (4, "ticks"), "options")]
    # probabilities of the next mode, by the present one; empty if all are equally likely
    order: Annotated[Floats, Array(np.float64, ("order_rows", "order_rows"), "options")]
    # the same of each track, and its law of durations, if they are drawn, else empty; see `habits`
    drawn_order: Annotated[Floats, Array(np.float64, ("tracks", "drawn_modes", "drawn_modes"))]
    drawn_law: Annotated[Floats, Array(np.float64, ("tracks", "drawn_laws", 2, 3))]
    sensors: Annotated[NDArray[Any], Array(SENSOR, ("sensor_count",), "options")]


arrays_of = reader(Arrays)
"""Return the `Arrays` at the addresses in a record `PARAMETERS`."""

_TUPLES = (Arrays, *BANKS.values(), ImmBank)
ADDRESSES = tuple(dict.fromkeys(name for kind in _TUPLES for name in declared(kind)))
"""The fields of `PARAMETERS` with the address of an array."""

PARAMETERS = np.dtype(
    [
        # object and measurements
        ("tau", np.float64),
        ("process_variance", np.float64),
        ("variance_x", np.float64),  # R of each axis [m^2]
        ("variance_y", np.float64),
        ("speed", np.float64),
        ("heading", np.float64),  # [rad]; NaN draws it uniformly
        ("initial_position", np.float64),  # position variance of the first estimate / R
        ("initial_velocity", np.float64),  # velocity variance of the first estimate [m^2/s^2]
        ("process_deviation", np.float64),  # sqrt(Q) [m/s]
        ("deviation_x", np.float64),  # sqrt(R) of each axis [m]
        ("deviation_y", np.float64),
        ("noise_law", np.int64),  # of the measurements, see `noise`
        ("noise_shape", np.float64),  # share of outliers, index, or degrees of freedom
        ("noise_scale", np.float64),  # of a stable law, or ratio of the deviations of outliers and others
        ("noise_clip", np.float64),  # largest error over sqrt(R)
        ("missed", np.float64),  # probability that a tick has no measurement, of each sensor
        ("sensor_count", np.int64),  # 0 without a list of sensors
        ("irregular", np.bool_),  # measurements may be missing or of different variances
        ("radar", np.bool_),  # a sensor is a radar
        ("exact_anchor", np.float64),  # 1: the anchor-aware bank treats centre and turn rate as exact
        # bank and observation
        ("freedom", np.float64),  # of the Student t likelihood of the bank; 0 is the normal one
        ("log_noise", np.float64),  # ln R, mean of the axes
        ("noise_whitener", np.float64),  # 1 / sqrt(R) [1/m]
        ("radii_count", np.int64),  # n
        ("columns", np.int64),  # n + 1 radii with the straight line
        ("modes", np.int64),  # M = 2 n + 1 hypotheses
        ("axes", np.int64),  # number of distinct covariances, 1 or 2
        ("action_count", np.int64),
        # announced switches
        ("delay_cost", np.float64),
        ("exact", np.bool_),  # True if the radius must be correct, not only the type
        ("declare_best", np.bool_),  # action 1 declares the most likely hypothesis
        ("keep_undecided", np.bool_),
        ("merged", np.bool_),  # all filters run on after a decision, and the estimate is that of the bank
        ("recalculated", np.int64),  # M if a declaration recalculates the estimates since the switch, or 0
        ("refined", np.bool_),  # all filters run on, and the estimate is that of the likeliest declared type
        ("reset_covariance", np.bool_),
        ("oracle", np.bool_),  # the bank is anchored at the true state
        ("random_scheme", np.bool_),
        ("segments", np.int64),
        ("shortest", np.int64),
        ("longest", np.int64),
        ("trace_rows", np.int64),
        # unknown switches
        ("ticks", np.int64),  # of an episode
        ("change_cost", np.float64),  # of a change of the statement to a wrong mode
        ("start_known", np.bool_),  # the bank knows the first mode
        ("stay_probability", np.float64),  # entries of the transition matrix that the bank assumes
        ("switch_probability", np.float64),
        # sizes
        ("tracks", np.int64),
        ("blocks_count", np.int64),
        ("first_block", np.int64),  # blocks first_block .. last_block - 1 are stepped
        ("last_block", np.int64),
        ("width", np.int64),  # of an observation
        ("table_rows", np.int64),
        ("order_rows", np.int64),  # 0 or M, likewise `drawn_modes`
        ("drawn_modes", np.int64),
        ("drawn_laws", np.int64),  # 0 or 2
        *((name, np.uintp) for name in ADDRESSES),
    ]
)
"""The options of an environment in the form used by the kernel, and the addresses of its arrays.

Passing an array from Python takes 0.1 us per call, longer than the tick of a track. The kernel therefore has
the address of one such record as its argument. Each thread has a separate record.
"""
