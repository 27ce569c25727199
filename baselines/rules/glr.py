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
from typing import ClassVar, NamedTuple

import numpy as np
from scipy.special import logsumexp

from baselines.rules.decider import Actions, Variants
from baselines.rules.measurements import MeasurementDecider, estimate_in, own_filters, sensors_of
from hybrid_env.checks import (
    AnyArray,
    BoolArray,
    FloatArray,
    IntArray,
    PositiveOrZero,
    check_integer,
    checked,
)
from hybrid_env.compiled import (
    AWARE_HYPOTHESIS,
    INNOVATION,
    LANES,
    MEASURED,
    FilterModel,
    aligned_zeros,
    begin_motion,
    compiled,
    covariance_of,
    run_compiled,
    state_of,
    step_motion,
    write_measured,
)
from hybrid_env.quickest_options import QuickestOptions


class RestartedFilters(NamedTuple):
    """The filters of N tracks with M modes, and W start ticks of each mode in G = W / LANES groups.
    Start k since the last change of the statement has lane k % W % LANES of group k % W // LANES.
    The log-likelihood of its filter is that of all measurements since the change, with the stated
    mode before.
    """

    # (N, 1) records `AWARE_HYPOTHESIS`, of which lane 0 is used: filter of the stated mode.
    stated_filters: AnyArray
    # (N, M, G) records `AWARE_HYPOTHESIS`, see above.
    started: AnyArray
    # (N,) ticks since the last change of the statement.
    counts: IntArray
    # (N,) stated modes.
    stated: IntArray
    # (N, M) statistics of the last tick; 0 for the stated mode.
    log_ratios: FloatArray
    # (1,) records `INNOVATION` and `MEASURED`, temporary memory.
    innovations: AnyArray
    # See above.
    measured: AnyArray


class RestartModel(NamedTuple):
    """What the filters assume."""

    # (M,) records `memory.MOTION`
    motions: AnyArray
    # W, number of start ticks.
    window: int
    # Model of the filters, of which the published ones are certain of centre and turn rate.
    filters: FilterModel
    # (k,) records `memory.SENSOR`
    sensors: AnyArray


@compiled
def begin_restarted(
    filters: RestartedFilters, track: int, mode: int, start: FloatArray, model: RestartModel
) -> None:
    """Begin an episode of a track with a first statement; `start` as in
    `MeasurementDecider.begin_track`.
    """
    anchor, covariance = estimate_in(start)
    stated = filters.stated_filters[track, 0]
    begin_motion(stated, 0, anchor, covariance, model.motions[mode], model.filters)
    filters.counts[track] = 0
    filters.stated[track] = mode
    filters.log_ratios[track] = 0.0


@compiled
def step_restarted(
    filters: RestartedFilters, measurements: FloatArray, model: RestartModel
) -> None:
    """Advance the filters of all tracks by a tick, with measurements as in
    `sensing.write_measured`.
    """
    innovation = filters.innovations[0]
    measured = filters.measured[0]
    for track in range(measurements.shape[0]):
        for lane in range(LANES):
            write_measured(measured, lane, measurements[track])
        stated = filters.stated_filters[track, 0]
        before = stated.log_likelihood[0]
        anchor = state_of(stated, 0)[:4]
        covariance = covariance_of(stated, 0)
        motion = model.motions[filters.stated[track]]
        step_motion(stated, innovation, 0, 1, motion, measured, model.sensors, model.filters)
        new = filters.counts[track] % model.window
        filters.counts[track] += 1
        live = min(filters.counts[track], model.window)
        for mode in range(filters.started.shape[1]):
            if mode == filters.stated[track]:
                continue
            started = filters.started[track, mode]
            begin_motion(
                started[new // LANES],
                new % LANES,
                anchor,
                covariance,
                model.motions[mode],
                model.filters,
            )
            started[new // LANES].log_likelihood[new % LANES] = before
            for group in range((live + LANES - 1) // LANES):
                step_motion(
                    started[group],
                    innovation,
                    0,
                    LANES,
                    model.motions[mode],
                    measured,
                    model.sensors,
                    model.filters,
                )


class RestartDecider(MeasurementDecider):
    """Changes its statement when a switch at one of the last ticks is likely enough.

    The generalized likelihood ratio (GLR): the statistic of a mode is the largest likelihood ratio
    over the start ticks. Willsky and Jones 1976, "A generalized likelihood ratio approach to the
    detection and estimation of jumps in linear systems"; the window as in Lai 1995, "Sequential
    changepoint detection in quality control and dynamical systems". Without a margin wrong changes
    are frequent, because the measurements after a switch contradict the stated mode before they
    tell the other modes apart.

    The detector of Golubkov 2020, for M modes and any number of switches, is the rule with the
    `mean` of the likelihood ratios of all start ticks, lambda_k of eq. (6): the likelihood
    ratio of a switch at a uniformly distributed moment. Its filters are those of the published
    bank. The paper tests one turn against straight motion, once. Here every mode is tested
    against the stated one, and after a change of the statement the test begins anew from the
    most likely filter of the new mode. The rule of the paper is `margin=0`, a window that is
    not shorter than the episode, and the threshold ln A = ln((1 - beta) / alpha), 2.2 for alpha
    = beta = 0.1. Its lower threshold B, at which the test ends in favour of the stated mode, is
    not used: here the test would begin anew, and forget switches that have just begun.

    Args:
        options: of the environment.
        threshold: of the logarithm of the statistic of the new mode, above 0.
        margin: smallest difference of this logarithm to that of every other mode except the stated
            one, >= 0.
        window: number of last ticks at which the switch can be, 1 to 10,000, at most since the last
            change of the statement.
        mean: whether the statistic is the mean of the likelihood ratios of published filters, or
            the largest one of anchor-aware filters, see the option `bank` of the environment; both
            start with the covariance of the estimate.
    """

    name = "glr"
    title = "GLR"
    symbol = "ln GLR"
    # Few: a filter for every start is slow.
    thresholds = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
    default = 5.0
    bounds = 1e-12, math.inf
    variants: ClassVar[Variants] = {
        "detector-2020": {
            "title": "detector 2020",
            "symbol": "ln lambda",
            "arguments": lambda options: {"window": 40, "mean": True},
        }
    }

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 5.0,
        margin: float = 2.0,
        window: int = 60,
        mean: bool = False,
    ):
        super().__init__(threshold)
        self.margin = checked("margin", margin, PositiveOrZero)
        self.mean = mean
        self.hypotheses = options.hypotheses
        self.model = RestartModel(
            options.motions,
            check_integer("window", window, maximum=10_000),
            own_filters(options)._replace(exact_anchor=float(mean)),
            sensors_of(options),
        )

    def begin(self, tracks: int) -> RestartedFilters:
        """Return filters without meaning; see `MeasurementDecider.begin`."""
        groups = -(-self.model.window // LANES)
        return RestartedFilters(
            aligned_zeros((tracks, 1), AWARE_HYPOTHESIS),
            aligned_zeros((tracks, self.hypotheses, groups), AWARE_HYPOTHESIS),
            np.zeros(tracks, np.int64),
            np.zeros(tracks, np.int64),
            np.zeros((tracks, self.hypotheses)),
            aligned_zeros((1,), INNOVATION),
            aligned_zeros((1,), MEASURED),
        )

    def begin_track(self, state: RestartedFilters, track: int, start: FloatArray) -> None:
        """State the most probable mode and start its filter; see
        `MeasurementDecider.begin_track`.
        """
        mode = int(start[-self.hypotheses :].argmax())
        run_compiled(begin_restarted, state, track, mode, start, self.model)

    def step(self, state: RestartedFilters, measurements: FloatArray) -> None:
        """Advance filters and statements; see `MeasurementDecider.step`."""
        run_compiled(step_restarted, state, measurements, self.model)
        tracks = np.arange(len(measurements))
        logs = state.started["log_likelihood"].reshape(*state.log_ratios.shape, -1)
        live = np.minimum(state.counts, self.model.window)
        logs = np.where(np.arange(logs.shape[2]) < live[:, None, None], logs, -np.inf)
        ratios = logsumexp(logs, axis=2) - np.log(live)[:, None] if self.mean else logs.max(2)
        ratios -= state.stated_filters["log_likelihood"][:, 0, :1]
        ratios[tracks, state.stated] = -np.inf
        best = ratios.argmax(1)
        second, first = np.partition(ratios, -2, axis=1)[:, -2:].T
        changes = (first >= self.threshold) & (first - second >= self.margin)
        ratios[tracks, state.stated] = 0.0
        state.log_ratios[:] = ratios
        # The most likely filter of the new mode becomes that of the stated one.
        track, mode = tracks[changes], best[changes]
        group, lane = np.divmod(logs[track, mode].argmax(1), LANES)
        for name in AWARE_HYPOTHESIS.names or ():
            chosen = state.started[name][track, mode, group, ..., lane]
            state.stated_filters[name][track, 0, ..., 0] = chosen
        state.stated_filters["log_likelihood"][track, 0, 0] = 0.0
        state.stated[track] = mode
        state.counts[track] = 0

    def statements(self, state: RestartedFilters, starts: BoolArray) -> Actions:
        """Return the statements; see `MeasurementDecider.statements`."""
        return state.stated.copy()
