"""Classical tests for a change of the stated mode, CUSUM and Shiryaev-Roberts.
Each mode is compared with the stated one by the log-likelihood ratios of single ticks, l =
ln p(z | mode) - ln p(z | stated mode), of the running bank. When a statistic reaches the threshold,
the statement changes to its mode and all statistics of the track begin anew.
"""

import math
from typing import Any

import numpy as np

from baselines.rules.decider import UNKNOWN, Actions, Decider, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import FloatArray
from hybrid_env.observation import QuickestLayout


class CusumDecider(Decider):
    """The cumulative sum of the ratios since the moment that is best for the other mode.

    G = max(0, G + l). Page 1954, "Continuous inspection schemes".

    Args:
        threshold: of G, above 0.
    """

    name = "cusum"
    task = UNKNOWN
    title = "CUSUM"
    symbol = "G"
    default = 4.0
    thresholds = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 15.0)
    bounds = 1e-12, math.inf
    # First value of a statistic.
    start = 0.0

    def update(self, statistics: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return the statistics after one more tick, (N, M). ratio: (N, M)."""
        return np.maximum(statistics + ratio, 0.0)

    def decide(
        self, observation: Observations, state: FloatArray | None, episode_start: Any
    ) -> tuple[Actions, FloatArray]:
        """See `Decider.decide`; action i states mode i. The state are the statistics, (N, M). The
        first statement of an episode is the most probable mode; rows tell where an episode begins.
        """
        layout = QuickestLayout.of_rows(observation)
        stated, started = read_statement(observation)
        ratio = layout.read(observation, "log_ratio")
        ratio -= np.take_along_axis(ratio, stated[:, None], -1)
        before = np.full_like(ratio, self.start) if state is None else state.copy()
        before[~started] = self.start
        memory = self.update(before, ratio)
        statistics = memory.copy()
        np.put_along_axis(statistics, stated[:, None], -np.inf, -1)
        best = statistics.argmax(-1)
        changes = started & (statistics.max(-1) >= self.threshold)
        memory[changes | ~started] = self.start
        actions = np.where(changes, best, stated)
        first = layout.read(observation, "log_probability").argmax(-1)
        return np.where(started, actions, first), memory


class ShiryaevRobertsDecider(CusumDecider):
    """The sum of the likelihood ratios of all moments of the switch since the last statement.

    R = (1 + R) exp(l), here in logarithms. Shiryaev 1963, "On optimum methods in quickest detection
    problems"; Roberts 1966, "A comparison of some control chart procedures".

    Args:
        threshold: of ln R, above 0.
    """

    name = "shiryaev-roberts"
    title = "Shiryaev-Roberts"
    symbol = "ln R"
    default = 6.0
    thresholds = (2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 12.0, 15.0)
    start = -np.inf

    def update(self, statistics: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return the values of ln R."""
        return np.logaddexp(statistics, 0.0) + ratio
