"""The records of the kernel: the state of one track, the options as the kernel reads them, the trace."""

import numpy as np

TRACK = np.dtype(
    [
        ("random_state", np.uint64, (4,)),
        ("truth", np.float64, (4,)),  # [x, vx, y, vy] [m, m/s]
        ("true_centre", np.float64, (2,)),  # [m]
        ("true_motion", np.float64, (3,)),  # transition coefficients
        ("measurement", np.float64, (2,)),  # [m]
        ("anchor", np.float64, (4,)),  # the estimate at the switch
        ("heading", np.float64, (2,)),  # unit vector of the anchor's velocity
        ("speed", np.float64),  # of the anchor [m/s]
        ("kept_covariance", np.float64, (2, 3)),  # of the estimate at the switch, per axis
        ("estimate", np.float64, (4,)),  # of the active filter
        ("squared_error", np.float64),  # of the estimated position, summed over the segment [m^2]
        ("segment", np.int64),
        ("tick", np.int64),  # since the switch, 1 at the first measurement
        ("length", np.int64),  # of the segment in ticks
        ("true_mode", np.int64),
        ("active_mode", np.int64),  # the mode decided last, q_A of ATE
        ("terminated", np.bool_),
        ("traced", np.int64),  # rows written to the trace in this call
        # the decision made in this step, if any
        ("has_decision", np.bool_),
        ("decided_mode", np.int64),
        ("decided_true_mode", np.int64),
        ("correct", np.bool_),
        ("type_correct", np.bool_),
        ("forced", np.bool_),
        ("ticks", np.int64),
        ("decided_length", np.int64),
        ("decided_squared_error", np.float64),
    ]
)
"""State of one track. `correct` is the judgement that the reward follows, exact or by type."""

PARAMETERS = np.dtype(
    [
        ("tau", np.float64),
        ("process_variance", np.float64),
        ("speed", np.float64),
        ("heading", np.float64),  # [rad]; NaN draws it
        ("initial_position", np.float64),  # variance of the first estimate over R
        ("initial_velocity", np.float64),  # variance of the first estimate [m^2/s^2]
        ("delay_cost", np.float64),
        ("exact", np.bool_),  # the radius must be right too
        ("actions", np.int64),  # number of actions
        ("declare_best", np.bool_),  # action 1 declares the likeliest hypothesis
        ("keep_undecided", np.bool_),
        ("reset_covariance", np.bool_),
        ("random_scheme", np.bool_),
        ("segments", np.int64),
        ("shortest", np.int64),
        ("longest", np.int64),
        ("process_deviation", np.float64),  # sqrt(Q) [m/s]
        ("deviation_x", np.float64),  # sqrt(R) of each axis [m]
        ("deviation_y", np.float64),
        ("log_noise", np.float64),  # ln R, geometric mean of the axes
        ("noise_whitener", np.float64),  # 1 / sqrt(R) [1/m]
    ]
)
"""The options of a world as the kernel reads them."""

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
"""Columns of the trace: one row a tick, fast-forwarded ticks included."""
