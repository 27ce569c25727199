"""Decisions between kinematic models on recorded measurements, with known switch moments.

The deciders of `baselines.deciders` with a bank of CV, CA and CJ filters, as they run in the environment with
straight motion and turns.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.deciders.decider import Decider
from baselines.filters.imm import resized
from baselines.filters.kinematic_bank import KinematicBank
from baselines.filters.motion_models import check_scalar
from baselines.filters.run_filter import check_times
from baselines.filters.track_filter import check_measurements
from hybrid_env.checks import check_array, check_integer, reject

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ModelDecisions:
    """Decisions for T ticks, B tracks, K segments and M hypotheses.

    Attributes:
        states: (T, B, n) estimates of the last decided hypothesis, with the size of the largest model;
            derivatives that a model lacks are 0.
        modes: (T, B) last decided hypothesis, from the tick after its decision on.
        decided: (B, K) hypothesis of each segment; the likeliest one if the segment ended undecided.
        ticks: (B, K) decision time since the switch [ticks]; the segment length if undecided.
        undecided: (B, K) True if the segment ended without a decision.
        log_likelihoods: (T, B, M) since the last switch.
    """

    states: FloatArray
    modes: NDArray[np.int64]
    decided: NDArray[np.int64]
    ticks: NDArray[np.int64]
    undecided: NDArray[np.bool_]
    log_likelihoods: FloatArray


def decide_models(
    bank: KinematicBank,
    decider: Decider,
    measurements: ArrayLike,
    times: ArrayLike,
    lengths: Sequence[int],
    start: tuple[ArrayLike, ArrayLike, float],
    mode: int = 0,
) -> ModelDecisions:
    """Decide the kinematic model of every segment of recorded tracks.

    At a switch all filters of the bank start from the estimate of the last decided hypothesis. The decider is
    asked after every tick until it declares. A segment that ends undecided is decided for the likeliest.

    Args:
        bank: filters of the hypotheses.
        decider: reads rows of the bank.
        measurements: (T, B, d) [m], NaN where there is none.
        times: (T,) or (T, B) of the ticks [s].
        lengths: (K,) lengths of the segments [ticks], with sum T.
        start: estimates (B, d m) with any m >= 2, covariances, and their time [s], not after the first tick.
        mode: hypothesis before the first switch.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """
    values = check_measurements("measurements", measurements, (None, None, bank.axes))
    total, tracks = values.shape[:2]
    ticks = [check_integer("lengths", length) for length in lengths]
    if sum(ticks) != total:
        raise reject("lengths", ticks, f"lengths whose sum is {total}, the number of ticks")
    moments = check_times(times, total, tracks)
    state, covariance, time = start
    if len(check_array("start estimates", state, (None, None))) != tracks:
        raise reject("start estimates", np.shape(state), f"one estimate for each of {tracks} tracks")
    first = np.broadcast_to(check_scalar("start time", time), moments[0].shape)
    if (first > moments[0]).any():
        raise reject("start time", time, "a time not after the first tick")
    steps = np.diff(moments, axis=0, prepend=first[None])
    active = np.full(tracks, check_integer("mode", mode, 0, bank.hypotheses - 1))
    order = max(one.order for one in bank.filters)
    K = len(ticks)
    result = ModelDecisions(
        np.empty((total, tracks, bank.axes * order)), np.empty((total, tracks), np.int64),
        np.empty((tracks, K), np.int64), np.empty((tracks, K), np.int64), np.ones((tracks, K), np.bool_),
        np.empty((total, tracks, bank.hypotheses)),
    )  # fmt: skip
    k = 0
    decider_state: Any = None
    episode_start = np.ones(tracks, np.bool_)
    bank.begin(state, covariance)
    for segment, length in enumerate(ticks):
        if segment:
            bank.switch(active)
        result.ticks[:, segment] = length
        for tick in range(1, length + 1):
            bank.step(steps[k], values[k])
            result.states[k], result.modes[k] = _states_of(bank, active, order), active
            result.log_likelihoods[k] = bank.log_likelihood
            actions, decider_state = decider.predict(
                bank.rows(active, length - tick), decider_state, episode_start, True
            )
            episode_start = np.zeros(tracks, np.bool_)
            declares = (actions > 0) & result.undecided[:, segment]
            result.ticks[declares, segment] = tick
            result.undecided[declares, segment] = False
            active = np.where(declares, actions - 1, active)
            k += 1
        likeliest = bank.log_likelihood.argmax(-1)
        active = np.where(result.undecided[:, segment], likeliest, active)
        result.decided[:, segment] = active
    return result


def _states_of(bank: KinematicBank, chosen: NDArray[np.int64], order: int) -> FloatArray:
    """Estimates of the chosen hypothesis of each track, (B, n), with so many values per axis."""
    parts = [resized(one.state, one.covariance, bank.axes, order, None)[0] for one in bank.filters]
    return np.stack(parts)[chosen, np.arange(len(chosen))]
