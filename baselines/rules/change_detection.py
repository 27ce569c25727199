"""Classical tests for a change of the stated mode: CUSUM and Shiryaev-Roberts.

Every rule compares each mode with the stated one by the log-likelihood ratios of single ticks, l = ln p(z |
mode) - ln p(z | stated mode), which the running bank gives. When a statistic reaches the threshold, the
statement changes to its mode and all statistics of the track begin anew.
"""

import numpy as np
from numpy.typing import NDArray

from baselines.rules.decider import UNKNOWN, Actions, Decider, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import check_positive
from hybrid_env.observation import QuickestLayout

FloatArray = NDArray[np.float64]


class ChangeDecider(Decider):
    """A rule that changes its statement when the statistic of another mode reaches a threshold.

    Args:
        threshold: of the statistic, above 0.

    Raises:
        ArgumentError: an argument is out of range.
    """

    task = UNKNOWN

    def __init__(self, threshold: float):
        self.threshold = check_positive("threshold", threshold)

    def begin(self, tracks: int, modes: int) -> FloatArray:
        """Return the memory of N tracks before their first ratio, (N, ..., M)."""
        raise NotImplementedError

    def update(self, memory: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the memory after one more tick, and the statistics (N, M). ratio: (N, M)."""
        raise NotImplementedError

    def predict(
        self,
        observation: Observations,
        state: FloatArray | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, FloatArray]:
        """See `Decider.predict`; action i states mode i.

        The first statement of an episode is the most probable mode.

        Args:
            observation: (N, 6 M + 2) rows of `hybrid_env.HybridTrackQuickestEnv`.
            state: memory of the statistics, (N, ..., M); None begins anew.
            episode_start, deterministic: not used; rows tell where an episode begins.
        """
        layout = QuickestLayout.of_rows(observation)
        tracks, modes = len(observation), layout.hypotheses
        stated, started = read_statement(observation)
        ratio = layout.read(observation, "log_ratio")
        ratio -= np.take_along_axis(ratio, stated[:, None], -1)
        fresh = self.begin(tracks, modes)
        memory = fresh if state is None else state.copy()
        memory[~started] = fresh[~started]
        memory, statistics = self.update(memory, ratio)
        np.put_along_axis(statistics, stated[:, None], -np.inf, -1)
        best = statistics.argmax(-1)
        changes = started & (statistics.max(-1) >= self.threshold)
        memory[changes | ~started] = fresh[changes | ~started]
        actions = np.where(changes, best, stated)
        first = layout.read(observation, "log_probability").argmax(-1)
        return np.where(started, actions, first), memory


class CusumDecider(ChangeDecider):
    """The cumulative sum of the ratios since the moment that is best for the other mode.

    G = max(0, G + l). Page 1954, "Continuous inspection schemes".

    Args:
        threshold: of G, above 0.
    """

    name, title, symbol, default = "cusum", "CUSUM", "G", 4.0
    thresholds = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 15.0)
    colour, marker = "#a0a0a0", "s"

    def __init__(self, threshold: float = 4.0):
        super().__init__(threshold)

    def begin(self, tracks: int, modes: int) -> FloatArray:
        """Return sums of 0, (N, M)."""
        return np.zeros((tracks, modes))

    def update(self, memory: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the sums twice: as memory and as statistics."""
        sums = np.maximum(memory + ratio, 0.0)
        return sums, sums.copy()


class ShiryaevRobertsDecider(ChangeDecider):
    """The sum of the likelihood ratios of all moments of the switch since the last statement.

    R = (1 + R) exp(l), here in logarithms. Shiryaev 1963, "On optimum methods in quickest detection
    problems"; Roberts 1966, "A comparison of some control chart procedures".

    Args:
        threshold: of ln R, above 0.
    """

    name, title, symbol, default = "shiryaev-roberts", "Shiryaev-Roberts", "ln R", 6.0
    thresholds = (2.0, 3.0, 4.0, 4.5, 5.0, 5.5, 6.0, 6.5, 7.0, 7.5, 8.0, 9.0, 10.0, 12.0, 15.0)
    colour, marker = "#ff87f0", "d"

    def __init__(self, threshold: float = 6.0):
        super().__init__(threshold)

    def begin(self, tracks: int, modes: int) -> FloatArray:
        """Return ln R = -inf, (N, M)."""
        return np.full((tracks, modes), -np.inf)

    def update(self, memory: FloatArray, ratio: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln R twice: as memory and as statistics."""
        logarithms = np.logaddexp(memory, 0.0) + ratio
        return logarithms, logarithms.copy()
