"""The kernel: truth, measurement, bank, reward, fast-forward and autoreset of many tracks in one loop.

A track is one record of `track.TRACK`, so that its state has names both here and in Python, and one slice of
the bank's arrays (see `bank`). Loops are serial: the work of a step is too small to be worth a fork.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from hybrid_env.bank import (
    LOG_LIKELIHOOD,
    anchor_bank,
    copy_covariance,
    copy_estimate,
    likeliest,
    mode_type,
    step_bank,
    step_chosen,
)
from hybrid_env.motion import heading_vector, motion_coefficients, propagate, turn_centre
from hybrid_env.noise import integer_below, standard_normal, uniform
from hybrid_env.observation import write_segment, write_tick

DECIDED, TERMINATED = 1, 2  # events of a step, added up


@njit(cache=True)
def turn(track: Any, signed_radius: float, tau: float) -> None:
    """The object begins a segment: its turn is anchored at its true state. Golubkov 2018, eq. (1)."""
    speed, heading_x, heading_y = heading_vector(track.truth[1], track.truth[3])
    turn_rate = 0.0 if signed_radius == 0.0 else speed / abs(signed_radius)
    track.true_motion[0], track.true_motion[1], track.true_motion[2] = motion_coefficients(turn_rate, tau)
    track.true_centre[0], track.true_centre[1] = turn_centre(
        track.truth[0], track.truth[2], heading_x, heading_y, signed_radius
    )


@njit(cache=True)
def move(track: Any, process_deviation: float, deviation_x: float, deviation_y: float) -> None:
    """The object moves one tick, and its position is measured. Golubkov 2018, eq. (1).

    process_deviation: sqrt(Q) [m/s]; deviation_x, deviation_y: sqrt(R) of each axis [m].
    """
    cosine, sine_velocity, sine_position = track.true_motion[0], track.true_motion[1], track.true_motion[2]
    x, vx = propagate(
        track.truth[0], track.truth[1], track.true_centre[0], cosine, sine_velocity, sine_position
    )
    y, vy = propagate(
        track.truth[2], track.truth[3], track.true_centre[1], cosine, sine_velocity, sine_position
    )
    track.truth[0] = x
    track.truth[1] = vx + process_deviation * standard_normal(track.random_state)
    track.truth[2] = y
    track.truth[3] = vy + process_deviation * standard_normal(track.random_state)
    track.measurement[0] = x + deviation_x * standard_normal(track.random_state)
    track.measurement[1] = y + deviation_y * standard_normal(track.random_state)
    track.tick += 1


@njit(cache=True)
def _account(track: Any, trace: NDArray[np.float64]) -> None:
    """Add the tick's error to the segment, and the tick to the trace if there is room for one."""
    error_x = track.estimate[0] - track.truth[0]
    error_y = track.estimate[2] - track.truth[2]
    track.squared_error += error_x * error_x + error_y * error_y
    if track.traced < trace.shape[0]:
        row = trace[track.traced]
        for k in range(4):
            row[k] = track.truth[k]
        row[4], row[5] = track.measurement[0], track.measurement[1]
        row[6], row[7] = track.estimate[0], track.estimate[2]
        row[8] = track.active_mode
        row[9] = track.segment
        track.traced += 1


@njit(cache=True)
def _tick(
    track: Any,
    filters: NDArray[np.float64],
    motion: NDArray[np.float64],
    gains: NDArray[np.float64],
    parameters: Any,
    variances: NDArray[np.float64],
    trace: NDArray[np.float64],
) -> None:
    """One tick with every hypothesis running; the estimate is the active filter's, as in ATE."""
    move(track, parameters.process_deviation, parameters.deviation_x, parameters.deviation_y)
    step_bank(
        filters, motion, gains, track.measurement[0], track.measurement[1],
        parameters.process_variance, variances,
    )  # fmt: skip
    copy_estimate(filters, track.active_mode, track.estimate)
    _account(track, trace)


@njit(cache=True)
def _begin_segment(
    track: Any,
    filters: NDArray[np.float64],
    motion: NDArray[np.float64],
    gains: NDArray[np.float64],
    parameters: Any,
    radii: NDArray[np.float64],
    variances: NDArray[np.float64],
    table: NDArray[np.float64],
) -> None:
    """Anchor the object at its true state and the bank at the estimate; the first tick is still to come."""
    if parameters.random_scheme:
        row = integer_below(track.random_state, table.shape[0])
        span = parameters.longest - parameters.shortest + 1
        track.length = parameters.shortest + integer_below(track.random_state, span)
    else:
        row = track.segment
        track.length = np.int64(table[row, 2])
    track.true_mode = np.int64(table[row, 1])
    turn(track, table[row, 0], parameters.tau)
    for k in range(4):
        track.anchor[k] = track.estimate[k]
    track.speed, track.heading[0], track.heading[1] = heading_vector(track.anchor[1], track.anchor[3])
    start = np.empty((variances.size, 3))
    for axis in range(variances.size):
        if parameters.reset_covariance:
            start[axis, 0], start[axis, 1], start[axis, 2] = 1.0, 0.0, 1.0
        else:
            for k in range(3):
                start[axis, k] = track.kept_covariance[axis, k]
    anchor_bank(filters, motion, gains, track.anchor, radii, parameters.tau, start)
    track.tick = 0
    track.squared_error = 0.0


@njit(cache=True)
def _begin_episode(track: Any, parameters: Any, variances: NDArray[np.float64]) -> None:
    """Put the object at its start and draw the first estimate."""
    heading = parameters.heading
    if math.isnan(heading):
        heading = 2.0 * math.pi * uniform(track.random_state)
    track.truth[0], track.truth[2] = 0.0, 0.0
    track.truth[1] = parameters.speed * math.cos(heading)
    track.truth[3] = parameters.speed * math.sin(heading)
    for axis in range(2):
        position_variance = parameters.initial_position * variances[min(axis, variances.size - 1)]
        velocity_variance = parameters.initial_velocity
        track.estimate[2 * axis] = track.truth[2 * axis] + math.sqrt(position_variance) * standard_normal(
            track.random_state
        )
        track.estimate[2 * axis + 1] = track.truth[2 * axis + 1] + math.sqrt(
            velocity_variance
        ) * standard_normal(track.random_state)
        track.kept_covariance[axis, 0] = position_variance
        track.kept_covariance[axis, 1] = 0.0
        track.kept_covariance[axis, 2] = velocity_variance
    track.segment = 0
    track.active_mode = 0  # Golubkov 2018, algorithm 1, line 2
    track.terminated = False
    track.has_decision = False


@njit(cache=True)
def _decide(
    track: Any,
    filters: NDArray[np.float64],
    motion: NDArray[np.float64],
    gains: NDArray[np.float64],
    parameters: Any,
    radii: NDArray[np.float64],
    variances: NDArray[np.float64],
    trace: NDArray[np.float64],
    chosen: int,
    forced: bool,
) -> None:
    """Note the decision and run the chosen filter alone to the end of the segment."""
    n = radii.size
    exactly = chosen == track.true_mode
    track.type_correct = mode_type(chosen, n) == mode_type(track.true_mode, n)
    track.correct = exactly if parameters.exact else track.type_correct
    track.has_decision = True
    track.decided_mode = chosen
    track.decided_true_mode = track.true_mode
    track.forced = forced
    track.ticks = track.tick
    track.decided_length = track.length
    track.active_mode = chosen
    log_likelihood = filters[LOG_LIKELIHOOD, chosen]
    while track.tick < track.length:
        move(track, parameters.process_deviation, parameters.deviation_x, parameters.deviation_y)
        step_chosen(
            filters, motion, gains, chosen, track.measurement[0], track.measurement[1],
            parameters.process_variance, variances,
        )  # fmt: skip
        copy_estimate(filters, chosen, track.estimate)
        _account(track, trace)
    filters[LOG_LIKELIHOOD, chosen] = log_likelihood  # of the ticks that the others saw too
    copy_estimate(filters, chosen, track.estimate)
    track.decided_squared_error = track.squared_error
    copy_covariance(gains, chosen, track.kept_covariance)


@njit(cache=True)
def advance_tracks(
    reset: bool,
    mask: NDArray[np.bool_],
    actions: NDArray[np.int64],
    tracks: NDArray[Any],
    filters: NDArray[np.float64],
    motion: NDArray[np.float64],
    gains: NDArray[np.float64],
    parameters: NDArray[Any],
    radii: NDArray[np.float64],
    variances: NDArray[np.float64],
    table: NDArray[np.float64],
    trace: NDArray[np.float64],
    observations: NDArray[np.float32],
    rewards: NDArray[np.float64],
) -> int:
    """One step of every track, or with `reset` a new episode on every track of the mask.

    In a step, a track that has terminated begins its next episode. It is one function, because each that
    holds the bank costs seconds to compile.

    Returns `DECIDED` if any track made a decision, plus `TERMINATED` if any terminated; or -1 - i, with
    nothing done, if the action of track i is outside the space.

    mask: (N,), read by a reset. actions: (N,), read by a step, 0 waits. observations: (N, 6 M + 10) and, by
    a step, rewards: (N,) are written; a track that terminates keeps its row, the one on which the last
    decision was made.
    """
    setting = parameters[0]
    if not reset:
        for i in range(tracks.size):
            if actions[i] < 0 or actions[i] >= setting.actions:
                return -1 - i
    events = 0
    for i in range(tracks.size):
        if reset and not mask[i]:
            continue
        track = tracks[i]
        track.traced = 0
        begins = reset or track.terminated
        if begins:
            _begin_episode(track, setting, variances)
            if not reset:
                rewards[i] = 0.0
        elif actions[i] == 0 and track.tick < track.length:
            track.has_decision = False
            rewards[i] = -setting.delay_cost
        else:
            forced = actions[i] == 0
            if forced and setting.keep_undecided:
                chosen = track.active_mode
            elif forced or setting.declare_best:
                chosen = likeliest(filters[i])
            else:
                chosen = actions[i] - 1
            _decide(
                track, filters[i], motion[i], gains[i], setting, radii, variances, trace[i], chosen, forced
            )
            rewards[i] = (1.0 if track.correct else -1.0) - setting.delay_cost
            events |= DECIDED
            if track.segment + 1 == setting.segments:
                track.terminated = True
                events |= TERMINATED
                continue
            track.segment += 1
            begins = True
        if begins:
            _begin_segment(track, filters[i], motion[i], gains[i], setting, radii, variances, table)
        _tick(track, filters[i], motion[i], gains[i], setting, variances, trace[i])
        if begins:
            write_segment(observations[i], track, radii, variances)
        write_tick(observations[i], filters[i], gains[i], track, setting.log_noise, setting.noise_whitener)
    return events
