"""Tracks with announced switches: what happens to the lanes of a block in a tick, see `kernel`. On
a live sensor the measurement comes from the caller.
"""

from typing import Any

import numpy as np

from hybrid_env.core.arrays import FloatArray, IntArray
from hybrid_env.core.bank_ticks import write_corrected, write_innovations
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import (
    estimate_of,
    filter_model,
    likeliest,
    likeliest_of_type,
    motions_of,
)
from hybrid_env.core.banks.height import begin_heights, estimate_heights, heights_of, step_heights
from hybrid_env.core.banks.posterior import (
    NOTHING,
    by_likelihood,
    compare,
    compare_types,
    write_covariance,
    write_mean,
)
from hybrid_env.core.compilation import apart, inlined, internal, stay_apart
from hybrid_env.core.elementary import bits_of
from hybrid_env.core.kernel import BEGUN, DECIDED, HALTED, TERMINATED
from hybrid_env.core.memory import DECISION, LANES, arrays_of, state_of, triangle_of, write_lane
from hybrid_env.core.motion import heading_vector
from hybrid_env.core.noise import GAUSSIAN, draw_normals, integer_below
from hybrid_env.core.observation_row import (
    BANK_ROW,
    log_error_probability,
    mask_declarations,
    write_heights,
    write_segment,
    write_tick,
    write_trace,
    write_twin,
)
from hybrid_env.core.true_object import (
    LENGTH,
    MODE,
    begin_motion,
    draw_first_estimate,
    move,
    move_lane,
)

# First of `DECISION_FLAGS`.
HAS_DECISION = 0


@internal
def _merge(block: Any, bank: Any, first: int, last: int) -> None:
    """Write the estimates of lanes first .. last - 1, merged over the bank, to the block."""
    compare(bank, by_likelihood, first, last)
    write_mean(bank, block, first, last)
    estimate_heights(heights_of(bank), bank, block, None, first, last)


@internal
def _record_estimate(block: Any, lane: int, bank: Any, trace: FloatArray, merged: bool) -> None:
    """Record the estimate of the active filter or, after `_merge`, the merged one, its squared
    error, and a row of a stored trace.
    """
    if not merged:
        estimate = estimate_of(bank.hypotheses, block.active_mode[lane], lane)
        write_lane(block.estimate, lane, estimate)
    error_x = block.estimate[0, lane] - block.truth[0, lane]
    error_y = block.estimate[2, lane] - block.truth[2, lane]
    block.squared_error[lane] += error_x * error_x + error_y * error_y
    write_trace(trace, block, lane, block.active_mode[lane])


@inlined
def begin_bank(block: Any, lane: int, bank: Any, radii: FloatArray, setting: Any) -> None:
    """Begin a segment of the bank: every filter starts from the anchor and the kept covariance
    of the block.
    """
    anchor, covariance = state_of(block.anchor, lane), triangle_of(block.covariance, lane)
    speed, heading_x, heading_y = heading_vector(anchor[1], anchor[3])
    block.speed[lane], block.heading[0, lane], block.heading[1, lane] = speed, heading_x, heading_y
    if setting.reset_covariance:
        # P := I, as published (Tsyganov 2019, line 28; Golubkov 2018, setFilters).
        covariance = 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    if setting.oracle:
        # Its anchor is exact.
        covariance = NOTHING
    operations.begin(bank, lane, anchor, covariance, radii, setting)
    begin_heights(heights_of(bank), bank, block, lane)
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
    begin_motion(block, lane, table[row], motions_of(bank), setting.tau)
    for k in range(4):
        block.anchor[k, lane] = block.truth[k, lane] if setting.oracle else block.estimate[k, lane]
    begin_bank(block, lane, bank, arrays.radii, setting)
    block.squared_error[lane] = 0.0


@internal
def run_on(block: Any, lane: int, bank: Any, arrays: Any, setting: Any) -> None:
    """Advance the filters of a lane after a decision: all of them, or that of the decided mode
    without its log-likelihood. Golubkov 2018, algorithm 1, line 15.
    """
    chosen = block.active_mode[lane]
    kalman = bank.hypotheses[chosen]
    before = kalman.log_likelihood[lane]
    lowest, stop = (0, bank.hypotheses.size) if setting.merged else (chosen, chosen + 1)
    last, model = lane + np.uint64(1), filter_model(setting)
    operations.step(bank, lowest, stop, lane, last, block, arrays.sensors, model)
    heights = heights_of(bank)
    step_heights(heights, bank, lowest, stop, lane, last, block.height, model)
    estimate_heights(heights, bank, block, block.active_mode, lane, last)
    if not setting.merged:
        kalman.log_likelihood[lane] = before


@internal
def chosen_mode(
    block: Any, lane: int, bank: Any, action: int, types: IntArray, setting: Any
) -> int:
    """Return the mode of a decision: the declared one, or that of a segment that ends undecided.
    types: (M,) of every mode.
    """
    forced = action == 0
    if forced and setting.keep_undecided:
        return block.active_mode[lane]
    if forced:
        return likeliest(bank.hypotheses, lane)
    if setting.declare_type:
        return likeliest_of_type(bank.hypotheses, types, lane, action - 1)
    return action - 1


@internal
def set_anchor(block: Any, lane: int, bank: Any, merged: bool) -> None:
    """Set the estimate at a switch and its covariance: of the filter of the decided mode, or
    merged over the bank.
    """
    if merged:
        stop = lane + np.uint64(1)
        _merge(block, bank, lane, stop)
        write_covariance(bank, block, lane, stop, operations.covariance)
    else:
        chosen = block.active_mode[lane]
        write_lane(block.estimate, lane, estimate_of(bank.hypotheses, chosen, lane))
        write_lane(block.covariance, lane, operations.covariance(bank, chosen, lane))
        heights, last = heights_of(bank), lane + np.uint64(1)
        estimate_heights(heights, bank, block, block.active_mode, lane, last)


@inlined
def delay_of(block: Any, lane: int, setting: Any) -> float:
    """Return the cost of the ticks since the last decision to wait, or since the switch."""
    return setting.delay_cost * ((block.tick[lane] - 1) % setting.decide_every + 1)


@inlined
def _decide(
    block: Any, lane: int, i: int, action: int, bank: Any, arrays: Any, setting: Any
) -> None:
    """Record the decision of track i and fast-forward to the end of the segment."""
    trace, decisions, flags = arrays.trace[i], arrays.decisions, arrays.decision_flags
    delay = delay_of(block, lane, setting)
    types = arrays.types
    true_mode = block.true_mode[lane]
    chosen = chosen_mode(block, lane, bank, action, types, setting)
    of_type = types[chosen] == types[true_mode]
    correct = chosen == true_mode if setting.exact else of_type
    flags[HAS_DECISION, i] = True
    for k, flag in enumerate((correct, of_type, action == 0)):
        flags[1 + k, i] = flag
    for k, value in enumerate((chosen, true_mode, block.tick[lane], block.length[lane])):
        decisions[k, i] = value
    block.active_mode[lane] = chosen
    noise, merged = arrays.scratch[0].noise, setting.merged
    motions = motions_of(bank)
    stop = lane + np.uint64(1)
    # Normal noise of several ticks is drawn at once with SIMD code.
    batch = LANES if setting.noise_law == GAUSSIAN and not setting.irregular else 1
    if motions is not None:
        batch = 1
    while block.tick[lane] < block.length[lane]:
        ticks = np.uint64(min(batch, block.length[lane] - block.tick[lane]))
        if batch > 1:
            draw_normals(block.random_state, noise, np.uint64(0), ticks, lane)
        for column in range(ticks):
            if batch > 1:
                move_lane(block, lane, noise, column, motions, setting)
            else:
                move(block, noise, lane, stop, arrays.sensors, motions, setting)
            run_on(block, lane, bank, arrays, setting)
            if merged:
                _merge(block, bank, lane, stop)
            _record_estimate(block, lane, bank, trace, merged)
    set_anchor(block, lane, bank, merged)
    arrays.rewards[i] = (1.0 if correct else -1.0) - delay
    decisions[len(DECISION) - 1, i] = bits_of(block.squared_error[lane])


@inlined
def counted_action(arrays: Any, i: int) -> int:
    """Return the action of track i, or 0 for a declaration that the mask makes wait."""
    action = arrays.actions[i]
    return action if action == 0 or arrays.action_mask[i, action] > 0 else 0


@internal
def prepare_lane(reset: bool, block: Any, lane: int, i: int, bank: Any, setting: Any) -> int:
    """Apply the action of track i, or begin its next episode. Returns the events of the lane."""
    arrays = arrays_of(setting)
    action = counted_action(arrays, i)
    block.trace_length[lane] = 0
    if arrays.decision_flags[HAS_DECISION, i]:
        arrays.decisions[:, i] = 0
        arrays.decision_flags[:, i] = False
    if reset or arrays.terminated[i]:
        draw_first_estimate(block, arrays.scratch[0].noise, lane, setting)
        block.segment[lane] = 0
        # Golubkov 2018, algorithm 1, line 2.
        block.active_mode[lane] = 0
        arrays.rewards[i] = 0.0
        arrays.terminated[i] = False
        event = BEGUN
    elif action == 0 and block.tick[lane] < block.length[lane]:
        arrays.rewards[i] = -delay_of(block, lane, setting)
        return 0
    else:
        _decide(block, lane, i, action, bank, arrays, setting)
        if block.segment[lane] + 1 == setting.segments:
            arrays.terminated[i] = True
            return DECIDED | TERMINATED
        block.segment[lane] += 1
        event = DECIDED | BEGUN
    _begin_segment(block, lane, bank, arrays, setting)
    return event


@internal
def wait_lane(block: Any, lane: int, i: int, bank: Any, setting: Any) -> int:
    """Return the events of a lane that waits for the next decision: it halts where the segment
    ends.
    """
    return 0 if block.tick[lane] < block.length[lane] else HALTED


@apart
def _step_bank(b: int, bank_class: type, first: int, last: int, setting: Any) -> None:
    """Advance the bank of lanes first .. last - 1 of block b by their measurements."""
    stay_apart()
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
    model = filter_model(setting)
    if setting.bank_rows > 0:
        write_innovations(arrays.bank_ticks, b, block, first, last, bank, setting)
    operations.step(bank, 0, bank.hypotheses.size, first, last, block, arrays.sensors, model)
    heights = heights_of(bank)
    step_heights(heights, bank, 0, bank.hypotheses.size, first, last, block.height, model)
    estimate_heights(heights, bank, block, block.active_mode, first, last)
    if setting.bank_rows > 0:
        write_corrected(arrays.bank_ticks, b, first, last, bank)
    if setting.merged:
        _merge(block, bank, first, last)


@internal
def tick(b: int, bank_class: type, first: int, last: int, setting: Any) -> None:
    """Advance object and bank of lanes first .. last - 1 of block b."""
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
    noise = arrays.scratch[0].noise
    move(block, noise, first, last, arrays.sensors, motions_of(bank), setting)
    _step_bank(b, bank_class, first, last, setting)
    for lane in range(first, last):
        trace = arrays.trace[b * LANES + lane]
        _record_estimate(block, lane, bank, trace, setting.merged)


@apart
def write_rows(b: int, bank_class: type, first: int, last: int, begun: int, setting: Any) -> None:
    """Write the rows of lanes first .. last - 1 of block b, and which declarations count. begun:
    one bit per lane, 1 where a segment begins.
    """
    stay_apart()
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[b], operations.bank_of(bank_class, setting, b)
    scratch = arrays.scratch[0]
    # Else `_merge` has compared them.
    if not setting.merged:
        compare(bank, by_likelihood, first, last)
    others = bank.sums[0].others
    for lane in range(first, last):
        scratch.log_error[lane] = log_error_probability(others[lane])
    if setting.log_error_allowed < 0.0:
        if not setting.exact:
            others = scratch.type_ratio
            compare_types(bank, arrays.types, arrays.type_likelihoods, others, first, last)
        for lane in range(first, last):
            mask_declarations(arrays.action_mask[b * LANES + lane], others[lane], setting)
    heights = heights_of(bank)
    for lane in range(first, last):
        row = arrays.observations[b * LANES + lane]
        write_heights(heights, row, block, lane, setting)
        if setting.observation != BANK_ROW:
            write_twin(row, block, lane, bank, setting)
            continue
        if begun & (1 << lane):
            write_segment(row, block, lane, arrays.curvatures, setting)
        write_tick(row, block, lane, scratch, bank, setting)


@internal
def advance_live(begins: bool, bank_class: type, setting: Any) -> int:
    """Begin a segment, process a measurement, or declare a mode, on the first lane of the first
    block. With `begins` the last segment ends, and the bank starts from its estimate; the first
    one, whose `segment` is -1, from that of the block. Action 0 advances the bank by the
    `measurement`, and writes the observation until a mode is declared; i + 1 declares mode i, once
    the mask allows it. Then `estimate` and `covariance` are those of the last decided mode, or
    merged.
    """
    arrays = arrays_of(setting)
    block, bank = arrays.blocks[0], operations.bank_of(bank_class, setting, 0)
    lane, last = np.uint64(0), np.uint64(1)
    if begins:
        if block.segment[0] >= 0:
            if not arrays.decision_flags[HAS_DECISION, 0]:
                block.active_mode[0] = chosen_mode(block, lane, bank, 0, arrays.types, setting)
            set_anchor(block, lane, bank, setting.merged)
        block.segment[0] += 1
        arrays.decision_flags[HAS_DECISION, 0] = False
        write_lane(block.anchor, lane, state_of(block.estimate, lane))
        begin_bank(block, lane, bank, arrays.radii, setting)
        return 0
    if arrays.actions[0] > 0:
        action = counted_action(arrays, 0)
        if action == 0:
            return 0
        block.active_mode[0] = chosen_mode(block, lane, bank, action, arrays.types, setting)
        arrays.decision_flags[HAS_DECISION, 0] = True
        set_anchor(block, lane, bank, setting.merged)
        return 0
    decided = arrays.decision_flags[HAS_DECISION, 0]
    block.tick[0] += 1
    block.length[0] = max(block.length[0], block.tick[0])
    if decided:
        run_on(block, lane, bank, arrays, setting)
    else:
        _step_bank(0, bank_class, lane, last, setting)
        begun = 1 if block.tick[0] == 1 else 0
        write_rows(0, bank_class, lane, last, begun, setting)
    set_anchor(block, lane, bank, setting.merged)
    return 0
