"""The kernel with unknown switch moments: object, measurement, IMM bank, statements and autoreset.
A statement changes nothing but its reward, so that every sequence of statements sees the same
measurements.
"""

from typing import Any

import numpy as np

from hybrid_env.core.banks.bank import filter_model
from hybrid_env.core.banks.imm import begin_imm, imm_of_block, step_imm, step_imm_irregular
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.habits import draw_from_law, draw_law, draw_mode, draw_order, draw_remaining
from hybrid_env.core.kernel import TERMINATED, invalid_action
from hybrid_env.core.memory import LANES, FloatArray
from hybrid_env.core.noise import integer_below, uniform
from hybrid_env.core.observation_row import write_quickest_row
from hybrid_env.core.true_object import begin_motion, draw_first_estimate, move

# Rows of the table of durations; those of turns follow.
FIRST_DURATIONS, OTHER_DURATIONS = 0, 2


@internal
def draw_duration(cumulative: FloatArray, number: float) -> int:
    """Return a duration from a number in [0, 1) and the cumulative probabilities of 1, 2, ...,
    `ticks`, by bisection; `ticks` + 1 stands for all that are longer.
    """
    low = 0
    high = cumulative.size
    while low < high:
        middle = (low + high) // 2
        if number < cumulative[middle]:
            high = middle
        else:
            low = middle + 1
    return low + 1


@internal
def _begin_segment(
    block: Any,
    lane: int,
    i: int,
    mode: int,
    row: int,
    arrays: Any,
    setting: Any,
) -> None:
    """Begin a segment of a mode; row: the law of straight segments in the table of durations."""
    turns = 1 if mode > 0 else 0
    block.true_mode[lane] = mode
    if setting.drawn_laws > 0:
        law = arrays.drawn_law[i, turns]
        longest = setting.ticks + 1
        if row == FIRST_DURATIONS and not setting.start_known:
            block.length[lane] = draw_remaining(block.random_state, lane, law, longest)
        else:
            block.length[lane] = draw_from_law(block.random_state, lane, law, longest)
    else:
        number = uniform(block.random_state, lane)
        block.length[lane] = draw_duration(arrays.durations[row + turns], number)
    block.tick[lane] = 0
    begin_motion(block, lane, arrays.table[mode], setting.tau)


@internal
def _begin_episode(block: Any, lane: int, i: int, bank: Any, arrays: Any, setting: Any) -> None:
    """Begin an episode of track i with a segment of a random mode."""
    if setting.drawn_laws > 0:
        draw_law(block.random_state, lane, arrays.drawn_law[i])
    if setting.drawn_modes > 0:
        draw_order(block.random_state, lane, arrays.drawn_order[i])
    draw_first_estimate(block, arrays.scratch[0].noise, lane, setting)
    mode = integer_below(block.random_state, lane, arrays.table.shape[0])
    block.segment[lane] = 0
    block.time[lane] = 0
    block.stated_mode[lane] = 0
    block.stated_ticks[lane] = 0
    _begin_segment(block, lane, i, mode, FIRST_DURATIONS, arrays, setting)
    begin_imm(bank, block, lane, mode if setting.start_known else -1)


@inlined
def _switch(block: Any, lane: int, i: int, arrays: Any, setting: Any) -> None:
    """Begin the next segment, with one of the other modes."""
    before = block.true_mode[lane]
    if setting.drawn_modes > 0:
        mode = draw_mode(block.random_state, lane, arrays.drawn_order[i, before])
    elif setting.order_rows > 0:
        mode = draw_mode(block.random_state, lane, arrays.order[before])
    else:
        other = integer_below(block.random_state, lane, arrays.table.shape[0] - 1)
        mode = other + (1 if other >= before else 0)
    block.segment[lane] += 1
    _begin_segment(block, lane, i, mode, OTHER_DURATIONS, arrays, setting)


@inlined
def record_statement(block: Any, lane: int, stated: int) -> bool:
    """Record the statement of a track. Returns whether it differs from the last one; the first
    does not.
    """
    before = block.stated_ticks[lane]
    changed = before > 0 and stated != block.stated_mode[lane]
    block.stated_ticks[lane] = 1 if changed else before + 1
    block.stated_mode[lane] = stated
    return changed


@inlined
def _prepare_lane(
    reset: bool,
    block: Any,
    lane: int,
    i: int,
    bank: Any,
    arrays: Any,
    setting: Any,
) -> bool:
    """Apply the action of track i, or begin its next episode. Returns whether the track
    advances.
    """
    if reset and arrays.actions[i] == 0:
        return False
    if reset or arrays.terminated[i]:
        _begin_episode(block, lane, i, bank, arrays, setting)
        arrays.rewards[i] = 0.0
        arrays.terminated[i] = False
        return True
    changed = record_statement(block, lane, arrays.actions[i])
    wrong = -setting.change_cost if changed else 0.0
    arrays.rewards[i] = 1.0 if arrays.actions[i] == block.true_mode[lane] else wrong
    if block.time[lane] == setting.ticks:
        arrays.terminated[i] = True
        return False
    if block.tick[lane] == block.length[lane]:
        _switch(block, lane, i, arrays, setting)
    return True


@inlined
def _advance_block(reset: bool, b: int, bank: Any, arrays: Any, setting: Any) -> int:
    """Step the tracks of a block; see `kernels.advance_quickest`. Returns their events, combined
    as bits.
    """
    block, scratch = arrays.blocks[b], arrays.scratch[0]
    lanes = min(LANES, setting.tracks - b * LANES)
    events = 0
    # All lanes advance in this tick.
    all_running = True
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
        # Unsigned indices need no check for negative values, so that loops over lanes compile to
        # SIMD code.
        start = np.uint64(first)
        stop = np.uint64(last)
        move(block, scratch.noise, start, stop, arrays.sensors, setting)
        if setting.irregular:
            step_imm_irregular(bank, block, start, stop, arrays, setting)
        else:
            step_imm(bank, block, start, stop, arrays.radii, filter_model(setting, 1.0))
        for lane in range(first, last):
            block.time[lane] += 1
            write_quickest_row(arrays.observations[b * LANES + lane], block, lane, bank, setting)
    return events


@inlined
def advance(reset: bool, banks: Any, arrays: Any, setting: Any) -> int:
    """Check all actions, then step the blocks of this call; see `kernels.advance_quickest`."""
    events = invalid_action(reset, arrays, setting)
    if events == 0:
        for b in range(setting.first_block, setting.last_block):
            events |= _advance_block(reset, b, imm_of_block(banks, b), arrays, setting)
    return events
