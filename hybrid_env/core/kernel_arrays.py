"""The arrays of the kernel, found at the addresses in its parameter record."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import inlined
from hybrid_env.core.memory import array_at
from hybrid_env.core.observation_row import row_width
from hybrid_env.core.records import (
    BLOCK,
    DECISION,
    DECISION_FLAGS,
    SCRATCH,
    SEGMENT_COLUMNS,
    SENSOR,
    TRACE_COLUMNS,
)

TRACE_WIDTH, SEGMENT_WIDTH = len(TRACE_COLUMNS), len(SEGMENT_COLUMNS)
DECIDED_SQUARED_ERROR = DECISION.index("decided_squared_error")


class Arrays(NamedTuple):
    """The arrays of a `hybrid_env.world.World` except its banks, for N tracks in B blocks."""

    actions: NDArray[np.int64]  # (N,)
    blocks: NDArray[Any]  # (B,) records `BLOCK`
    scratch: NDArray[Any]  # (1,) record `SCRATCH`
    radii: NDArray[np.float64]  # (n,) [m]
    table: NDArray[np.float64]  # (rows, SEGMENT_WIDTH), see `scheme.segment_table`
    sensors: NDArray[Any]  # (k,) records `SENSOR`
    trace: NDArray[np.float64]  # (N, trace rows, TRACE_WIDTH)
    observations: NDArray[np.float32]  # (N, width)
    rewards: NDArray[np.float64]  # (N,)
    terminated: NDArray[np.bool_]  # (N,)
    decisions: NDArray[np.int64]  # (len(DECISION), N)
    squared_errors: NDArray[np.float64]  # (N,), the last row of decisions
    flags: NDArray[np.bool_]  # (len(DECISION_FLAGS), N)


@inlined
def arrays_of(setting: Any) -> Arrays:
    """Return the arrays at the addresses in a record `PARAMETERS`."""
    tracks, n = setting.tracks, setting.radii_count
    decisions = array_at(setting.decisions, (len(DECISION), tracks), np.int64)
    return Arrays(
        array_at(setting.actions, (tracks,), np.int64),
        array_at(setting.blocks, (setting.blocks_count,), BLOCK),
        array_at(setting.scratch, (1,), SCRATCH),
        array_at(setting.radii, (n,), np.float64),
        array_at(setting.table, (setting.table_rows, SEGMENT_WIDTH), np.float64),
        array_at(setting.sensors, (setting.sensor_count,), SENSOR),
        array_at(setting.trace, (tracks, setting.trace_rows, TRACE_WIDTH), np.float64),
        array_at(setting.observations, (tracks, row_width(2 * n + 1)), np.float32),
        array_at(setting.rewards, (tracks,), np.float64),
        array_at(setting.terminated, (tracks,), np.bool_),
        decisions,
        array_at(setting.decisions, decisions.shape, np.float64)[DECIDED_SQUARED_ERROR],
        array_at(setting.decision_flags, (len(DECISION_FLAGS), tracks), np.bool_),
    )
