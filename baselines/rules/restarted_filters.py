"""Likelihood ratios of a switch at each of the last ticks, from filters that start at these ticks; compiled.

Every track has the filter of its stated mode. At every tick one new filter of every other mode starts from the estimate
and covariance that the filter of the stated mode has before the measurement of the tick: the hypothesis that the object
switches to that mode here. Its likelihood ratio compares all measurements since its start with the filter of the stated
mode, which runs on (Willsky & Jones 1976; Golubkov 2020, eq. (7)). When the statement changes, the most likely filter
of the new mode becomes the filter of the stated mode, and all others are dropped.

The filters are those of `hybrid_env.core.banks.anchor_aware`. With an exact anchor their centre and turn rate have no
variance, so that they are the Kalman filters of `hybrid_env.core.banks.published`.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.rules.beam_filters import copy_filter, triangle
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.core.arrays import aligned_zeros
from hybrid_env.core.banks.anchor_aware import AWARE_HYPOTHESIS, begin_hypothesis, covariance_of, sense_hypothesis
from hybrid_env.core.banks.bank import INNOVATION, FilterModel, State, Triangle4, signed_radius
from hybrid_env.core.banks.sensing import write_measured
from hybrid_env.core.compilation import compiled, internal
from hybrid_env.core.records import LANES, MEASURED, SENSOR


class RestartedFilters(NamedTuple):
    """The filters of N tracks with M modes, and W start ticks of each mode in G = W / LANES groups.

    Start k = 0, 1, ... since the last change of the statement is number k % W: lane k % W % LANES of group k % W //
    LANES. The log-likelihood of its filter is that of all measurements since the change, with the stated mode before.
    """

    stated_filters: NDArray[Any]  # (N,) records `AWARE_HYPOTHESIS`, of which lane 0 is used: filter of the stated mode
    started: NDArray[Any]  # (N, M, G) records `AWARE_HYPOTHESIS`, see above
    counts: IntArray  # (N,) ticks since the last change of the statement
    stated: IntArray  # (N,) stated modes
    log_ratios: FloatArray  # (N, M) statistics of the last tick; 0 for the stated mode
    innovations: NDArray[Any]  # (1,) records `INNOVATION` and `MEASURED`, temporary memory
    measured: NDArray[Any]  # (1,) records `INNOVATION` and `MEASURED`, temporary memory


class RestartModel(NamedTuple):
    """The rule and what its filters assume."""

    radii: FloatArray  # (n,) turn radii [m]
    window: int  # W, number of start ticks
    exact_anchor: bool  # whether centre and turn rate of a turn are certain
    mean: bool  # whether the statistic is the mean of the likelihood ratios of all start ticks, or the largest
    threshold: float  # of the logarithm of the statistic, at which the statement changes
    margin: float  # smallest difference of this logarithm to that of the other modes that are not stated
    filters: FilterModel  # model of the filters
    sensors: NDArray[Any] = np.zeros(0, SENSOR)  # (k,) records `records.SENSOR`


def restart_arrays(tracks: int, modes: int, window: int) -> RestartedFilters:
    """Return filters of zeros."""
    groups = -(-window // LANES)
    return RestartedFilters(
        aligned_zeros((tracks,), AWARE_HYPOTHESIS),
        aligned_zeros((tracks, modes, groups), AWARE_HYPOTHESIS),
        np.zeros(tracks, np.int64),
        np.zeros(tracks, np.int64),
        np.zeros((tracks, modes)),
        aligned_zeros((1,), INNOVATION),
        aligned_zeros((1,), MEASURED),
    )


@internal
def _begin_filter(kalman: Any, lane: int, anchor: State, covariance: Triangle4, mode: int, model: RestartModel) -> None:
    """Start the filter of a mode from an estimate and its covariance."""
    radius, exact = signed_radius(mode, model.radii), model.exact_anchor
    begin_hypothesis(kalman, lane, anchor, covariance, radius, model.filters.tau, exact)


@compiled
def begin_restarted(filters: RestartedFilters, track: int, mode: int, start: FloatArray, model: RestartModel) -> None:
    """Begin an episode of a track with a first statement; `start` as in `MeasurementDecider.begin_track`."""
    anchor = (start[0], start[1], start[2], start[3])
    _begin_filter(filters.stated_filters[track], 0, anchor, triangle(start[4:14]), mode, model)
    filters.counts[track] = 0
    filters.stated[track] = mode
    filters.log_ratios[track] = 0.0


@internal
def _likeliest_start(started: NDArray[Any], live: int) -> int:
    """Return the number of the most likely one of the first `live` filters of a mode. started: (G,)."""
    best = 0
    for k in range(1, live):
        value = started[k // LANES].log_likelihood[k % LANES]
        if value > started[best // LANES].log_likelihood[best % LANES]:
            best = k
    return best


@internal
def _log_ratio(started: NDArray[Any], live: int, reference: float, mean: bool) -> float:
    """Return the logarithm of the largest or `mean` likelihood ratio, to a reference, of the first `live` filters of a
    mode.
    """
    best = _likeliest_start(started, live)
    largest = started[best // LANES].log_likelihood[best % LANES]
    if not mean:
        return largest - reference
    total = 0.0
    for k in range(live):
        total += math.exp(started[k // LANES].log_likelihood[k % LANES] - largest)
    return largest - reference + math.log(total / live)


@internal
def _change(filters: RestartedFilters, track: int, live: int, model: RestartModel) -> None:
    """Change the statement of a track, if one mode reaches the threshold and exceeds all others."""
    best, second = -1, -1
    for mode in range(filters.log_ratios.shape[1]):
        if mode != filters.stated[track]:
            value = filters.log_ratios[track, mode]
            if best < 0 or value > filters.log_ratios[track, best]:
                best, second = mode, best
            elif second < 0 or value > filters.log_ratios[track, second]:
                second = mode
    largest = filters.log_ratios[track, best]
    if largest < model.threshold or largest - filters.log_ratios[track, second] < model.margin:
        return
    start = _likeliest_start(filters.started[track, best], live)
    stated_filter = filters.stated_filters[track]
    copy_filter(filters.started[track, best, start // LANES], start % LANES, stated_filter, 0)
    stated_filter.log_likelihood[0] = 0.0
    filters.stated[track] = best
    filters.counts[track] = 0


@compiled
def step_restarted(filters: RestartedFilters, measurements: FloatArray, model: RestartModel) -> None:
    """Advance all tracks by one tick: start filters, correct all, and change statements.

    Measurements are (N, 2) or (N, 9), see `sensing.write_measured`.
    """
    innovation, measured = filters.innovations[0], filters.measured[0]
    for track in range(measurements.shape[0]):
        for lane in range(LANES):
            write_measured(measured, lane, measurements[track])
        stated_filter = filters.stated_filters[track]
        before = stated_filter.log_likelihood[0]
        anchor = (stated_filter.x[0], stated_filter.vx[0], stated_filter.y[0], stated_filter.vy[0])
        covariance = covariance_of(stated_filter, 0)
        sense_hypothesis(stated_filter, innovation, 0, 1, measured, model.sensors, model.filters)
        new = filters.counts[track] % model.window
        filters.counts[track] += 1
        live = min(filters.counts[track], model.window)
        for mode in range(filters.log_ratios.shape[1]):
            filters.log_ratios[track, mode] = 0.0
            if mode == filters.stated[track]:
                continue
            started = filters.started[track, mode]
            _begin_filter(started[new // LANES], new % LANES, anchor, covariance, mode, model)
            started[new // LANES].log_likelihood[new % LANES] = before
            for group in range((live + LANES - 1) // LANES):
                kalman = started[group]
                sense_hypothesis(kalman, innovation, 0, LANES, measured, model.sensors, model.filters)
            reference = stated_filter.log_likelihood[0]
            filters.log_ratios[track, mode] = _log_ratio(started, live, reference, model.mean)
        _change(filters, track, live, model)
