"""The kernel: truth, measurement, bank, reward, fast-forward and autoreset of many tracks in one loop.

Tracks lie in blocks (see `records`). What every track does at a tick is a loop over the lanes of a block.
What few tracks do, a decision or a new segment, is done for one lane. Threads step different blocks.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core import bank_operations
from hybrid_env.core.anchor_aware_bank import aware_arrays, aware_banks
from hybrid_env.core.compilation import compiled, formula, internal
from hybrid_env.core.memory import array_at
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.noise import draw_noise, draw_noise_ahead, integer_below, uniform
from hybrid_env.core.observation_row import compare_hypotheses, row_width, write_segment, write_tick
from hybrid_env.core.published_bank import (
    IDENTITY,
    estimate_of,
    likeliest,
    mode_type,
    published_arrays,
    published_banks,
)
from hybrid_env.core.records import (
    BLOCK,
    DECISION,
    DECISION_FLAGS,
    LANES,
    PARAMETERS,
    SCRATCH,
    SEGMENT_COLUMNS,
    TRACE_COLUMNS,
)
from hybrid_env.core.true_object import begin_motion, move, move_lane

NO_COVARIANCE = (0.0,) * 10  # of an anchor that is the truth
TRACE_WIDTH, SEGMENT_WIDTH = len(TRACE_COLUMNS), len(SEGMENT_COLUMNS)
MODE, LENGTH = SEGMENT_COLUMNS.index("mode"), SEGMENT_COLUMNS.index("length")
DECIDED_MODE, DECIDED_TRUE_MODE, TICKS, DECIDED_LENGTH, DECIDED_SQUARED_ERROR = range(len(DECISION))
HAS_DECISION, CORRECT, TYPE_CORRECT, FORCED = range(len(DECISION_FLAGS))
DECIDED, TERMINATED = 1, 2  # events of a step, added up


class Arrays(NamedTuple):
    """The arrays of a world but for its banks, for N tracks in B blocks; see `hybrid_env.world.World`."""

    actions: NDArray[np.int64]  # (N,)
    blocks: NDArray[Any]  # (B,) records `BLOCK`
    scratch: NDArray[Any]  # (1,) record `SCRATCH`
    radii: NDArray[np.float64]  # (n,) [m]
    table: NDArray[np.float64]  # (rows, SEGMENT_WIDTH), see `scheme.segment_table`
    trace: NDArray[np.float64]  # (N, trace rows, TRACE_WIDTH)
    observations: NDArray[np.float32]  # (N, width)
    rewards: NDArray[np.float64]  # (N,)
    terminated: NDArray[np.bool_]  # (N,)
    decisions: NDArray[np.int64]  # (len(DECISION), N)
    squared_errors: NDArray[np.float64]  # (N,), the last row of decisions
    flags: NDArray[np.bool_]  # (len(DECISION_FLAGS), N)


@internal
def _arrays_of(setting: Any) -> Arrays:
    """The arrays at the addresses in a record `PARAMETERS`."""
    tracks, n = setting.tracks, setting.radii_count
    decisions = array_at(setting.decisions, (len(DECISION), tracks), np.int64)
    return Arrays(
        array_at(setting.actions, (tracks,), np.int64),
        array_at(setting.blocks, (setting.blocks_count,), BLOCK),
        array_at(setting.scratch, (1,), SCRATCH),
        array_at(setting.radii, (n,), np.float64),
        array_at(setting.table, (setting.table_rows, SEGMENT_WIDTH), np.float64),
        array_at(setting.trace, (tracks, setting.trace_rows, TRACE_WIDTH), np.float64),
        array_at(setting.observations, (tracks, row_width(2 * n + 1)), np.float32),
        array_at(setting.rewards, (tracks,), np.float64),
        array_at(setting.terminated, (tracks,), np.bool_),
        decisions,
        array_at(setting.decisions, decisions.shape, np.float64)[DECIDED_SQUARED_ERROR],
        array_at(setting.decision_flags, (len(DECISION_FLAGS), tracks), np.bool_),
    )


@formula
def _record_estimate(block: Any, lane: int, hypotheses: NDArray[Any], trace: NDArray[np.float64]) -> None:
    """The active filter's estimate, as in ATE, its error, and a row of the trace if there is room."""
    x, vx, y, vy = estimate_of(hypotheses, block.active_mode[lane], lane)
    block.estimate[0, lane], block.estimate[1, lane] = x, vx
    block.estimate[2, lane], block.estimate[3, lane] = y, vy
    error_x, error_y = x - block.truth[0, lane], y - block.truth[2, lane]
    block.squared_error[lane] += error_x * error_x + error_y * error_y
    if trace.shape[0] > 0 and block.traced[lane] < trace.shape[0]:
        row = trace[block.traced[lane]]
        for k in range(4):
            row[k] = block.truth[k, lane]
        row[4], row[5] = block.measurement[0, lane], block.measurement[1, lane]
        row[6], row[7] = x, y
        row[8] = block.active_mode[lane]
        row[9] = block.segment[lane]
        block.traced[lane] += 1


@internal
def _begin_segment(block: Any, lane: int, bank: Any, arrays: Arrays, setting: Any) -> None:
    """Anchor the object at its true state and the bank at the estimate; the first tick is still to come."""
    table = arrays.table
    if setting.random_scheme:
        row = integer_below(block.random_state, lane, table.shape[0])
        lengths = setting.longest - setting.shortest + 1
        block.length[lane] = setting.shortest + integer_below(block.random_state, lane, lengths)
    else:
        row = block.segment[lane]
        block.length[lane] = np.int64(table[row, LENGTH])
    block.true_mode[lane] = np.int64(table[row, MODE])
    begin_motion(block, lane, table[row], setting.tau)
    for k in range(4):
        block.anchor[k, lane] = block.truth[k, lane] if setting.oracle else block.estimate[k, lane]
    anchor = (
        block.anchor[0, lane], block.anchor[1, lane], block.anchor[2, lane], block.anchor[3, lane],
    )  # fmt: skip
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    block.speed[lane], block.heading[0, lane], block.heading[1, lane] = speed, heading_x, heading_y
    kept = block.kept_covariance
    covariance = (
        kept[0, lane], kept[1, lane], kept[2, lane], kept[3, lane], kept[4, lane],
        kept[5, lane], kept[6, lane], kept[7, lane], kept[8, lane], kept[9, lane],
    )  # fmt: skip
    if setting.reset_covariance:
        covariance = IDENTITY
    if setting.oracle:
        covariance = NO_COVARIANCE
    bank_operations.begin(bank, lane, anchor, covariance, arrays.radii, setting)
    block.tick[lane] = 0
    block.squared_error[lane] = 0.0


@internal
def _begin_episode(block: Any, scratch: Any, lane: int, setting: Any) -> None:
    """Put the object at its start and draw the first estimate."""
    heading = setting.heading
    if math.isnan(heading):
        heading = 2.0 * math.pi * uniform(block.random_state, lane)
    block.truth[0, lane], block.truth[2, lane] = 0.0, 0.0
    block.truth[1, lane] = setting.speed * math.cos(heading)
    block.truth[3, lane] = setting.speed * math.sin(heading)
    draw_noise(block.random_state, scratch.noise, np.uint64(lane), np.uint64(lane + 1), 0.0)
    for k in range(len(NO_COVARIANCE)):
        block.kept_covariance[k, lane] = 0.0
    for axis in range(2):
        variance = setting.variance_x if axis == 0 else setting.variance_y
        position_variance = setting.initial_position * variance
        velocity_variance = setting.initial_velocity
        position, velocity = scratch.noise[2 * axis, lane], scratch.noise[2 * axis + 1, lane]
        block.estimate[2 * axis, lane] = block.truth[2 * axis, lane] + math.sqrt(position_variance) * position
        block.estimate[2 * axis + 1, lane] = (
            block.truth[2 * axis + 1, lane] + math.sqrt(velocity_variance) * velocity
        )
        # the entries of the axis in the upper triangle
        block.kept_covariance[0 if axis == 0 else 7, lane] = position_variance
        block.kept_covariance[4 if axis == 0 else 9, lane] = velocity_variance
    block.segment[lane] = 0
    block.active_mode[lane] = 0  # Golubkov 2018, algorithm 1, line 2


@internal
def _chosen_mode(block: Any, lane: int, bank: Any, action: int, setting: Any) -> int:
    """The mode that a decision is for: as declared, or as a segment that ends undecided takes it."""
    forced = action == 0
    if forced and setting.keep_undecided:
        return block.active_mode[lane]
    if forced or setting.declare_best:
        return likeliest(bank.hypotheses, lane)
    return action - 1


@internal
def _decide(block: Any, lane: int, i: int, bank: Any, arrays: Arrays, setting: Any) -> None:
    """Write the decision of track i and run the chosen filter alone to the end of the segment."""
    action, trace, decisions, flags = arrays.actions[i], arrays.trace[i], arrays.decisions, arrays.flags
    n = bank.hypotheses.size // 2
    true_mode = block.true_mode[lane]
    chosen = _chosen_mode(block, lane, bank, action, setting)
    of_type = mode_type(chosen, n) == mode_type(true_mode, n)
    correct = chosen == true_mode if setting.exact else of_type
    flags[HAS_DECISION, i] = True
    flags[CORRECT, i] = correct
    flags[TYPE_CORRECT, i] = of_type
    flags[FORCED, i] = action == 0
    decisions[DECIDED_MODE, i] = chosen
    decisions[DECIDED_TRUE_MODE, i] = true_mode
    decisions[TICKS, i] = block.tick[lane]
    decisions[DECIDED_LENGTH, i] = block.length[lane]
    block.active_mode[lane] = chosen
    noise = arrays.scratch[0].noise
    while block.tick[lane] < block.length[lane]:
        ticks = min(LANES, block.length[lane] - block.tick[lane])
        # noise of many ticks at once becomes SIMD code
        draw_noise_ahead(block.random_state, lane, noise, ticks, setting.outliers)
        for column in range(ticks):
            move_lane(block, lane, noise, column, setting)
            bank_operations.follow(bank, lane, chosen, block.measurement, setting)
            _record_estimate(block, lane, bank.hypotheses, trace)
    for k, value in enumerate(estimate_of(bank.hypotheses, chosen, lane)):
        block.estimate[k, lane] = value
    for k, value in enumerate(bank_operations.covariance(bank, chosen, lane)):
        block.kept_covariance[k, lane] = value
    arrays.rewards[i] = (1.0 if correct else -1.0) - setting.delay_cost
    arrays.squared_errors[i] = block.squared_error[lane]


@formula
def _act(block: Any, lane: int, i: int, bank: Any, arrays: Arrays, setting: Any) -> int:
    """What track i does before its next tick. Returns the events `DECIDED` and `TERMINATED`, added up."""
    if arrays.actions[i] == 0 and block.tick[lane] < block.length[lane]:
        arrays.rewards[i] = -setting.delay_cost
        return 0
    _decide(block, lane, i, bank, arrays, setting)
    if block.segment[lane] + 1 == setting.segments:
        arrays.terminated[i] = True
        return DECIDED + TERMINATED
    block.segment[lane] += 1
    return DECIDED


@formula
def _forget_step(block: Any, lane: int, i: int, arrays: Arrays, setting: Any) -> None:
    """Clear what the last step of track i left behind: its trace and its decision."""
    if setting.trace_rows > 0:
        block.traced[lane] = 0
    if arrays.flags[HAS_DECISION, i]:
        for k in range(len(DECISION)):
            arrays.decisions[k, i] = 0
        for k in range(len(DECISION_FLAGS)):
            arrays.flags[k, i] = False


@formula
def _tick(block: Any, bank: Any, scratch: Any, first: int, last: int, setting: Any) -> None:
    """One tick of the object and of every hypothesis, for lanes first .. last - 1."""
    move(block, scratch.noise, first, last, setting)
    bank_operations.step(bank, first, last, block.measurement, setting)
    compare_hypotheses(scratch, bank.hypotheses, first, last)


@formula
def _advance_block(reset: bool, b: int, bank: Any, arrays: Arrays, setting: Any) -> int:
    """One step of the tracks of a block; see `_advance`."""
    block, scratch = arrays.blocks[b], arrays.scratch[0]
    lanes = min(LANES, setting.tracks - b * LANES)
    events = 0
    begun = 0  # one bit per lane
    together = True  # all lanes take this tick
    for lane in range(lanes):
        i = b * LANES + lane
        scratch.going[lane] = 1
        if reset and arrays.actions[i] == 0:
            scratch.going[lane] = 0
            together = False
            continue
        _forget_step(block, lane, i, arrays, setting)
        event = 0
        if reset or arrays.terminated[i]:
            _begin_episode(block, scratch, lane, setting)
            arrays.rewards[i] = 0.0
            arrays.terminated[i] = False
            event = DECIDED  # a segment begins
        else:
            event = _act(block, lane, i, bank, arrays, setting)
            events |= event
        if event & TERMINATED:
            scratch.going[lane] = 0
            together = False
        elif event & DECIDED:
            _begin_segment(block, lane, bank, arrays, setting)
            begun |= 1 << lane
    for first in range(1 if together else lanes):
        if scratch.going[first] == 0:
            continue
        last = lanes if together else first + 1
        # unsigned: an index that cannot be negative needs no check, so that loops over lanes become SIMD code
        _tick(block, bank, scratch, np.uint64(first), np.uint64(last), setting)
        for lane in range(first, last):
            i = b * LANES + lane
            _record_estimate(block, lane, bank.hypotheses, arrays.trace[i])
            if begun & (1 << lane):
                write_segment(arrays.observations[i], block, lane, arrays.radii, setting)
            write_tick(arrays.observations[i], block, lane, scratch, bank, setting)
    return events


@internal
def _advance(reset: bool, banks: Any, setting: Any) -> int:
    arrays = _arrays_of(setting)
    if not reset:
        for i in range(setting.tracks):
            if arrays.actions[i] < 0 or arrays.actions[i] >= setting.action_count:
                return -1 - i
    events = 0
    for b in range(setting.first_block, setting.last_block):
        bank = bank_operations.bank_of_block(banks, b)
        events |= _advance_block(reset, b, bank, arrays, setting)
    return events


@compiled
def advance_published(address: int, reset: bool) -> int:
    """One step of every track, or with `reset` a new episode on every track whose action is not 0.

    In a step, a track that has terminated begins its next episode. A track that terminates keeps its row, the
    one on which the last decision was made.

    Args:
        address: of a record `records.PARAMETERS`, whose arrays must live during the call. Only its blocks
            first_block .. last_block - 1 are stepped, so that threads can share the tracks.

    Returns:
        `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated; or -1 - i, with nothing
        done, if the action of track i is outside the space.
    """
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(reset, published_banks(setting), setting)


@compiled
def advance_aware(address: int, reset: bool) -> int:
    """`advance_published` with the anchor-aware bank."""
    setting = array_at(address, (1,), PARAMETERS)[0]
    return _advance(reset, aware_banks(setting), setting)


BANKS: dict[str, tuple[Any, Any]] = {
    "published": (published_arrays, advance_published),
    "oracle": (published_arrays, advance_published),
    "anchor_aware": (aware_arrays, advance_aware),
}
"""For each name of a bank the function that allocates it, and the kernel that steps it."""
