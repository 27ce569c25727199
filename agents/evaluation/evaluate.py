"""Any decider on fixed episodes: what it decided, when, and how surely the averages are known."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from baselines.deciders.decider import Decider
from hybrid_env.checks import reject
from hybrid_env.registration import make_vector_env

FloatArray = NDArray[np.float64]
RESAMPLES = 2000
WORTH = 0.8  # finished tracks are left out once no more than this share is still running


@dataclass(frozen=True)
class Decisions:
    """Every decision of E episodes with K segments, in arrays of shape (E, K).

    Attributes:
        correct: as the reward judges it, exact or by type.
        type_correct: straight, left or right is right.
        ticks: decision tick within the segment.
        forced: the segment ended undecided.
        true_mode, decided_mode: indices into the bank.
        length: of the segment, in ticks.
        squared_error: of the estimated position, summed over the segment [m^2].
        delay_cost: of a step.
    """

    correct: NDArray[np.bool_]
    type_correct: NDArray[np.bool_]
    ticks: NDArray[np.int64]
    forced: NDArray[np.bool_]
    true_mode: NDArray[np.int64]
    decided_mode: NDArray[np.int64]
    length: NDArray[np.int64]
    squared_error: FloatArray
    delay_cost: float

    @cached_property
    def reward(self) -> FloatArray:
        """(E, K) reward of each segment."""
        return np.where(self.correct, 1.0, -1.0) - self.delay_cost * self.ticks

    @property
    def rmse(self) -> float:
        """Root mean square error of the estimated position over all ticks [m]."""
        return float(np.sqrt(self.squared_error.sum() / self.length.sum()))

    def error_after(self) -> tuple[float, float]:
        """Share of wrong decisions after a right and after a wrong one of the episode, NaN without any."""
        before, wrong = self.correct[:, :-1], ~self.correct[:, 1:]
        right, spoiled = wrong[before], wrong[~before]
        return (
            float(right.mean()) if right.size else float("nan"),
            float(spoiled.mean()) if spoiled.size else float("nan"),
        )

    def summary(self, confidence: float = 0.95, seed: int = 0) -> dict[str, Any]:
        """Mean figures, each with its interval, and the counts behind them."""
        rows = {
            "accuracy": self.correct.mean(1),
            "type_accuracy": self.type_correct.mean(1),
            "ticks": self.ticks.mean(1),
            "reward": self.reward.mean(1),
            "forced": self.forced.mean(1),
        }
        figures: dict[str, Any] = {
            name: {"mean": float(values.mean()), "interval": interval(values, confidence, seed)}
            for name, values in rows.items()
        }
        ticks = self.length.sum(1)
        errors = self.squared_error.sum(1)
        low, high = interval(
            np.stack([errors, ticks], 1), confidence, seed, lambda pair: np.sqrt(pair[..., 0] / pair[..., 1])
        )
        figures["rmse"] = {"mean": self.rmse, "interval": (low, high)}
        return figures | {"episodes": len(self.correct), "segments": int(self.correct.size)}


def interval(
    episodes: FloatArray,
    confidence: float = 0.95,
    seed: int = 0,
    of_means: Callable[[FloatArray], Any] = lambda means: means,
) -> tuple[float, float]:
    """Percentile bootstrap interval of a function of means over episodes.

    Whole episodes are drawn again, because decisions within one depend on each other.

    Args:
        episodes: (E,) or (E, F) values of each episode.
        of_means: the figure, from means of shape (..., F) or (...).
    """
    if len(episodes) < 2 or np.ptp(episodes, axis=0).max() == 0.0:
        value = float(of_means(episodes.mean(0)))
        return value, value

    def statistic(index: NDArray[np.int64], axis: int) -> Any:
        return of_means(episodes[index].mean(axis=axis if axis >= 0 else index.ndim + axis))

    result = stats.bootstrap(
        (np.arange(len(episodes)),), statistic, n_resamples=RESAMPLES, batch=100,
        confidence_level=confidence, method="percentile", rng=seed,
    )  # fmt: skip
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def evaluate(
    decider: Decider,
    env_id: str = "hybrid_env:HybridTrack-v0",
    episodes: int = 1000,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Decisions:
    """Run a decider on the episodes seeded seed, seed + 1, ..., each exactly once.

    Every decider sees the same episodes: truth and noise do not depend on the decisions.

    Args:
        decider: see `baselines.Decider`.
        episodes: E; all run at once, one a track.
        on_progress: called with the finished share of segments, now and then.
        options: of the world, over those of the id.
    """
    env = make_vector_env(env_id, episodes, tick_info=False, **options)
    if env.options.actions != "all":
        raise reject("actions", env.options.actions, "'all' for a decider, which declares hypotheses")
    segments = env.options.segments
    fields = {
        "correct": np.bool_, "type_correct": np.bool_, "ticks": np.int64, "forced": np.bool_,
        "decided_true_mode": np.int64, "decided_mode": np.int64, "decided_length": np.int64,
        "decided_squared_error": np.float64,
    }  # fmt: skip
    held: dict[str, NDArray[Any]] = {
        name: np.zeros((episodes, segments), kind) for name, kind in fields.items()
    }
    observation, _ = env.reset(seed=seed)
    done = np.zeros(episodes, np.int64)  # decisions noted of each track
    state: Any = None
    start = np.ones(episodes, np.bool_)
    running = np.arange(episodes)  # tracks that the decider is asked about
    keep = getattr(decider, "keep", None)
    actions = np.zeros(episodes, np.int64)
    while True:
        unfinished = done[running] < segments
        if keep is not None and np.count_nonzero(unfinished) < WORTH * running.size:
            state, running = keep(state, unfinished), running[unfinished]
            actions[:] = 0
        asked, state = decider.predict(
            observation[running], state=state, episode_start=start[running], deterministic=True
        )
        actions[running] = asked
        observation, _, start, _, info = env.step(actions)
        decided = info.get("_decided_mode")
        if decided is None:
            continue
        noted = np.flatnonzero(decided & (done < segments))
        for name in fields:
            held[name][noted, done[noted]] = info[name][noted]
        done[noted] += 1
        if on_progress is not None:
            on_progress(float(done.sum()) / held["ticks"].size)
        if (done == segments).all():
            break
    return Decisions(
        held["correct"], held["type_correct"], held["ticks"], held["forced"], held["decided_true_mode"],
        held["decided_mode"], held["decided_length"], held["decided_squared_error"], env.options.delay_cost,
    )  # fmt: skip
