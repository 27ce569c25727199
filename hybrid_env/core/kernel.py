"""The kernel: truth, measurement, bank, reward, fast-forward and autoreset of many tracks in one loop.

Tracks lie in blocks (see `track`), so what every track does at a tick is a loop over the lanes of a block;
what few do, a decision or a new segment, is done for one lane. Loops are serial: the work of a step is too
small to be worth a fork.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.core import bank_operations as banks
from hybrid_env.core.compilation import compiled, formula, internal
from hybrid_env.core.in_place import array_at, prefetch
from hybrid_env.core.instructions import smaller, span
from hybrid_env.core.memory import CACHE_LINE
from hybrid_env.core.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.core.noise import draw_noise, draw_noise_ahead, integer_below, uniform
from hybrid_env.core.published_bank import estimate_of, likeliest, mode_type
from hybrid_env.core.records import (
    BLOCK,
    DECISION,
    DECISION_FLAGS,
    EVERY_TICK,
    LANES,
    PARAMETERS,
    SCRATCH,
    TRACE_COLUMNS,
)
from hybrid_env.observation import row_width, weigh, write_segment, write_tick

NOTHING = (0.0,) * 10  # covariance of an anchor that is the truth
TRACE_WIDTH = len(TRACE_COLUMNS)
BLOCK_SIZE = BLOCK.itemsize  # bytes
DECIDED_MODE, DECIDED_TRUE_MODE, TICKS, DECIDED_LENGTH, DECIDED_SQUARED_ERROR = range(len(DECISION))
HAS_DECISION, CORRECT, TYPE_CORRECT, FORCED = range(len(DECISION_FLAGS))
DECIDED, TERMINATED = 1, 2  # events of a step, added up


@internal
def turn(block: Any, lane: int, signed_radius: float, tau: float) -> None:
    """The object begins a segment: its turn is anchored at its true state. Golubkov 2018, eq. (1)."""
    x, vx, y, vy = block.truth[0, lane], block.truth[1, lane], block.truth[2, lane], block.truth[3, lane]
    speed, heading_x, heading_y = heading_vector(vx, vy)
    turn_rate = 0.0 if signed_radius == 0.0 else speed / abs(signed_radius)
    cosine, sine_velocity, sine_position = motion_coefficients(turn_rate, tau)
    block.true_motion[0, lane] = cosine
    block.true_motion[1, lane] = sine_velocity
    block.true_motion[2, lane] = sine_position
    block.true_centre[0, lane], block.true_centre[1, lane] = turn_centre(
        x, y, heading_x, heading_y, signed_radius
    )


@formula
def _move(
    block: Any,
    lane: int,
    noise: NDArray[np.float64],
    column: int,
    process_deviation: float,
    deviation_x: float,
    deviation_y: float,
) -> None:
    """The object of a lane moves one tick and is measured; what it draws is in a column of noise."""
    truth = block.truth
    cosine, sine_velocity, sine_position = (
        block.true_motion[0, lane], block.true_motion[1, lane], block.true_motion[2, lane],
    )  # fmt: skip
    x, vx = propagate(
        truth[0, lane], truth[1, lane], block.true_centre[0, lane], cosine, sine_velocity, sine_position
    )
    y, vy = propagate(
        truth[2, lane], truth[3, lane], block.true_centre[1, lane], cosine, sine_velocity, sine_position
    )
    truth[0, lane] = x
    truth[1, lane] = vx + process_deviation * noise[0, column]
    truth[2, lane] = y
    truth[3, lane] = vy + process_deviation * noise[1, column]
    block.measurement[0, lane] = x + deviation_x * noise[2, column]
    block.measurement[1, lane] = y + deviation_y * noise[3, column]
    block.tick[lane] += 1


@internal
def move(
    block: Any,
    noise: NDArray[np.float64],
    first: int,
    last: int,
    process_deviation: float,
    deviation_x: float,
    deviation_y: float,
    outliers: float,
) -> None:
    """The objects of lanes first .. last - 1 move one tick and are measured. Golubkov 2018, eq. (1).

    noise: (5, LANES) to work with. process_deviation: sqrt(Q) [m/s]. deviation_x, deviation_y: sqrt(R) of
    each axis [m]. outliers: share of measurements with `noise.OUTLIER` times that deviation.
    """
    draw_noise(block.random_state, noise, first, last, outliers)
    for lane in span(first, last):
        _move(block, lane, noise, lane, process_deviation, deviation_x, deviation_y)


@internal
def _tick(block: Any, bank: Any, scratch: Any, parameters: Any, first: int, last: int) -> None:
    """One tick of the object and of every hypothesis, for lanes first .. last - 1."""
    move(
        block, scratch.noise, first, last,
        parameters.process_deviation, parameters.deviation_x, parameters.deviation_y,
        parameters.outliers,
    )  # fmt: skip
    banks.step(bank, first, last, block.measurement, parameters)
    weigh(scratch, bank.hypotheses, first, last)


@internal
def _account(block: Any, lane: int, hypotheses: NDArray[Any], trace: NDArray[np.float64]) -> None:
    """The active filter's estimate, as in ATE, its error, and the tick in the trace if there is room."""
    x, vx, y, vy = estimate_of(hypotheses, block.active_mode[lane], lane)
    block.estimate[0, lane], block.estimate[1, lane] = x, vx
    block.estimate[2, lane], block.estimate[3, lane] = y, vy
    error_x, error_y = x - block.truth[0, lane], y - block.truth[2, lane]
    block.squared_error[lane] += error_x * error_x + error_y * error_y
    if trace.shape[0] > 0 and block.traced[lane] < trace.shape[0]:
        row = trace[block.traced[lane]]
        for k in span(0, 4):
            row[k] = block.truth[k, lane]
        row[4], row[5] = block.measurement[0, lane], block.measurement[1, lane]
        row[6], row[7] = x, y
        row[8] = block.active_mode[lane]
        row[9] = block.segment[lane]
        block.traced[lane] += 1


@internal
def _begin_segment(
    block: Any,
    lane: int,
    bank: Any,
    parameters: Any,
    radii: NDArray[np.float64],
    table: NDArray[np.float64],
) -> None:
    """Anchor the object at its true state and the bank at the estimate; the first tick is still to come."""
    if parameters.random_scheme:
        row = integer_below(block.random_state, lane, table.shape[0])
        lengths = parameters.longest - parameters.shortest + 1
        block.length[lane] = parameters.shortest + integer_below(block.random_state, lane, lengths)
    else:
        row = block.segment[lane]
        block.length[lane] = np.int64(table[row, 2])
    block.true_mode[lane] = np.int64(table[row, 1])
    turn(block, lane, table[row, 0], parameters.tau)
    for k in span(0, 4):
        block.anchor[k, lane] = block.truth[k, lane] if parameters.oracle else block.estimate[k, lane]
    anchor = (
        block.anchor[0, lane], block.anchor[1, lane], block.anchor[2, lane], block.anchor[3, lane],
    )  # fmt: skip
    block.speed[lane], block.heading[0, lane], block.heading[1, lane] = heading_vector(anchor[1], anchor[3])
    kept = block.kept_covariance
    covariance = (
        kept[0, lane], kept[1, lane], kept[2, lane], kept[3, lane], kept[4, lane],
        kept[5, lane], kept[6, lane], kept[7, lane], kept[8, lane], kept[9, lane],
    )  # fmt: skip
    if parameters.reset_covariance:
        covariance = banks.IDENTITY
    if parameters.oracle:
        covariance = NOTHING
    banks.begin(bank, lane, anchor, covariance, radii, parameters)
    block.tick[lane] = 0
    block.squared_error[lane] = 0.0


@internal
def _begin_episode(block: Any, scratch: Any, lane: int, parameters: Any) -> None:
    """Put the object at its start and draw the first estimate."""
    heading = parameters.heading
    if math.isnan(heading):
        heading = 2.0 * math.pi * uniform(block.random_state, lane)
    block.truth[0, lane], block.truth[2, lane] = 0.0, 0.0
    block.truth[1, lane] = parameters.speed * math.cos(heading)
    block.truth[3, lane] = parameters.speed * math.sin(heading)
    draw_noise(block.random_state, scratch.noise, lane, lane + 1, 0.0)
    for k in span(0, len(NOTHING)):
        block.kept_covariance[k, lane] = 0.0
    for axis in span(0, 2):
        variance = parameters.variance_x if axis == 0 else parameters.variance_y
        position_variance = parameters.initial_position * variance
        velocity_variance = parameters.initial_velocity
        position, velocity = scratch.noise[2 * axis, lane], scratch.noise[2 * axis + 1, lane]
        block.estimate[2 * axis, lane] = block.truth[2 * axis, lane] + math.sqrt(position_variance) * position
        block.estimate[2 * axis + 1, lane] = (
            block.truth[2 * axis + 1, lane] + math.sqrt(velocity_variance) * velocity
        )
        first = 0 if axis == 0 else 7  # of the axis's own entries in the upper triangle
        block.kept_covariance[first, lane] = position_variance
        block.kept_covariance[4 if axis == 0 else 9, lane] = velocity_variance
    block.segment[lane] = 0
    block.active_mode[lane] = 0  # Golubkov 2018, algorithm 1, line 2


@internal
def _decide(
    block: Any,
    lane: int,
    bank: Any,
    scratch: Any,
    parameters: Any,
    trace: NDArray[np.float64],
    decisions: NDArray[np.int64],
    flags: NDArray[np.bool_],
    i: int,
    chosen: int,
    forced: bool,
) -> None:
    """Note the decision and run the chosen filter alone to the end of the segment."""
    n = bank.hypotheses.size // 2
    true_mode = block.true_mode[lane]
    exactly = chosen == true_mode
    of_type = mode_type(chosen, n) == mode_type(true_mode, n)
    correct = exactly if parameters.exact else of_type
    flags[HAS_DECISION, i] = True
    decisions[DECIDED_MODE, i] = chosen
    decisions[DECIDED_TRUE_MODE, i] = true_mode
    decisions[TICKS, i] = block.tick[lane]
    decisions[DECIDED_LENGTH, i] = block.length[lane]
    flags[CORRECT, i] = correct
    flags[TYPE_CORRECT, i] = of_type
    flags[FORCED, i] = forced
    block.active_mode[lane] = chosen
    while block.tick[lane] < block.length[lane]:
        ticks = smaller(LANES, block.length[lane] - block.tick[lane])
        # noise of many ticks at once becomes SIMD code
        draw_noise_ahead(block.random_state, lane, scratch.noise, ticks, parameters.outliers)
        for column in span(0, ticks):
            _move(
                block, lane, scratch.noise, column,
                parameters.process_deviation, parameters.deviation_x, parameters.deviation_y,
            )  # fmt: skip
            banks.follow(bank, lane, chosen, block.measurement, parameters)
            _account(block, lane, bank.hypotheses, trace)
    for k, value in enumerate(estimate_of(bank.hypotheses, chosen, lane)):
        block.estimate[k, lane] = value
    for k, value in enumerate(banks.covariance(bank, chosen, lane)):
        block.kept_covariance[k, lane] = value


@internal
def _advance(reset: bool, world: int, open_banks: Any) -> int:
    setting = array_at(world, (1,), PARAMETERS)[0]
    tracks, n = setting.tracks, setting.radii_count
    number = (tracks + LANES - 1) // LANES
    actions = array_at(setting.actions, (tracks,), np.int64)
    blocks = array_at(setting.blocks, (number,), BLOCK)
    all_banks = open_banks(setting, number)
    scratch = array_at(setting.scratch, (1,), SCRATCH)[0]
    radii = array_at(setting.radii, (n,), np.float64)
    table = array_at(setting.table, (setting.table_rows, 3), np.float64)
    trace = array_at(setting.trace, (tracks, setting.trace_rows, TRACE_WIDTH), np.float64)
    observations = array_at(setting.observations, (tracks, row_width(2 * n + 1)), np.float32)
    rewards = array_at(setting.rewards, (tracks,), np.float64)
    terminated = array_at(setting.terminated, (tracks,), np.bool_)
    decisions = array_at(setting.decisions, (len(DECISION), tracks), np.int64)
    flags = array_at(setting.decision_flags, (len(DECISION_FLAGS), tracks), np.bool_)
    squared_errors = array_at(setting.decisions, decisions.shape, np.float64)[DECIDED_SQUARED_ERROR]
    if not reset:
        for i in span(0, tracks):
            if actions[i] < 0 or actions[i] >= setting.action_count:
                return -1 - i
    events = 0
    for b in span(0, number):
        block, bank = blocks[b], banks.bank_of_block(all_banks, b)
        lanes = smaller(LANES, tracks - b * LANES)
        prefetch(block, BLOCK_SIZE, EVERY_TICK)  # of the next, at once: it is small beside the bank
        begun = resting = 0
        for lane in span(0, lanes):
            i = b * LANES + lane
            action = actions[i]
            scratch.going[lane] = 1
            begins = reset or terminated[i]
            if reset and action == 0:
                scratch.going[lane] = 0
                resting += 1
                continue
            if setting.trace_rows > 0:
                block.traced[lane] = 0
            if flags[HAS_DECISION, i]:
                for k in span(0, len(DECISION)):
                    decisions[k, i] = 0
                for k in span(0, len(DECISION_FLAGS)):
                    flags[k, i] = False
            if begins:
                _begin_episode(block, scratch, lane, setting)
                rewards[i] = 0.0
                terminated[i] = False
            elif action == 0 and block.tick[lane] < block.length[lane]:
                rewards[i] = -setting.delay_cost
            else:
                forced = action == 0
                if forced and setting.keep_undecided:
                    chosen = block.active_mode[lane]
                elif forced or setting.declare_best:
                    chosen = likeliest(bank.hypotheses, lane)
                else:
                    chosen = action - 1
                _decide(block, lane, bank, scratch, setting, trace[i], decisions, flags, i, chosen, forced)
                rewards[i] = (1.0 if flags[CORRECT, i] else -1.0) - setting.delay_cost
                squared_errors[i] = block.squared_error[lane]
                events |= DECIDED
                if block.segment[lane] + 1 == setting.segments:
                    terminated[i] = True
                    scratch.going[lane] = 0
                    resting += 1
                    events |= TERMINATED
                    continue
                block.segment[lane] += 1
                begins = True
            if begins:
                _begin_segment(block, lane, bank, setting, radii, table)
                begun |= 1 << lane
        together = resting == 0  # else one by one
        for first in span(0, 1 if together else lanes):
            if scratch.going[first]:
                last = lanes if together else first + 1
                _tick(block, bank, scratch, setting, first, last)
                for lane in span(first, last):
                    i = b * LANES + lane
                    _account(block, lane, bank.hypotheses, trace[i])
                    row = observations[i]
                    for offset in range(0, row.nbytes, CACHE_LINE):
                        # of the same lane in the next block
                        prefetch(row, LANES * row.nbytes + offset, np.float32)
                    if begun & (1 << lane):
                        write_segment(
                            row, block, lane, radii,
                            setting.variance_x, setting.variance_y, setting.log_noise,
                        )  # fmt: skip
                    write_tick(row, block, lane, scratch, bank, setting.log_noise, setting.noise_whitener)
    return events


@compiled
def advance_tracks(reset: bool, world: int) -> int:
    """One step of every track, or with `reset` a new episode on every track whose action is not 0.

    In a step, a track that has terminated begins its next episode. Observations are written row by row; a
    track that terminates keeps its row, the one on which the last decision was made.

    Args:
        world: address of a `track.PARAMETERS` record, whose arrays must live while this runs.

    Returns:
        `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated; or -1 - i, with nothing
        done, if the action of track i is outside the space.
    """
    return _advance(reset, world, banks.published)


@compiled
def advance_aware_tracks(reset: bool, world: int) -> int:
    """`advance_tracks` with the anchor-aware bank."""
    return _advance(reset, world, banks.aware)
