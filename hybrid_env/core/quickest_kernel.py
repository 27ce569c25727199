"""The kernel with unknown switch moments: object, measurement, IMM bank, statements and autoreset.

Tracks are stored in blocks, as in `kernel`. A statement is compared with the true mode and changes nothing
else, so that every sequence of statements sees the same measurements.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core.compilation import compiled, inlined, internal
from hybrid_env.core.first_estimate import draw_first_estimate
from hybrid_env.core.imm_bank import begin_imm, imm_of_block, step_imm
from hybrid_env.core.irregular_ticks import step_imm_irregular
from hybrid_env.core.kernel import TERMINATED
from hybrid_env.core.memory import array_at
from hybrid_env.core.noise import integer_below, uniform
from hybrid_env.core.quickest_records import QUICKEST_BLOCK, QUICKEST_PARAMETERS, QUICKEST_SCRATCH
from hybrid_env.core.quickest_row import quickest_row_width, write_quickest_row
from hybrid_env.core.records import LANES, SEGMENT_COLUMNS, SENSOR
from hybrid_env.core.true_object import begin_motion, move

FIRST_DURATIONS, OTHER_DURATIONS = 0, 1  # rows of the table of durations


class QuickestArrays(NamedTuple):
    """The arrays of a `hybrid_env.quickest_world.QuickestWorld` except its bank, for N tracks in B blocks."""

    actions: NDArray[np.int64]  # (N,)
    blocks: NDArray[Any]  # (B,) records `QUICKEST_BLOCK`
    scratch: NDArray[Any]  # (1,) record `QUICKEST_SCRATCH`
    radii: NDArray[np.float64]  # (n,) [m]
    table: NDArray[np.float64]  # (M, columns) one row for each mode, see `scheme.segment_table`
    durations: NDArray[np.float64]  # (2, ticks) cumulative probabilities of the first and of other segments
    sensors: NDArray[Any]  # (k,) records `SENSOR`
    observations: NDArray[np.float32]  # (N, width)
    rewards: NDArray[np.float64]  # (N,)
    terminated: NDArray[np.bool_]  # (N,)


@inlined
def arrays_of(setting: Any) -> QuickestArrays:
    """Return the arrays at the addresses in a record `QUICKEST_PARAMETERS`."""
    tracks, n = setting.tracks, setting.radii_count
    modes = 2 * n + 1
    return QuickestArrays(
        array_at(setting.actions, (tracks,), np.int64),
        array_at(setting.blocks, (setting.blocks_count,), QUICKEST_BLOCK),
        array_at(setting.scratch, (1,), QUICKEST_SCRATCH),
        array_at(setting.radii, (n,), np.float64),
        array_at(setting.table, (modes, len(SEGMENT_COLUMNS)), np.float64),
        array_at(setting.durations, (2, setting.ticks), np.float64),
        array_at(setting.sensors, (setting.sensor_count,), SENSOR),
        array_at(setting.observations, (tracks, quickest_row_width(modes)), np.float32),
        array_at(setting.rewards, (tracks,), np.float64),
        array_at(setting.terminated, (tracks,), np.bool_),
    )


@internal
def draw_duration(cumulative: NDArray[np.float64], number: float) -> int:
    """Return a duration from a uniform number in [0, 1), by bisection.

    Args:
        cumulative: (ticks,) probabilities of at most 1, 2, ..., `ticks`.
        number: uniform random number.

    Returns:
        Duration from 1 to `ticks` + 1; the last one stands for all that are longer than `ticks`.
    """
    low, high = 0, cumulative.size
    while low < high:
        middle = (low + high) // 2
        if number < cumulative[middle]:
            high = middle
        else:
            low = middle + 1
    return low + 1


@internal
def _begin_segment(block: Any, lane: int, mode: int, row: int, arrays: QuickestArrays, setting: Any) -> None:
    """Begin a segment of a mode, whose duration has the law of a row of the table of durations."""
    block.true_mode[lane] = mode
    block.length[lane] = draw_duration(arrays.durations[row], uniform(block.random_state, lane))
    block.tick[lane] = 0
    begin_motion(block, lane, arrays.table[mode], setting.tau)


@internal
def _begin_episode(block: Any, lane: int, bank: Any, arrays: QuickestArrays, setting: Any) -> None:
    """Begin an episode with a segment of a random mode."""
    draw_first_estimate(block, block.covariance, arrays.scratch[0].noise, lane, setting)
    mode = integer_below(block.random_state, lane, arrays.table.shape[0])
    block.segment[lane] = 0
    block.time[lane] = 0
    block.stated_mode[lane] = 0
    block.stated_ticks[lane] = 0
    _begin_segment(block, lane, mode, FIRST_DURATIONS, arrays, setting)
    begin_imm(bank, block, lane, mode if setting.start_known else -1)


@inlined
def _switch(block: Any, lane: int, arrays: QuickestArrays, setting: Any) -> None:
    """Begin the next segment, with one of the other modes, all equally likely."""
    other = integer_below(block.random_state, lane, arrays.table.shape[0] - 1)
    mode = other + (1 if other >= block.true_mode[lane] else 0)
    block.segment[lane] += 1
    _begin_segment(block, lane, mode, OTHER_DURATIONS, arrays, setting)


@inlined
def record_statement(block: Any, lane: int, stated: int) -> bool:
    """Record the statement of a track. Returns whether it differs from the last one; the first does not."""
    before = block.stated_ticks[lane]
    changed = before > 0 and stated != block.stated_mode[lane]
    block.stated_ticks[lane] = 1 if changed else before + 1
    block.stated_mode[lane] = stated
    return changed


@inlined
def _state(block: Any, lane: int, stated: int, change_cost: float) -> float:
    """Record the statement of a track. Returns its reward."""
    changed = record_statement(block, lane, stated)
    if stated == block.true_mode[lane]:
        return 1.0
    return -change_cost if changed else 0.0


@inlined
def _prepare_lane(
    reset: bool, block: Any, lane: int, i: int, bank: Any, arrays: QuickestArrays, setting: Any
) -> bool:
    """Apply the action of track i, or begin its next episode. Returns whether the track advances."""
    if reset and arrays.actions[i] == 0:
        return False
    if reset or arrays.terminated[i]:
        _begin_episode(block, lane, bank, arrays, setting)
        arrays.rewards[i] = 0.0
        arrays.terminated[i] = False
        return True
    arrays.rewards[i] = _state(block, lane, arrays.actions[i], setting.change_cost)
    if block.time[lane] == setting.ticks:
        arrays.terminated[i] = True
        return False
    if block.tick[lane] == block.length[lane]:
        _switch(block, lane, arrays, setting)
    return True


@inlined
def step_lanes(
    bank: Any, block: Any, first: int, last: int, arrays: QuickestArrays, setting: Any, robust: Any
) -> None:
    """Advance every filter of lanes first .. last - 1 by the measurement of the block, if there is one."""
    if setting.irregular:
        step_imm_irregular(bank, block, first, last, arrays.radii, setting, robust)
    else:
        step_imm(bank, block, first, last, arrays.radii, setting, robust)


@inlined
def _advance_block(reset: bool, b: int, bank: Any, arrays: QuickestArrays, setting: Any, robust: Any) -> int:
    """Step the tracks of a block; see `advance_quickest`. Returns their events, combined as bits."""
    block, scratch = arrays.blocks[b], arrays.scratch[0]
    lanes = min(LANES, setting.tracks - b * LANES)
    events = 0
    all_running = True  # all lanes advance in this tick
    for lane in range(lanes):
        i = b * LANES + lane
        runs = _prepare_lane(reset, block, lane, i, bank, arrays, setting)
        scratch.running[lane] = 1 if runs else 0
        all_running = all_running and runs
        if not reset and arrays.terminated[i]:
            events = TERMINATED
    for first in range(1 if all_running else lanes):
        if scratch.running[first] == 0:
            continue
        last = lanes if all_running else first + 1
        # unsigned indices need no check for negative values, so that loops over lanes compile to SIMD code
        start, stop = np.uint64(first), np.uint64(last)
        move(block, scratch.noise, start, stop, arrays.sensors, setting)
        step_lanes(bank, block, start, stop, arrays, setting, robust)
        for lane in range(first, last):
            block.time[lane] += 1
            write_quickest_row(arrays.observations[b * LANES + lane], block, lane, bank, setting)
    return events


@inlined
def _advance(address: int, reset: bool, robust: Any) -> int:
    """Check all actions, then step the blocks of this call; `robust` as in `imm_bank.step_imm`."""
    setting = array_at(address, (1,), QUICKEST_PARAMETERS)[0]
    arrays = arrays_of(setting)
    if not reset:
        for i in range(setting.tracks):
            if arrays.actions[i] < 0 or arrays.actions[i] >= arrays.table.shape[0]:
                return -1 - i
    events = 0
    for b in range(setting.first_block, setting.last_block):
        events |= _advance_block(reset, b, imm_of_block(setting, b), arrays, setting, robust)
    return events


@compiled
def advance_quickest(address: int, reset: bool) -> int:
    """Step every track, or with `reset` begin a new episode on every track whose action is not 0.

    In a step, a terminated track begins its next episode. The observation of a track that terminates is not
    changed: it is the one on which the last statement was made.

    Args:
        address: address of a record `QUICKEST_PARAMETERS`, whose arrays must exist during the call. Only its
            blocks first_block .. last_block - 1 are stepped, so that threads can share the tracks.
        reset: True begins new episodes, False steps.

    Returns:
        `kernel.TERMINATED` if any track terminated, else 0. If the action of track i is outside the space,
        -1 - i; then no track is stepped.
    """
    return _advance(address, reset, None)


@compiled
def advance_quickest_robust(address: int, reset: bool) -> int:
    """Like `advance_quickest`, with the robust likelihood."""
    return _advance(address, reset, True)
