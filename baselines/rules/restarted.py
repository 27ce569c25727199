"""Classical tests for a switch with filters that start at every possible moment of the switch.

The rules of `change_detection` read the likelihood ratios of a bank that runs on over the switches. Here
every moment of the switch has a filter of its own. The filters follow the statements: after a wrong one they
start from the estimate of a wrong mode.
"""

from collections.abc import Callable
from typing import ClassVar, Literal

import numpy as np

from baselines.rules.decider import Actions, Decider
from baselines.rules.measurements import MeasurementDecider, filter_model, run_compiled, sensors_of
from baselines.rules.restarted_filters import (
    RestartedFilters,
    RestartModel,
    begin_restarted,
    restart_arrays,
    step_restarted,
)
from hybrid_env.checks import BoolArray, FloatArray, check_choice, check_integer, check_positive
from hybrid_env.quickest_options import QuickestOptions

LONGEST_WINDOW = 10_000  # ticks
Bank = Literal["published", "anchor_aware"]


class RestartDecider(MeasurementDecider[RestartedFilters]):
    """Changes its statement when a switch at one of the last ticks is likely enough; see the subclasses.

    Args:
        options: of the environment.
        threshold: of the logarithm of the statistic of the new mode, above 0.
        margin: smallest difference of this logarithm to that of every other mode except the stated one, >= 0.
        window: number of last ticks at which the switch can be, 1 to 10,000; None is that of the rule. At
            most the ticks since the last change of the statement are used.
        bank: filters of the modes, "published" or "anchor_aware" as in the option `bank` of
            `hybrid_env.HybridTrackEnv`; None is that of the rule. Their covariance is that of the estimate at
            which they start.
    """

    thresholds, default = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0), 5.0  # few: a filter for every start is slow
    mean: ClassVar[bool]
    own_window: ClassVar[int]
    own_bank: ClassVar[Bank]

    def __init__(
        self,
        options: QuickestOptions,
        threshold: float = 5.0,
        margin: float = 2.0,
        window: int | None = None,
        bank: Bank | None = None,
    ):
        model = filter_model(options)
        self.hypotheses = options.hypotheses
        chosen = self.own_bank if bank is None else bank
        self.model = RestartModel(
            np.array(options.radii),
            check_integer("window", self.own_window if window is None else window, maximum=LONGEST_WINDOW),
            check_choice("bank", chosen, ("published", "anchor_aware")) == "published",
            self.mean,
            check_positive("threshold", threshold),
            check_positive("margin", margin, allow_zero=True),
            model,
            sensors_of(options),
        )

    @classmethod
    def maker(cls, options: QuickestOptions) -> Callable[[float], Decider]:
        """See `Decider.maker`."""
        return lambda threshold: cls(options, threshold)

    def begin(self, tracks: int) -> RestartedFilters:
        """Return filters without meaning; see `MeasurementDecider.begin`."""
        return restart_arrays(tracks, self.hypotheses, self.model.window)

    def begin_track(self, state: RestartedFilters, track: int, start: FloatArray) -> None:
        """State the most probable mode and start its filter; see `MeasurementDecider.begin_track`."""
        run_compiled(begin_restarted, state, track, int(start[-self.hypotheses :].argmax()), start, self.model)

    def step(self, state: RestartedFilters, measurements: FloatArray) -> None:
        """Advance filters and statements; see `MeasurementDecider.step`."""
        run_compiled(step_restarted, state, measurements, self.model)

    def statements(self, state: RestartedFilters, starts: BoolArray) -> Actions:
        """Return the statements; see `MeasurementDecider.statements`."""
        return state.stated.copy()


class GLRDecider(RestartDecider):
    """The generalized likelihood ratio of a switch at one of the last ticks, with its own filter each.

    The statistic of a mode is the largest likelihood ratio over the start ticks. Willsky and Jones 1976, "A generalized
    likelihood ratio approach to the detection and estimation of jumps in linear systems"; the window as in Lai 1995,
    "Sequential changepoint detection in quality control and dynamical systems". Without a margin wrong changes are
    frequent, because the measurements after a switch contradict the stated mode before they tell the other modes apart.

    Args:
        options, threshold, margin, window, bank: see `RestartDecider`; by default 60 ticks and "anchor_aware".
    """

    name, title, symbol = "glr", "GLR", "ln GLR"
    colour, marker = "#0000b4", ">"
    mean, own_window, own_bank = False, 60, "anchor_aware"


class MeanRatioDecider(RestartDecider):
    """The detector of Golubkov 2020, for M modes and any number of switches.

    The statistic of a mode is the mean of the likelihood ratios of all start ticks, lambda_k of eq. (6). It
    is the likelihood ratio of a switch at a uniformly distributed moment. The paper tests one turn against
    straight motion, once; `baselines.papers.golubkov2020.detect_switch` does that on recordings, with
    the same filters and the same corrections of eq. (5) and (7). Here every mode is tested against the stated
    one, and after a change of the statement the test begins anew from the most likely filter of the new mode.

    The rule of the paper is `margin=0`, a window that is not shorter than the episode, and the threshold
    ln A = ln((1 - beta) / alpha), 2.2 for alpha = beta = 0.1. The margin is that of `detect_switch`; the
    paper has no second alternative. The lower threshold B, at which the paper ends the test in favour of the
    stated mode, is not used: here the test would begin anew, and forget switches that have just begun.

    Args:
        options, threshold, margin, window, bank: see `RestartDecider`; by default 40 ticks and "published".
    """

    name, title, symbol = "detector-2020", "detector 2020", "ln lambda"
    colour, marker = "#695a00", "P"
    mean, own_window, own_bank = True, 40, "published"
