"""Tracks with unknown switches: what happens to the lanes of a block in a tick, see `kernel`. A
statement changes nothing but its reward, so that every sequence of statements sees the same
measurements. On a live sensor the measurements come from the caller.
"""

from typing import Any

import numpy as np

from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import filter_model, motions_of
from hybrid_env.core.banks.height import heights_of
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.habits import draw_from_law, draw_law, draw_mode, draw_order, draw_remaining
from hybrid_env.core.kernel import HALTED, TERMINATED
from hybrid_env.core.memory import LANES, arrays_of
from hybrid_env.core.noise import integer_below, uniform
from hybrid_env.core.observation_row import write_heights, write_quickest_row, write_trace
from hybrid_env.core.true_object import begin_motion, draw_first_estimate, move


@internal
def _begin_segment(
    block: Any, lane: int, i: int, mode: int, first: bool, bank: Any, arrays: Any, setting: Any
) -> None:
    """Begin a segment of a mode; first: of an episode, whose durations have the first half of their
    table.
    """
    block.true_mode[lane] = mode
    if setting.drawn_laws > 0:
        law = arrays.drawn_law[i, 1 if mode > 0 else 0]
        longest = setting.ticks + 1
        if first and not setting.start_known:
            block.length[lane] = draw_remaining(block.random_state, lane, law, longest)
        else:
            block.length[lane] = draw_from_law(block.random_state, lane, law, longest)
    else:
        number = uniform(block.random_state, lane)
        half = 0 if first else arrays.durations.shape[0] // 2
        row = half + arrays.law_places[mode]
        # Of the durations 1, 2, ..., `ticks`; `ticks` + 1 stands for all that are longer.
        block.length[lane] = np.searchsorted(arrays.durations[row], number, "right") + 1
    block.tick[lane] = 0
    begin_motion(block, lane, arrays.table[mode], motions_of(bank), setting.tau)


@inlined
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
    _begin_segment(block, lane, i, mode, True, bank, arrays, setting)
    operations.begin_imm(bank, block, lane, mode if setting.start_known else -1)


@inlined
def _switch(block: Any, lane: int, i: int, bank: Any, arrays: Any, setting: Any) -> None:
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
    _begin_segment(block, lane, i, mode, False, bank, arrays, setting)


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


@internal
def _state(block: Any, lane: int, i: int, bank: Any, setting: Any) -> int:
    """Reward the statement of track i for the present tick. Returns the events of the lane."""
    arrays = arrays_of(setting)
    changed = record_statement(block, lane, arrays.actions[i])
    wrong = -setting.change_cost if changed else 0.0
    arrays.rewards[i] += 1.0 if arrays.actions[i] == block.true_mode[lane] else wrong
    if block.time[lane] == setting.ticks:
        arrays.terminated[i] = True
        return TERMINATED
    if block.tick[lane] == block.length[lane]:
        _switch(block, lane, i, bank, arrays, setting)
    return 0


@internal
def prepare_lane(reset: bool, block: Any, lane: int, i: int, bank: Any, setting: Any) -> int:
    """Apply the action of track i, or begin its next episode. Returns the events of the lane."""
    arrays = arrays_of(setting)
    block.trace_length[lane] = 0
    arrays.rewards[i] = 0.0
    if reset or arrays.terminated[i]:
        _begin_episode(block, lane, i, bank, arrays, setting)
        arrays.terminated[i] = False
        return 0
    return _state(block, lane, i, bank, setting)


@internal
def wait_lane(block: Any, lane: int, i: int, bank: Any, setting: Any) -> int:
    """Repeat the statement of track i; a new episode halts for its first one. Returns the events
    of the lane.
    """
    if block.stated_ticks[lane] == 0:
        return HALTED
    return _state(block, lane, i, bank, setting)


@internal
def tick(b: int, bank_class: type, first: int, last: int, setting: Any) -> None:
    """Advance object and bank of lanes first .. last - 1 of block b, and count the tick."""
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
    sensors = arrays.sensors
    move(block, arrays.scratch[0].noise, first, last, sensors, motions_of(bank), setting)
    operations.step_imm(bank, block, first, last, arrays.radii, sensors, filter_model(setting))
    for lane in range(first, last):
        block.time[lane] += 1
        write_trace(arrays.trace[b * LANES + lane], block, lane, block.stated_mode[lane])


@internal
def write_rows(b: int, bank_class: type, first: int, last: int, begun: int, setting: Any) -> None:
    """Write the rows of lanes first .. last - 1 of block b."""
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
    heights = heights_of(bank)
    for lane in range(first, last):
        row = arrays.observations[b * LANES + lane]
        write_quickest_row(row, block, lane, bank, setting)
        write_heights(heights, row, block, lane, setting)


@internal
def advance_live(begins: bool, bank_class: type, setting: Any) -> int:
    """Begin tracks, or process statements and measurements, with unknown switch moments. With
    `begins` every filter starts from `estimate` and `covariance` of its track; the action is the
    mode before the first tick, -1 if it is not known. Otherwise it is the statement of the last
    tick.
    """
    arrays = arrays_of(setting)
    for b in range(setting.first_block, setting.last_block):
        block = arrays.blocks[b]
        bank = operations.bank_of(bank_class, setting, b)
        lanes = min(LANES, setting.tracks - b * LANES)
        for lane in range(np.uint64(lanes)):
            stated = arrays.actions[b * LANES + int(lane)]
            if begins:
                block.time[lane], block.stated_mode[lane], block.stated_ticks[lane] = 0, 0, 0
                operations.begin_imm(bank, block, lane, stated)
            elif block.time[lane] > 0:
                record_statement(block, lane, stated)
        if begins:
            continue
        first, last = np.uint64(0), np.uint64(lanes)
        model = filter_model(setting)
        operations.step_imm(bank, block, first, last, arrays.radii, arrays.sensors, model)
        for lane in range(first, last):
            block.time[lane] += 1
        write_rows(b, bank_class, first, last, 0, setting)
    return 0
