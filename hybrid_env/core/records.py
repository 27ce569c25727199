"""The records of the kernel: the state of the tracks, a sensor, and the columns of segments and
trace. Tracks are stored in blocks of `LANES`. Every field of a block holds one number per track, so
that a loop over lanes has a constant stride and compiles to SIMD code.
"""

from typing import Any

import numpy as np

from hybrid_env.core.arrays import FloatArray
from hybrid_env.core.compilation import inlined
from hybrid_env.core.noise import NOISE_ROWS

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
# What the sensors measure in a tick; the first field is that of `TICK`.
MEASURED = lanes_of(*MEASURED_FIELDS)

_TICK = (
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
)

# The leading fields of a block: the current tick as described by `info`.
TICK = lanes_of(*_TICK)
TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""Fields of `TICK`, in the order of `info`."""

BLOCK = lanes_of(
    *_TICK,
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
    ("noise", np.float64, (NOISE_ROWS,)),
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
