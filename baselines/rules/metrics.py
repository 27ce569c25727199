"""Metrics of statements: share of right ticks, detection delay, misses, wrong changes, reward."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baselines.rules.statements import Statements
from hybrid_env.checks import check_positive, reject

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class StatementMetrics:
    """Metrics of N tracks of T ticks. Means over tracks are the figures; tracks are independent.

    Attributes:
        right: (N,) share of ticks with a right statement.
        reward: (N,) mean reward of a tick.
        wrong_changes: (N,) changes of the statement to a wrong mode per 1,000 ticks.
        stated_changes: (N,) number of changes of the statement.
        true_changes: (N,) number of switches.
        delays: (D,) ticks from each detected switch to the first right statement, 0 if that is at the first
            tick of the new mode. A switch is detected if the new mode is stated before the next switch.
        delay_tracks: (D,) track of each delay.
        missed: (N,) number of switches that are followed by another one before they are detected. An
            undetected last switch of a track is neither detected nor missed.
    """

    right: FloatArray
    reward: FloatArray
    wrong_changes: FloatArray
    stated_changes: NDArray[np.int64]
    true_changes: NDArray[np.int64]
    delays: NDArray[np.int64]
    delay_tracks: NDArray[np.int64]
    missed: NDArray[np.int64]

    @property
    def mean_delay(self) -> float:
        """Mean delay of detected switches [ticks], NaN without one."""
        return float(self.delays.mean()) if self.delays.size else float("nan")

    def delay_quantiles(self, *levels: float) -> FloatArray:
        """Return quantiles of the delays of detected switches [ticks], NaN without one."""
        if not self.delays.size:
            return np.full(len(levels), np.nan)
        return np.asarray(np.quantile(self.delays, levels))

    @property
    def missed_share(self) -> float:
        """Share of missed switches among detected and missed ones, NaN without any."""
        missed = int(self.missed.sum())
        return missed / (missed + self.delays.size) if missed + self.delays.size else float("nan")

    @property
    def change_ratio(self) -> float:
        """Changes of the statement per switch, NaN without a switch."""
        switches = int(self.true_changes.sum())
        return int(self.stated_changes.sum()) / switches if switches else float("nan")


def measure_statements(statements: Statements, change_cost: float = 5.0) -> StatementMetrics:
    """Measure recorded statements.

    Args:
        statements: modes of T >= 1 ticks and N >= 1 tracks.
        change_cost: cost of a change to a wrong mode, as in the environment.

    Raises:
        ArgumentError: the arrays have no equal shape (T, N), or the cost is negative.
    """
    true, stated = (np.asarray(modes) for modes in statements)
    if true.ndim != 2 or true.shape != stated.shape or not true.size:
        raise reject("statements", (true.shape, stated.shape), "two arrays of the same shape (T, N)")
    change_cost = check_positive("change_cost", change_cost, allow_zero=True)
    right = true == stated
    changed, switched = (np.diff(modes, axis=0, prepend=modes[:1]) != 0 for modes in (stated, true))
    wrong = changed & ~right
    delays, delay_tracks, missed = _detections(switched, right)
    return StatementMetrics(
        right=right.mean(0),
        reward=(right - change_cost * wrong).mean(0),
        wrong_changes=1000.0 * wrong.mean(0),
        stated_changes=changed.sum(0),
        true_changes=switched.sum(0),
        delays=delays,
        delay_tracks=delay_tracks,
        missed=missed,
    )


def _detections(
    switched: NDArray[np.bool_], right: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the delays (D,), their tracks (D,), and the number of missed switches of each track (N,).

    Args:
        switched: (T, N) True at the first tick of a new mode.
        right: (T, N) True where the statement is right.
    """
    ticks, tracks = switched.shape
    times = np.arange(ticks)[:, None]
    # for every tick the next one, itself included, with a right statement, and the next with a switch
    next_right, next_switch = (
        np.minimum.accumulate(np.where(flags, times, ticks)[::-1], axis=0)[::-1]
        for flags in (right, switched)
    )
    end = np.vstack([next_switch[1:], np.full((1, tracks), ticks)])  # of the segment that begins at a switch
    detected = switched & (next_right < end)
    missed = switched & ~detected & (end < ticks)
    when, which = np.nonzero(detected)
    return next_right[detected] - when, which, missed.sum(0)
