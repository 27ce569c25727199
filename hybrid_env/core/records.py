"""The records of the kernel: the state of tracks, the options as the kernel reads them, the trace.

Tracks lie side by side in blocks of `LANES`: every field of a block holds one number per track, so that a
loop over lanes has constant strides and becomes SIMD code.
"""

from typing import Any

import numpy as np

LANES = 8
"""Tracks per block: eight float64 fill a cache line and the widest vector register."""


def lanes_of(*fields: tuple[str, type, tuple[int, ...]]) -> np.dtype[Any]:
    """A record whose fields hold an array of a shape for each lane, lanes innermost."""
    return np.dtype([(name, kind, (*shape, LANES)) for name, kind, shape in fields])


_TICK = (
    ("truth", np.float64, (4,)),  # [x, vx, y, vy] [m, m/s]
    ("measurement", np.float64, (2,)),  # [m]
    ("anchor", np.float64, (4,)),  # what the bank starts from: the estimate, or the truth of an oracle
    ("estimate", np.float64, (4,)),  # of the active filter
    ("segment", np.int64, ()),
    ("true_mode", np.int64, ()),
    ("tick", np.int64, ()),  # since the switch, 1 at the first measurement
)

TICK = lanes_of(*_TICK)
"""The front of a block: what `info` says of the present tick."""

TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""Its fields, in the order of `info`."""

BLOCK = lanes_of(
    *_TICK,
    ("random_state", np.uint64, (4,)),
    ("true_centre", np.float64, (2,)),  # [m]
    ("true_motion", np.float64, (3,)),  # transition coefficients
    ("heading", np.float64, (2,)),  # unit vector of the anchor's velocity
    ("squared_error", np.float64, ()),  # of the estimated position, summed over the segment [m^2]
    ("length", np.int64, ()),  # of the segment in ticks
    ("active_mode", np.int64, ()),  # the mode decided last, q_A of ATE
    ("kept_covariance", np.float64, (10,)),  # of the estimate at the switch, upper triangle row by row
    ("speed", np.float64, ()),  # of the anchor [m/s]
    ("traced", np.int64, ()),  # rows written to the trace in this call
)
"""State of `LANES` tracks."""

SCRATCH = lanes_of(
    ("going", np.int64, ()),  # whether the track takes this tick
    ("noise", np.float64, (5,)),  # of `noise.draw_noise`
    ("largest", np.float64, ()),  # log-likelihood of the likeliest hypothesis
    ("equals", np.float64, ()),  # other hypotheses with that log-likelihood
    ("log_error", np.float64, ()),  # ln(1 - largest posterior), equal priors
)
"""Numbers of one tick of one block. All blocks share the same memory, which stays in the nearest cache."""

DECISION = (
    "decided_mode",
    "decided_true_mode",
    "ticks",
    "decided_length",
    "decided_squared_error",  # a float64 among the integers
)
"""Rows of the array of decisions made in a step: one column per track, zero without a decision."""

DECISION_FLAGS = ("has_decision", "correct", "type_correct", "forced")
"""Rows of the array of Boolean results, likewise; "correct" as rewarded, exact or by type."""

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
    "observations",
    "rewards",
    "terminated",
    "decisions",
    "decision_flags",
)
"""Arrays of a world that the kernel reads and writes."""

PARAMETERS = np.dtype(
    [
        ("tau", np.float64),
        ("process_variance", np.float64),
        ("variance_x", np.float64),  # R of each axis [m^2]
        ("variance_y", np.float64),
        ("speed", np.float64),
        ("heading", np.float64),  # [rad]; NaN draws it
        ("initial_position", np.float64),  # variance of the first estimate over R
        ("initial_velocity", np.float64),  # variance of the first estimate [m^2/s^2]
        ("delay_cost", np.float64),
        ("exact", np.bool_),  # the radius must be right too
        ("action_count", np.int64),
        ("declare_best", np.bool_),  # action 1 declares the likeliest hypothesis
        ("keep_undecided", np.bool_),
        ("reset_covariance", np.bool_),
        ("oracle", np.bool_),  # the bank is anchored at the truth
        ("random_scheme", np.bool_),
        ("segments", np.int64),
        ("shortest", np.int64),
        ("longest", np.int64),
        ("process_deviation", np.float64),  # sqrt(Q) [m/s]
        ("deviation_x", np.float64),  # sqrt(R) of each axis [m]
        ("deviation_y", np.float64),
        ("outliers", np.float64),  # share of measurements
        ("log_noise", np.float64),  # ln R, geometric mean of the axes
        ("noise_whitener", np.float64),  # 1 / sqrt(R) [1/m]
        ("radii_count", np.int64),
        ("axes", np.int64),  # distinct noise axes, 1 or 2
        ("tracks", np.int64),
        ("blocks_count", np.int64),
        ("first_block", np.int64),  # the blocks first_block .. last_block - 1 are stepped
        ("last_block", np.int64),
        ("trace_rows", np.int64),
        ("table_rows", np.int64),
        # where the arrays of a world lie, see `World`
        *((name, np.uintp) for name in ARRAYS),
    ]
)
"""The options of a world as the kernel reads them, and the addresses of its arrays.

Passing an array from Python costs 0.1 us per call, more than the tick of a track. The kernel therefore takes
the address of one such record and finds everything else there. Each thread has a record of its own.
"""

SEGMENT_COLUMNS = ("signed_radius", "mode", "length")
"""Columns of the table of segments: radius [m], positive to the left; mode of the bank; length [ticks]."""

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
"""Columns of the trace: one row per tick, fast-forwarded ticks included."""
