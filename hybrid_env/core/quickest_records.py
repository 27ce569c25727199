"""The records of the kernel with unknown switch moments; see `records`."""

import numpy as np

from hybrid_env.core.noise import NOISE_ROWS
from hybrid_env.core.records import MODEL_FIELDS, SENSED, lanes_of

_TICK = (
    ("truth", np.float64, (4,)),  # [x, vx, y, vy] [m, m/s]
    ("measurement", np.float64, (2,)),  # [m]
    ("estimate", np.float64, (4,)),  # merged over the bank
    ("segment", np.int64, ()),
    ("true_mode", np.int64, ()),
    ("tick", np.int64, ()),  # since the switch or the beginning of the episode, 1 at the first measurement
)

QUICKEST_TICK = lanes_of(*_TICK)
"""The leading fields of a block: the current tick as described by `info`."""

QUICKEST_TICK_NAMES = ("segment", "tick", "true_mode", "truth", "measurement", "estimate")
"""Fields of `QUICKEST_TICK`, in the order of `info`."""

QUICKEST_BLOCK = lanes_of(
    *_TICK,
    ("covariance", np.float64, (10,)),  # of the merged estimate, upper triangle row by row
    ("random_state", np.uint64, (4,)),
    ("true_centre", np.float64, (2,)),  # [m]
    ("true_motion", np.float64, (3,)),  # from `motion.motion_coefficients`
    ("length", np.int64, ()),  # of the segment [ticks]; one more than those of the episode if it does not end
    ("time", np.int64, ()),  # ticks of the episode, 1 at the first measurement
    ("stated_mode", np.int64, ()),  # the last statement; only valid if `stated_ticks` > 0
    ("stated_ticks", np.int64, ()),  # number of consecutive statements of this mode, 0 before the first
    *SENSED,
)
"""State of `LANES` tracks."""

QUICKEST_SCRATCH = lanes_of(
    ("running", np.int64, ()),  # 1 if the track advances in this tick
    ("noise", np.float64, (NOISE_ROWS,)),  # from `noise.draw_noise`
)
"""Temporary values of one tick of one block."""

QUICKEST_ARRAYS = (
    "actions",
    "blocks",
    "hypotheses",
    "innovations",
    "sums",
    "scratch",
    "radii",
    "table",
    "durations",
    "sensors",
    "observations",
    "rewards",
    "terminated",
)
"""Arrays that the kernel reads and writes."""

QUICKEST_PARAMETERS = np.dtype(
    [
        *MODEL_FIELDS,
        ("ticks", np.int64),  # of an episode
        ("change_cost", np.float64),  # of a change of the statement to a wrong mode
        ("start_known", np.bool_),  # the bank knows the first mode
        ("stay_probability", np.float64),  # entries of the transition matrix that the bank assumes
        ("switch_probability", np.float64),
        # addresses of the arrays
        *((name, np.uintp) for name in QUICKEST_ARRAYS),
    ]
)
"""The options of the environment in the form used by the kernel, and the addresses of its arrays."""
