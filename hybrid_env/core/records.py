"""The records of the kernel: the state of the tracks, the parameters, and the columns of the trace.

Tracks are stored in blocks of `LANES`. Every field of a block holds one number per track, so that a loop over
lanes has a constant stride and compiles to SIMD code.
"""

from typing import Any

import numpy as np

from hybrid_env.core.noise import NOISE_ROWS

LANES = 8
"""Tracks per block. Eight float64 fill a cache line and the widest vector register."""


def lanes_of(*fields: tuple[str, type, tuple[int, ...]]) -> np.dtype[Any]:
    """Return a record type whose fields have the shape (*shape, LANES)."""
    return np.dtype([(name, kind, (*shape, LANES)) for name, kind, shape in fields])


_TICK = (
    ("truth", np.float64, (4,)),  # [x, vx, y, vy] [m, m/s]
    ("measurement", np.float64, (2,)),  # [m]
    ("anchor", np.float64, (4,)),  # initial state of the bank: the estimate, or the true state for the oracle
    ("estimate", np.float64, (4,)),  # of the active filter, or merged over the bank
    ("segment", np.int64, ()),
    ("true_mode", np.int64, ()),
    ("tick", np.int64, ()),  # since the switch, 1 at the first measurement
)

SENSED: tuple[tuple[str, type, tuple[int, ...]], ...] = (
    ("clock", np.int64, ()),  # ticks of the episode, only counted for the periods of sensors
    ("variance_ratio", np.float64, ()),  # of the fused measurement over R, 1 without sensors
)
"""Fields of every block about the measurement of a tick, besides `measurement`, NaN without one."""

SENSOR = np.dtype(
    [
        ("x", np.float64),  # [m]
        ("y", np.float64),
        ("deviation", np.float64),  # of each measured coordinate [m]
        ("precision", np.float64),  # R over the variance
        ("range", np.float64),  # [m]
        ("period", np.int64),  # [ticks]
    ]
)
"""A position sensor; see `hybrid_env.sensors.Sensor`."""

TICK = lanes_of(*_TICK)
"""The leading fields of a block: the current tick as described by `info`."""

TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""Fields of `TICK`, in the order of `info`."""

BLOCK = lanes_of(
    *_TICK,
    ("random_state", np.uint64, (4,)),
    ("true_centre", np.float64, (2,)),  # [m]
    ("true_motion", np.float64, (3,)),  # from `motion.motion_coefficients`
    ("heading", np.float64, (2,)),  # unit vector of the anchor's velocity
    ("squared_error", np.float64, ()),  # of the estimated position, summed over the segment [m^2]
    ("length", np.int64, ()),  # of the segment [ticks]
    ("active_mode", np.int64, ()),  # the last decided mode, q_A of ATE
    ("kept_covariance", np.float64, (10,)),  # of the estimate at the switch, upper triangle row by row
    ("speed", np.float64, ()),  # of the anchor [m/s]
    ("trace_length", np.int64, ()),  # rows written to the trace in this step
    *SENSED,
)
"""State of `LANES` tracks."""

SCRATCH = lanes_of(
    ("running", np.int64, ()),  # 1 if the track advances in this tick
    ("noise", np.float64, (NOISE_ROWS,)),  # from `noise.draw_noise`
    ("largest", np.float64, ()),  # maximum log-likelihood of the hypotheses
    ("ties", np.float64, ()),  # number of other hypotheses with the maximum
    ("log_error", np.float64, ()),  # ln(1 - maximum posterior), equal priors
)
"""Temporary values of one tick of one block. The blocks of a thread share this memory in the L1 cache."""

DECISION = (
    "decided_mode",
    "decided_true_mode",
    "ticks",
    "decided_length",
    "decided_squared_error",  # the bits of a float64
)
"""Rows of the array of decisions made in a step. One column per track, zero without a decision."""

DECISION_FLAGS = ("has_decision", "correct", "type_correct", "forced")
"""Rows of the Boolean array of decisions; "correct" is by hypothesis or by type, as in the reward."""

ARRAYS = (
    "actions",
    "blocks",
    "hypotheses",
    "covariances",
    "innovations",
    "gains",
    "scratch",
    "radii",
    "table",
    "trace",
    "sensors",
    "observations",
    "rewards",
    "terminated",
    "decisions",
    "decision_flags",
)
"""Arrays of a `World` that the kernel reads and writes."""

MODEL_FIELDS: tuple[tuple[str, type], ...] = (
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
    ("freedom", np.float64),  # of the Student t likelihood of the bank; 0 is the normal one
    ("log_noise", np.float64),  # ln R, mean of the axes
    ("radii_count", np.int64),
    ("tracks", np.int64),
    ("blocks_count", np.int64),
    ("first_block", np.int64),  # blocks first_block .. last_block - 1 are stepped
    ("last_block", np.int64),
)
"""Parameters of every environment: object, measurements, bank, and number of tracks."""

PARAMETERS = np.dtype(
    [
        *MODEL_FIELDS,
        ("delay_cost", np.float64),
        ("exact", np.bool_),  # True if the radius must be correct, not only the type
        ("action_count", np.int64),
        ("declare_best", np.bool_),  # action 1 declares the most likely hypothesis
        ("keep_undecided", np.bool_),
        ("reset_covariance", np.bool_),
        ("oracle", np.bool_),  # the bank is anchored at the true state
        ("random_scheme", np.bool_),
        ("segments", np.int64),
        ("shortest", np.int64),
        ("longest", np.int64),
        ("noise_whitener", np.float64),  # 1 / sqrt(R) [1/m]
        ("axes", np.int64),  # number of distinct measurement variances, 1 or 2
        ("trace_rows", np.int64),
        ("table_rows", np.int64),
        # addresses of the arrays of a `World`
        *((name, np.uintp) for name in ARRAYS),
    ]
)
"""The options of a `World` in the form used by the kernel, and the addresses of its arrays.

Passing an array from Python takes 0.1 us per call, longer than the tick of a track. The kernel therefore has
the address of one such record as its argument. Each thread has a separate record.
"""

SEGMENT_COLUMNS = ("signed_radius", "mode", "length")
"""Columns of the segment table: radius [m], positive to the left; mode (hypothesis); length [ticks]."""

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
