"""The kernel: object, measurement, bank, reward, fast-forward and autoreset of many tracks in one
loop. The operations of every tick are loops over the lanes of a block (see `memory`). Decisions
and new segments occur in few tracks and are computed for single lanes. Threads step different
blocks.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.bank_ticks import write_corrected, write_innovations
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import (
    IDENTITY,
    estimate_of,
    filter_model,
    likeliest,
    likeliest_of_type,
    mode_type,
)
from hybrid_env.core.banks.mixture import merged_estimate, write_merged_covariance
from hybrid_env.core.compilation import inlined, internal
from hybrid_env.core.memory import (
    DECISION,
    DECISION_FLAGS,
    LANES,
    SEGMENT_COLUMNS,
    FloatArray,
    Records,
    state_of,
    triangle_of,
    write_lane,
)
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.noise import draw_noise_ahead, integer_below
from hybrid_env.core.observation_row import (
    BANK_ROW,
    compare_hypotheses,
    compare_types,
    mask_declarations,
    write_segment,
    write_tick,
    write_twin,
)
from hybrid_env.core.true_object import (
    begin_motion,
    draw_first_estimate,
    move,
    move_lane,
    sum_errors,
)

MODE, LENGTH = SEGMENT_COLUMNS.index("mode"), SEGMENT_COLUMNS.index("length")
DECIDED_MODE, DECIDED_TRUE_MODE, TICKS, DECIDED_LENGTH, SQUARED_ERROR = range(len(DECISION))
HAS_DECISION, CORRECT, TYPE_CORRECT, FORCED = range(len(DECISION_FLAGS))
# Events of a step, combined as bits.
DECIDED, TERMINATED = 1, 2


@inlined
def _record_estimate(
    block: Any,
    lane: int,
    hypotheses: Records,
    trace: FloatArray,
    merged: bool,
) -> None:
    """Record the estimate of the active filter or the merged one, its squared error, and a row
    of a stored trace.
    """
    estimate = (
        merged_estimate(hypotheses, lane)
        if merged
        else estimate_of(hypotheses, block.active_mode[lane], lane)
    )
    write_lane(block.estimate, lane, estimate)
    x, _, y, _ = estimate
    error_x = x - block.truth[0, lane]
    error_y = y - block.truth[2, lane]
    block.squared_error[lane] += error_x * error_x + error_y * error_y
    if trace.shape[0] > 0 and block.trace_length[lane] < trace.shape[0]:
        row = trace[block.trace_length[lane]]
        for k in range(4):
            row[k] = block.truth[k, lane]
        row[4], row[5] = block.measurement[0, lane], block.measurement[1, lane]
        row[6], row[7] = x, y
        row[8] = block.active_mode[lane]
        row[9] = block.segment[lane]
        block.trace_length[lane] += 1


@inlined
def begin_bank(block: Any, lane: int, bank: Any, radii: FloatArray, setting: Any) -> None:
    """Begin a segment of the bank: every filter starts from the anchor and the kept covariance
    of the block.
    """
    anchor, covariance = state_of(block.anchor, lane), triangle_of(block.covariance, lane)
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    block.speed[lane], block.heading[0, lane], block.heading[1, lane] = speed, heading_x, heading_y
    if setting.reset_covariance:
        covariance = IDENTITY
    if setting.oracle:
        # Its anchor is exact.
        covariance = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    operations.begin(bank, lane, anchor, covariance, radii, setting)
    block.tick[lane] = 0


@inlined
def _begin_segment(block: Any, lane: int, bank: Any, arrays: Any, setting: Any) -> None:
    """Begin a segment, before its first tick: the object from its true state, the bank from the
    estimate.
    """
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
    begin_bank(block, lane, bank, arrays.radii, setting)
    block.squared_error[lane] = 0.0


@inlined
def step_irregular(
    bank: Any,
    first: Any,
    last: Any,
    block: Any,
    sensors: Records,
    setting: Any,
) -> None:
    """Advance every filter of lanes first .. last - 1 where measurements may be missing or of
    any covariance.
    """
    for lane in range(first, last):
        missing = math.isnan(block.measurement[0, lane])
        model = filter_model(setting, 1.0)
        if missing or setting.radar:
            operations.predict(bank, np.uint64(lane), model)
            for h in range(0 if missing else bank.hypotheses.size):
                operations.correct(bank, np.uint64(lane), h, block, sensors, model)
        else:
            model = filter_model(setting, block.noise[0, lane])
            operations.step(bank, np.uint64(lane), np.uint64(lane + 1), block.measurement, model)


@inlined
def follow_irregular(
    bank: Any,
    lane: int,
    chosen: int,
    block: Any,
    sensors: Any,
    setting: Any,
) -> None:
    """Advance the filter of one hypothesis; see `step_irregular`. Without a measurement all are
    predicted.
    """
    missing = math.isnan(block.measurement[0, lane])
    model = filter_model(setting, 1.0)
    if missing or setting.radar:
        before = bank.hypotheses[chosen].log_likelihood[lane]
        operations.predict(bank, np.uint64(lane), model)
        if not missing:
            operations.correct(bank, np.uint64(lane), chosen, block, sensors, model)
        bank.hypotheses[chosen].log_likelihood[lane] = before
    else:
        model = filter_model(setting, block.noise[0, lane])
        operations.follow(bank, lane, chosen, block.measurement, model)


@internal
def step_lanes(
    block: Any,
    bank: Any,
    first: int,
    last: int,
    sensors: Records,
    setting: Any,
) -> None:
    """Advance every filter of lanes first .. last - 1 by the measurement of the block, if there
    is one.
    """
    if setting.irregular:
        step_irregular(bank, first, last, block, sensors, setting)
    else:
        operations.step(bank, first, last, block.measurement, filter_model(setting, 1.0))


@internal
def chosen_mode(block: Any, lane: int, bank: Any, action: int, setting: Any) -> int:
    """Return the mode of a decision: the declared one, or that of a segment that ends undecided."""
    forced = action == 0
    if forced and setting.keep_undecided:
        return block.active_mode[lane]
    if forced or setting.declare_best:
        return likeliest(bank.hypotheses, lane)
    if setting.declare_type:
        # Actions 1 and 2 declare straight motion and a left turn, whose first hypotheses are 0 and
        # 1; action 3 a right turn.
        first_right = bank.hypotheses.size // 2 + 1
        return likeliest_of_type(bank.hypotheses, lane, first_right if action == 3 else action - 1)
    return action - 1


@inlined
def set_anchor(block: Any, lane: int, bank: Any, chosen: int, merged: bool) -> None:
    """Set the estimate at a switch and its covariance: of the chosen filter, or merged over the
    bank.
    """
    if merged:
        mean = merged_estimate(bank.hypotheses, lane)
        write_lane(block.estimate, lane, mean)
        write_merged_covariance(bank, lane, mean, block.covariance)
    else:
        write_lane(block.estimate, lane, estimate_of(bank.hypotheses, chosen, lane))
        write_lane(block.covariance, lane, operations.covariance(bank, chosen, lane))


@internal
def _decide(
    block: Any,
    lane: int,
    i: int,
    action: int,
    bank: Any,
    arrays: Any,
    setting: Any,
) -> None:
    """Record the decision of track i and fast-forward to the end of the segment."""
    trace, decisions, flags = arrays.trace[i], arrays.decisions, arrays.decision_flags
    n = bank.hypotheses.size // 2
    true_mode = block.true_mode[lane]
    chosen = chosen_mode(block, lane, bank, action, setting)
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
    if setting.recalculated > 0 and action > 0:
        block.squared_error[lane] = arrays.errors[i // LANES, chosen, lane]
    noise, irregular, merged = arrays.scratch[0].noise, setting.irregular, setting.merged
    model = filter_model(setting, 1.0)
    start = np.uint64(lane)
    stop = np.uint64(lane + 1)
    while block.tick[lane] < block.length[lane]:
        ticks = 1 if irregular else min(LANES, block.length[lane] - block.tick[lane])
        if irregular:
            move(block, noise, start, stop, arrays.sensors, setting)
        else:
            # The noise of several ticks is drawn at once with SIMD code.
            draw_noise_ahead(block.random_state, lane, noise, ticks, setting)
        for column in range(ticks):
            if not irregular:
                move_lane(block, lane, noise, column, setting)
            if merged or setting.refined:
                step_lanes(block, bank, start, stop, arrays.sensors, setting)
                if setting.refined:
                    chosen = likeliest_of_type(bank.hypotheses, lane, chosen)
                    block.active_mode[lane] = chosen
            elif irregular:
                follow_irregular(bank, lane, chosen, block, arrays.sensors, setting)
            else:
                operations.follow(bank, lane, chosen, block.measurement, model)
            _record_estimate(block, lane, bank.hypotheses, trace, merged)
    set_anchor(block, lane, bank, chosen, merged)
    arrays.rewards[i] = (1.0 if correct else -1.0) - setting.delay_cost
    arrays.decided_numbers[SQUARED_ERROR, i] = block.squared_error[lane]


@inlined
def counted_action(arrays: Any, i: int) -> int:
    """Return the action of track i, or 0 for a declaration that the mask makes wait."""
    action = arrays.actions[i]
    return action if action == 0 or arrays.action_mask[i, action] > 0 else 0


@inlined
def _advance_block(reset: bool, b: int, bank: Any, arrays: Any, setting: Any) -> int:
    """Step the tracks of a block; see `kernels.advance_published`. Returns their events,
    combined as bits.
    """
    block, scratch = arrays.blocks[b], arrays.scratch[0]
    lanes = min(LANES, setting.tracks - b * LANES)
    events = 0
    # One bit per lane.
    new_segments = 0
    # All lanes advance in this tick.
    all_running = True
    for lane in range(lanes):
        i = b * LANES + lane
        action = counted_action(arrays, i)
        scratch.running[lane] = 1
        if reset and arrays.actions[i] == 0:
            scratch.running[lane] = 0
            all_running = False
            continue
        if setting.trace_rows > 0:
            block.trace_length[lane] = 0
        if arrays.decision_flags[HAS_DECISION, i]:
            for k in range(len(DECISION)):
                arrays.decisions[k, i] = 0
            for k in range(len(DECISION_FLAGS)):
                arrays.decision_flags[k, i] = False
        if reset or arrays.terminated[i]:
            draw_first_estimate(block, scratch.noise, lane, setting)
            block.segment[lane] = 0
            # Golubkov 2018, algorithm 1, line 2.
            block.active_mode[lane] = 0
            arrays.rewards[i] = 0.0
            arrays.terminated[i] = False
            # A segment begins.
            event = DECIDED
        elif action == 0 and block.tick[lane] < block.length[lane]:
            arrays.rewards[i] = -setting.delay_cost
            event = 0
        else:
            _decide(block, lane, i, action, bank, arrays, setting)
            event = DECIDED
            if block.segment[lane] + 1 == setting.segments:
                arrays.terminated[i] = True
                event = DECIDED + TERMINATED
            else:
                block.segment[lane] += 1
            events |= event
        if event & TERMINATED:
            scratch.running[lane] = 0
            all_running = False
        elif event & DECIDED:
            _begin_segment(block, lane, bank, arrays, setting)
            new_segments |= 1 << lane
    for first in range(1 if all_running else lanes):
        if scratch.running[first] == 0:
            continue
        last = lanes if all_running else first + 1
        # Unsigned indices need no check for negative values, so that loops over lanes compile to
        # SIMD code.
        start = np.uint64(first)
        stop = np.uint64(last)
        move(block, scratch.noise, start, stop, arrays.sensors, setting)
        if setting.bank_rows > 0:
            write_innovations(arrays.bank_ticks, b, block, first, last, bank, setting)
        step_lanes(block, bank, start, stop, arrays.sensors, setting)
        if setting.bank_rows > 0:
            write_corrected(arrays.bank_ticks, b, first, last, bank)
        compare_hypotheses(scratch, bank.hypotheses, start, stop)
        if setting.log_error_allowed < 0.0:
            if not setting.exact:
                compare_types(scratch, bank.hypotheses, start, stop)
            for lane in range(first, last):
                mask_declarations(arrays.action_mask[b * LANES + lane], scratch, lane, setting)
        for lane in range(first, last):
            i = b * LANES + lane
            if setting.recalculated > 0:
                sum_errors(block, lane, bank.hypotheses, arrays.errors[b])
            _record_estimate(block, lane, bank.hypotheses, arrays.trace[i], setting.merged)
            row = arrays.observations[i]
            if setting.observation != BANK_ROW:
                write_twin(row, block, lane, setting)
                continue
            if new_segments & (1 << lane):
                write_segment(row, block, lane, arrays.radii, setting)
            write_tick(row, block, lane, scratch, bank, setting)
    return events


@inlined
def invalid_action(reset: bool, arrays: Any, setting: Any) -> int:
    """Return 0, or -1 - i if a step has an action of track i outside the space."""
    if not reset:
        for i in range(setting.tracks):
            if arrays.actions[i] < 0 or arrays.actions[i] >= setting.action_count:
                return -1 - i
    return 0


@inlined
def advance(reset: bool, banks: Any, arrays: Any, setting: Any) -> int:
    """Check all actions, then step the blocks of this call; see `kernels.advance_published`."""
    events = invalid_action(reset, arrays, setting)
    if events == 0:
        for b in range(setting.first_block, setting.last_block):
            events |= _advance_block(reset, b, operations.bank_of_block(banks, b), arrays, setting)
    return events
