"""Evaluation of a decider on fixed episodes: decisions, decision times and confidence intervals."""

import dataclasses
import functools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from baselines.rules.decider import Decider
from hybrid_env.checks import check_integer, reject
from hybrid_env.registration import make_vector_env

FloatArray = NDArray[np.float64]
RESAMPLES = 2000  # of the bootstrap
LARGEST_BATCH = 700_000_000  # bytes
LARGEST_RESULT = 10_000_000  # segments, which need half a gigabyte
COMPACTION_FRACTION = 0.8  # finished tracks are dropped once fewer than this fraction are unfinished


@dataclass(frozen=True)
class Decisions:
    """All decisions in E episodes with K segments each, as arrays of shape (E, K).

    Attributes:
        correct: the decision is correct as defined by the reward, exactly or by type.
        type_correct: the type (straight, left or right) is correct.
        ticks: decision time within the segment, in ticks.
        forced: the segment ended without a declaration.
        true_mode, decided_mode: indices into the bank.
        length: of the segment, in ticks.
        squared_error: of the estimated position, summed over the segment [m^2].
        delay_cost: per tick.
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
        """Reward of each segment, (E, K)."""
        return np.where(self.correct, 1.0, -1.0) - self.delay_cost * self.ticks

    @property
    def rmse(self) -> float:
        """Root-mean-square error of the estimated position over all ticks [m]."""
        return float(np.sqrt(self.squared_error.sum() / self.length.sum()))

    def error_after(self) -> tuple[float, float]:
        """Return the error rate after a correct and after a wrong decision in the episode; NaN if none."""
        previous_correct, wrong = self.correct[:, :-1], ~self.correct[:, 1:]
        after_correct, after_wrong = wrong[previous_correct], wrong[~previous_correct]
        return (
            float(after_correct.mean()) if after_correct.size else float("nan"),
            float(after_wrong.mean()) if after_wrong.size else float("nan"),
        )

    def summary(self, confidence: float = 0.95, seed: int = 0) -> dict[str, Any]:
        """Return mean metrics with confidence intervals, and the numbers of episodes and segments.

        Args:
            confidence: level of the intervals.
            seed: of the bootstrap.
        """
        rows = {
            "accuracy": self.correct.mean(1),
            "type_accuracy": self.type_correct.mean(1),
            "ticks": self.ticks.mean(1),
            "reward": self.reward.mean(1),
            "forced": self.forced.mean(1),
        }
        metrics: dict[str, Any] = {}
        for name, values in rows.items():
            interval_of = confidence_interval if name in ("ticks", "reward") else share_interval
            interval = interval_of(values, confidence, seed)
            metrics[name] = {"mean": float(values.mean()), "interval": interval}
        ticks = self.length.sum(1)
        errors = self.squared_error.sum(1)
        low, high = confidence_interval(
            np.stack([errors, ticks], 1), confidence, seed, lambda pair: np.sqrt(pair[..., 0] / pair[..., 1])
        )
        metrics["rmse"] = {"mean": self.rmse, "interval": (low, high)}
        return metrics | {"episodes": len(self.correct), "segments": int(self.correct.size)}


def confidence_interval(
    episodes: FloatArray,
    confidence: float = 0.95,
    seed: int = 0,
    of_means: Callable[[FloatArray], Any] = lambda means: means,
) -> tuple[float, float]:
    """Return the percentile bootstrap confidence interval of a function of means over episodes.

    Whole episodes are resampled, because the decisions within an episode are dependent.

    Args:
        episodes: (E,) or (E, F) values of each episode.
        confidence: level of the interval.
        seed: of the bootstrap.
        of_means: the statistic, from means of shape (..., F) or (...).
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


def share_interval(shares: FloatArray, confidence: float = 0.95, seed: int = 0) -> tuple[float, float]:
    """Return the confidence interval of a mean share, as `confidence_interval`, also if no episode differs.

    If all shares are 1, every resample is equal. The interval is then Wilson's (1927) for the probability
    that an episode has the share 1; the mean share is at least this probability. The same holds for 0.

    Args:
        shares: (E,) share of decisions in each episode, from 0 to 1.
        confidence: level of the interval.
        seed: of the bootstrap.
    """
    if shares[0] in (0.0, 1.0) and (shares == shares[0]).all():
        test = stats.binomtest(int(shares.sum()), len(shares))
        interval = test.proportion_ci(confidence, method="wilson")
        return float(interval.low), float(interval.high)
    return confidence_interval(shares, confidence, seed)


def evaluate(
    decider: Decider,
    env_id: str = "hybrid_env:HybridTrack-v0",
    episodes: int = 1000,
    seed: int = 0,
    on_progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Decisions:
    """Run a decider on the episodes with seeds seed, seed + 1, ..., each exactly once.

    All deciders face the same episodes: trajectories and noise do not depend on the decisions.

    Args:
        decider: see `baselines.rules.decider.Decider`. If it has a method
            `select_tracks(state, mask)`, finished tracks are dropped.
        env_id: registered id.
        episodes: E; they run in parallel, one per track, in batches that need less than a gigabyte.
        seed: of the first episode.
        on_progress: called repeatedly with the fraction of finished segments.
        options: environment options that override those of the id.

    Raises:
        ArgumentError: the actions of the environment are not declarations of hypotheses.
    """
    world = make_vector_env(env_id, 1, **options).options
    check_integer("episodes", episodes, maximum=max(1, LARGEST_RESULT // world.segments))
    bytes_per_episode = 2500 + 2800 * world.hypotheses  # measured, with a network
    size = min(episodes, max(1, LARGEST_BATCH // bytes_per_episode))

    def show(finished: int, count: int, share: float) -> None:
        if on_progress is not None:
            on_progress((finished + count * share) / episodes)

    batches = []
    for first in range(0, episodes, size):
        count = min(size, episodes - first)
        progress = functools.partial(show, first, count)
        batches.append(_evaluate_batch(decider, env_id, count, seed + first, progress, options))
    arrays = {
        field.name: np.concatenate([getattr(batch, field.name) for batch in batches])
        for field in dataclasses.fields(Decisions)
        if field.name != "delay_cost"
    }
    return Decisions(**arrays, delay_cost=world.delay_cost)


def _evaluate_batch(
    decider: Decider,
    env_id: str,
    episodes: int,
    seed: int,
    on_progress: Callable[[float], None],
    options: dict[str, Any],
) -> Decisions:
    env = make_vector_env(env_id, episodes, tick_info=False, **options)
    if env.options.actions != "all":
        raise reject("actions", env.options.actions, "'all': deciders declare hypotheses")
    segments = env.options.segments
    fields = {
        "correct": np.bool_, "type_correct": np.bool_, "ticks": np.int64, "forced": np.bool_,
        "decided_true_mode": np.int64, "decided_mode": np.int64, "decided_length": np.int64,
        "decided_squared_error": np.float64,
    }  # fmt: skip
    recorded: dict[str, NDArray[Any]] = {
        name: np.zeros((episodes, segments), kind) for name, kind in fields.items()
    }
    observation, _ = env.reset(seed=seed)
    finished = np.zeros(episodes, np.int64)  # recorded decisions of each track
    state: Any = None
    start = np.ones(episodes, np.bool_)
    running = np.arange(episodes)  # tracks passed to the decider
    select_tracks = getattr(decider, "select_tracks", None)
    actions = np.zeros(episodes, np.int64)
    while True:
        unfinished = finished[running] < segments
        if select_tracks is not None and np.count_nonzero(unfinished) < COMPACTION_FRACTION * running.size:
            state, running = select_tracks(state, unfinished), running[unfinished]
            actions[:] = 0
        chosen, state = decider.predict(
            observation[running], state=state, episode_start=start[running], deterministic=True
        )
        actions[running] = chosen
        observation, _, start, _, info = env.step(actions)
        decided = info.get("_decided_mode")
        if decided is None:
            continue
        new = np.flatnonzero(decided & (finished < segments))
        for name in fields:
            recorded[name][new, finished[new]] = info[name][new]
        finished[new] += 1
        on_progress(float(finished.sum()) / recorded["ticks"].size)
        if (finished == segments).all():
            break
    return Decisions(
        correct=recorded["correct"],
        type_correct=recorded["type_correct"],
        ticks=recorded["ticks"],
        forced=recorded["forced"],
        true_mode=recorded["decided_true_mode"],
        decided_mode=recorded["decided_mode"],
        length=recorded["decided_length"],
        squared_error=recorded["decided_squared_error"],
        delay_cost=env.options.delay_cost,
    )
