"""The records of the kernel: the state of the tracks, a sensor, and the columns of segments and trace. Tracks are
stored in blocks of `LANES`. Every field of a block holds one number per track, so that a loop over lanes has a constant
stride and compiles to SIMD code.
"""

from typing import Any

import numpy as np

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import inlined
from hybrid_env.core.noise import NOISE_ROWS

LANES = 8  # tracks per block. Eight float64 fill a cache line and the widest vector register.


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
        p[0, lane], p[1, lane], p[2, lane], p[3, lane], p[4, lane],
        p[5, lane], p[6, lane], p[7, lane], p[8, lane], p[9, lane],
    )  # fmt: skip


@inlined
def write_lane(array: FloatArray, lane: int, values: tuple[float, ...]) -> None:
    """Write k values to a lane of an array, (k, LANES)."""
    for k, value in enumerate(values):
        array[k, lane] = value


SENSOR = np.dtype([
    *((name, np.float64) for name in ("x", "y", "range")),  # [m]
    ("deviation", np.float64), ("precision", np.float64),  # of a coordinate or the range [m]; R over its square
    ("bearing_deviation", np.float64), ("rate_deviation", np.float64),  # [rad], 0 is a position sensor; [m/s]
    ("rate_row", np.int64), ("period", np.int64),  # of the range rate in `MEASURED`, -1 without one; [ticks]
])  # fmt: skip
"""A sensor; see `hybrid_env.sensors`."""

MOST_RATES = 4  # radars of a list that measure the range rate

MEASURED_FIELDS = (
    ("measurement", np.float64, (2,)),  # [m], NaN without one
    ("noise", np.float64, (3,)),  # covariance xx, xy, yy of the fused measurement over R
    ("rates", np.float64, (MOST_RATES,)),  # range rates of the sensors with one [m/s], NaN if not measured
)
MEASURED = lanes_of(*MEASURED_FIELDS)  # what the sensors measure in a tick; the first field is that of `TICK`

_TICK = (
    ("truth", np.float64, (4,)),  # [x, vx, y, vy] [m, m/s]
    MEASURED_FIELDS[0],
    ("estimate", np.float64, (4,)),  # of the active filter, or merged over the bank
    ("segment", np.int64, ()),
    ("true_mode", np.int64, ()),
    ("tick", np.int64, ()),  # since the switch, or the beginning of the episode; 1 at the first measurement
    ("anchor", np.float64, (4,)),  # initial state of the bank: the estimate, or the true state for the oracle
)

TICK = lanes_of(*_TICK)  # the leading fields of a block: the current tick as described by `info`
TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""Fields of `TICK`, in the order of `info`."""

BLOCK = lanes_of(
    *_TICK,
    # object and measurements
    ("random_state", np.uint64, (4,)),
    ("true_centre", np.float64, (2,)),  # [m]
    ("true_motion", np.float64, (3,)),  # from `motion.motion_coefficients`
    ("length", np.int64, ()),  # of the segment [ticks]
    ("clock", np.int64, ()),  # ticks of the episode, only counted for the periods of sensors
    *MEASURED_FIELDS[1:],
    # of the estimate, at the switch or, if switches are unknown, in the tick: upper triangle row by row
    ("covariance", np.float64, (10,)),
    # announced switches
    ("heading", np.float64, (2,)),  # unit vector of the anchor's velocity
    ("speed", np.float64, ()),  # of the anchor [m/s]
    ("squared_error", np.float64, ()),  # of the estimated position, summed over the segment [m^2]
    ("active_mode", np.int64, ()),  # the last decided mode, q_A of ATE
    ("trace_length", np.int64, ()),  # rows written to the trace in this step
    # unknown switches
    ("time", np.int64, ()),  # ticks of the episode, 1 at the first measurement
    ("stated_mode", np.int64, ()),  # the last statement; only valid if `stated_ticks` > 0
    ("stated_ticks", np.int64, ()),  # number of consecutive statements of this mode, 0 before the first
)
"""State of `LANES` tracks."""

SCRATCH = lanes_of(
    ("running", np.int64, ()),  # 1 if the track advances in this tick
    ("noise", np.float64, (NOISE_ROWS,)),  # from `noise.draw_noise`
    ("largest", np.float64, ()),  # maximum log-likelihood of the hypotheses
    ("ties", np.float64, ()),  # number of other hypotheses with the maximum
    ("log_error", np.float64, ()),  # ln(1 - maximum posterior), equal priors
    ("types", np.float64, (3,)),  # likelihoods of straight, left and right over the largest of a hypothesis
    ("log_type_error", np.float64, ()),  # ln(1 - maximum posterior of a type), equal priors of the hypotheses
)
"""Temporary values of one tick of one block. The blocks of a thread share this memory in the L1 cache."""

BANK_COLUMNS = {"innovations": 2, "innovation_covariances": 3, "estimates": 4, "covariances": 10}
"""Columns of what is told of a filter at a tick: innovation (x, y) [m], upper triangles of covariances row by row, and
the corrected estimate [x, vx, y, vy] [m, m/s].
"""

DECISION = ("decided_mode", "decided_true_mode", "ticks", "decided_length", "decided_squared_error")
"""Rows of the array of decisions made in a step; the last has the bits of a float64. Zero without a decision."""

DECISION_FLAGS = ("has_decision", "correct", "type_correct", "forced")
"""Rows of the Boolean array of decisions; "correct" is by hypothesis or by type, as in the reward."""

SEGMENT_COLUMNS = ("signed_radius", "mode", "length")
"""Columns of the segment table: radius [m], positive to the left; mode (hypothesis); length [ticks]."""

TRACE_COLUMNS = ("x", "vx", "y", "vy", "measured_x", "measured_y", "estimate_x", "estimate_y", "active_mode", "segment")
"""Columns of the trace. It has one row per tick, including fast-forwarded ticks."""
