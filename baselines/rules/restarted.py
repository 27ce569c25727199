"""Classical tests for a switch with filters that start at every possible moment of the switch;
compiled.

Every track has the filter of its stated mode. At every tick a new filter of every other mode starts
from the estimate and covariance that it has before the measurement: the hypothesis of a switch to
that mode here. Its likelihood ratio compares all measurements since its start with the filter of
the stated mode, which runs on (Willsky & Jones 1976; Golubkov 2020, eq. (7)). When the statement
changes, the most likely filter of the new mode becomes that of the stated mode, and all others are
dropped. The filters are those of `anchor_aware`, with an exact anchor those of `published`.
"""

import math
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from baselines.rules.beam_filters import copy_filter, triangle
from baselines.rules.decider import Actions
from baselines.rules.measurements import MeasurementDecider, filter_model, run_compiled, sensors_of
from hybrid_env.checks import (
    AnyArray,
    BoolArray,
    FloatArray,
    IntArray,
    PositiveOrZero,
    check_choice,
    check_integer,
    checked,
)
from hybrid_env.compiled import (
    AWARE_HYPOTHESIS,
    INNOVATION,
    LANES,
    MEASURED,
    SENSOR,
    FilterModel,
    State,
    Triangle4,
    aligned_zeros,
    begin_hypothesis,
    compiled,
    covariance_of,
    internal,
    sense_hypothesis,
    signed_radius,
    write_measured,
)
from hybrid_env.quickest_options import QuickestOptions


class RestartedFilters(NamedTuple):
    """The filters of N tracks with M modes, and W start ticks of each mode in G = W / LANES groups.
    Start k since the last change of the statement has lane k % W % LANES of group k % W // LANES.
    The log-likelihood of its filter is that of all measurements since the change, with the stated
    mode before.
    """

    # (N,) records `AWARE_HYPOTHESIS`, of which lane 0 is used: filter of the stated mode.
    stated_filters: AnyArray
    # (N, M, G) records `AWARE_HYPOTHESIS`, see above.
    started: AnyArray
    # (N,) ticks since the last change of the statement.
    counts: IntArray
    # (N,) stated modes.
    stated: IntArray
    # (N, M) statistics of the last tick; 0 for the stated mode.
    log_ratios: FloatArray
    # (1,) record `INNOVATION`, temporary memory.
    innovations: AnyArray
    # (1,) record `MEASURED`, temporary memory.
    measured: AnyArray


class RestartModel(NamedTuple):
    """The rule and what its filters assume."""

    # (n,) turn radii [m]
    radii: FloatArray
    # W, number of start ticks.
    window: int
    # Whether centre and turn rate of a turn are certain.
    exact_anchor: bool
    # Whether the statistic is the mean of the likelihood ratios of all start ticks, or the largest.
    mean: bool
    # Of the logarithm of the statistic, at which the statement changes.
    threshold: float
    # Smallest difference of this logarithm to that of the other modes that are not stated.
    margin: float
    # Model of the filters.
    filters: FilterModel
    # (k,) records `memory.SENSOR`
    sensors: AnyArray = np.zeros(0, SENSOR)


def restart_arrays(tracks: int, modes: int, window: int) -> RestartedFilters:
    """Return filters of zeros."""
    return RestartedFilters(
        aligned_zeros((tracks,), AWARE_HYPOTHESIS),
        aligned_zeros((tracks, modes, -(-window // LANES)), AWARE_HYPOTHESIS),
        np.zeros(tracks, np.int64),
        np.zeros(tracks, np.int64),
        np.zeros((tracks, modes)),
        aligned_zeros((1,), INNOVATION),
        aligned_zeros((1,), MEASURED),
    )


@internal
def _begin_filter(
    kalman: Any,
    lane: int,
    anchor: State,
    covariance: Triangle4,
    mode: int,
    model: RestartModel,
) -> None:
    """Start the filter of a mode from an estimate and its covariance."""
    radius = signed_radius(mode, model.radii)
    exact = model.exact_anchor
    begin_hypothesis(kalman, lane, anchor, covariance, radius, model.filters.tau, exact)


@compiled
def begin_restarted(
    filters: RestartedFilters,
    track: int,
    mode: int,
    start: FloatArray,
    model: RestartModel,
) -> None:
    """Begin an episode of a track with a first statement; `start` as in
    `MeasurementDecider.begin_track`.
    """
    anchor = (start[0], start[1], start[2], start[3])
    _begin_filter(filters.stated_filters[track], 0, anchor, triangle(start[4:14]), mode, model)
    filters.counts[track] = 0
    filters.stated[track] = mode
    filters.log_ratios[track] = 0.0


@internal
def _likeliest_start(started: AnyArray, live: int) -> int:
    """Return the number of the most likely one of the first `live` filters of a mode. started:
    (G,).
    """
    best = 0
    for k in range(1, live):
        value = started[k // LANES].log_likelihood[k % LANES]
        if value > started[best // LANES].log_likelihood[best % LANES]:
            best = k
    return best


@internal
def _log_ratio(started: AnyArray, live: int, reference: float, mean: bool) -> float:
    """Return the logarithm of the largest or `mean` likelihood ratio of the first `live` filters
    to a reference.
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
    best = -1
    second = -1
    ratios = filters.log_ratios[track]
    for mode in range(ratios.size):
        if mode != filters.stated[track]:
            if best < 0 or ratios[mode] > ratios[best]:
                best, second = mode, best
            elif second < 0 or ratios[mode] > ratios[second]:
                second = mode
    if ratios[best] < model.threshold or ratios[best] - ratios[second] < model.margin:
        return
    start = _likeliest_start(filters.started[track, best], live)
    stated_filter = filters.stated_filters[track]
    copy_filter(filters.started[track, best, start // LANES], start % LANES, stated_filter, 0)
    stated_filter.log_likelihood[0] = 0.0
    filters.stated[track] = best
    filters.counts[track] = 0


@compiled
def step_restarted(
    filters: RestartedFilters,
    measurements: FloatArray,
    model: RestartModel,
) -> None:
    """Advance all tracks by a tick, with measurements as in `sensing.write_measured`."""
    innovation = filters.innovations[0]
    measured = filters.measured[0]
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
                sense_hypothesis(
                    kalman,
                    innovation,
                    0,
                    LANES,
                    measured,
                    model.sensors,
                    model.filters,
                )
            reference = stated_filter.log_likelihood[0]
            filters.log_ratios[track, mode] = _log_ratio(started, live, reference, model.mean)
        _change(filters, track, live, model)


class RestartDecider(MeasurementDecider[RestartedFilters]):
    """Changes its statement when a switch at one of the last ticks is likely enough; see the
    subclasses.

    Args:
        options: of the environment.
        threshold: of the logarithm of the statistic of the new mode, above 0.
        margin: smallest difference of this logarithm to that of every other mode except the stated
            one, >= 0.
        window: number of last ticks at which the switch can be, 1 to 10,000, at most since the last
            change of the statement; None is that of the rule.
        bank: filters of the modes, "published" or "anchor_aware" as in the option `bank` of the
            environment, with the covariance of the estimate at which they start; None is that of
            the rule.
    """

    # Few: a filter for every start is slow.
    thresholds = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
    default = 5.0
    bounds = 1e-12, math.inf
    mean: ClassVar[bool]
    # Window and bank.
    usual: ClassVar[tuple[int, str]]

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 5.0,
        margin: float = 2.0,
        window: int | None = None,
        bank: Literal["published", "anchor_aware"] | None = None,
    ):
        window = check_integer(
            "window",
            self.usual[0] if window is None else window,
            maximum=10_000,
        )
        chosen = check_choice(
            "bank",
            self.usual[1] if bank is None else bank,
            ("published", "anchor_aware"),
        )
        super().__init__(threshold)
        margin = checked("margin", margin, PositiveOrZero)
        self.hypotheses = options.hypotheses
        self.model = RestartModel(
            np.array(options.radii),
            window,
            chosen == "published",
            self.mean,
            self.threshold,
            margin,
            filter_model(options),
            sensors_of(options),
        )

    def begin(self, tracks: int) -> RestartedFilters:
        """Return filters without meaning; see `MeasurementDecider.begin`."""
        return restart_arrays(tracks, self.hypotheses, self.model.window)

    def begin_track(self, state: RestartedFilters, track: int, start: FloatArray) -> None:
        """State the most probable mode and start its filter; see
        `MeasurementDecider.begin_track`.
        """
        run_compiled(
            begin_restarted,
            state,
            track,
            int(start[-self.hypotheses :].argmax()),
            start,
            self.model,
        )

    def step(self, state: RestartedFilters, measurements: FloatArray) -> None:
        """Advance filters and statements; see `MeasurementDecider.step`."""
        model = self.model._replace(threshold=self.threshold)
        run_compiled(step_restarted, state, measurements, model)

    def statements(self, state: RestartedFilters, starts: BoolArray) -> Actions:
        """Return the statements; see `MeasurementDecider.statements`."""
        return state.stated.copy()


class GLRDecider(RestartDecider):
    """The generalized likelihood ratio of a switch at one of the last ticks, with its own filter
    each.

    The statistic of a mode is the largest likelihood ratio over the start ticks. Willsky and Jones
    1976, "A generalized likelihood ratio approach to the detection and estimation of jumps in
    linear systems"; the window as in Lai 1995, "Sequential changepoint detection in quality control
    and dynamical systems". Without a margin wrong changes are frequent, because the measurements
    after a switch contradict the stated mode before they tell the other modes apart.

    Args:
        options, threshold, margin, window, bank: see `RestartDecider`; by default 60 ticks and
            "anchor_aware".
    """

    name = "glr"
    title = "GLR"
    symbol = "ln GLR"
    mean = False
    usual = (60, "anchor_aware")


class MeanRatioDecider(RestartDecider):
    """The detector of Golubkov 2020, for M modes and any number of switches.

    The statistic of a mode is the mean of the likelihood ratios of all start ticks, lambda_k of eq.
    (6): the likelihood ratio of a switch at a uniformly distributed moment. The paper tests one
    turn against straight motion, once. Here every mode is tested against the stated one, and after
    a change of the statement the test begins anew from the most likely filter of the new mode.

    The rule of the paper is `margin=0`, a window that is not shorter than the episode, and the
    threshold ln A = ln((1 - beta) / alpha), 2.2 for alpha = beta = 0.1. Its lower threshold B, at
    which the test ends in favour of the stated mode, is not used: here the test would begin anew,
    and forget switches that have just begun.

    Args:
        options, threshold, margin, window, bank: see `RestartDecider`; by default 40 ticks and
            "published".
    """

    name = "detector-2020"
    title = "detector 2020"
    symbol = "ln lambda"
    mean = True
    usual = (40, "published")
