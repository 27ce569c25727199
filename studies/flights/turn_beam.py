"""A beam of switch histories over turn rates: the semi-Markov posterior, in which short turns are
unlikely. A history is the present turn rate, the age of its mode and a filter (`turns`). At every
position it goes on or changes by a law of the durations. Those that change to one turn rate at one
position are merged, and the most probable ones kept.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from studies.flights.turns import (
    STRAIGHT,
    Batch,
    FloatArray,
    IntArray,
    TurnModel,
    climb_evidence,
    mixture,
    start_turns,
    step_turns,
)


@dataclass(frozen=True, kw_only=True)
class TurnHistories:
    """Settings of the beam; chosen on simulated flights. The duration of a mode is its shortest one
    and an exponential time, with the mean of `TurnModel`.
    """

    # Duration of straight motion and of a turn [s].
    shortest: tuple[float, float] = (0.0, 6.0)
    # Largest number of histories.
    branches: int = 40


class Histories(NamedTuple):
    """K histories of each of B pieces of flights."""

    # (B, K, n), see `turns.TurnStep`
    state: FloatArray
    # (B, K, n, n)
    covariance: FloatArray
    # (B, K) index of the turn rate.
    model: IntArray
    # (B, K) time since the mode began [s]
    age: FloatArray
    # (B, K) logarithm of the probability, -inf where there is no history.
    log_weight: FloatArray


def run_turn_beam(
    batch: Batch,
    model: TurnModel | None = None,
    histories: TurnHistories | None = None,
) -> FloatArray:
    """Return the probabilities (T, B, 3) of straight motion, left and right turns at every
    position.
    """
    settings = TurnModel() if model is None else model
    beam = TurnHistories() if histories is None else histories
    omega, modes = np.radians(settings.rates), settings.modes
    steps = batch.steps
    now = _begin(batch, settings, beam)
    output = np.empty((*batch.times.shape, 3))
    for k in range(len(output)):
        if k:
            now = _branch(now, steps[k], settings, beam)
            after = step_turns(
                batch,
                batch.positions[k],
                steps[k],
                now.state,
                now.covariance,
                omega[now.model],
                np.exp(now.log_weight),
                settings,
            )
            climb = climb_evidence(batch, settings, k)
            if climb.size > 1:
                climb = np.take_along_axis(climb, now.model, axis=1)
            log_weight = now.log_weight + after.log_likelihood + climb
            now = _keep(
                now._replace(
                    state=after.state,
                    covariance=after.covariance,
                    log_weight=log_weight,
                ),
                beam.branches,
            )
        weights = np.exp(now.log_weight)
        for mode in range(3):
            output[k, :, mode] = np.where(modes[now.model] == mode, weights, 0.0).sum(1)
    return output


def _begin(batch: Batch, model: TurnModel, beam: TurnHistories) -> Histories:
    """Return one history of each turn rate, in the midst of its mode."""
    tracks = batch.times.shape[1]
    count = len(model.rates)
    age = np.where(model.modes == STRAIGHT, *beam.shortest)
    return Histories(
        *start_turns(batch, count, model),
        np.tile(np.arange(count), (tracks, 1)),
        np.tile(age, (tracks, 1)),
        np.tile(np.log(model.start), (tracks, 1)),
    )


def _branch(now: Histories, steps: FloatArray, model: TurnModel, beam: TurnHistories) -> Histories:
    """Return each history as it goes on, then changes to each turn rate in another and in the
    same mode.
    """
    modes, count, dt = model.modes, len(model.rates), steps[:, None]
    shortest = np.where(modes == STRAIGHT, *beam.shortest)[now.model]
    mean = np.where(modes == STRAIGHT, model.straight, model.turn)[now.model]
    # Within its shortest duration a mode does not end.
    exposed = np.maximum(now.age + dt - shortest, 0.0) - np.maximum(now.age - shortest, 0.0)
    ends = -np.expm1(-exposed / (mean - shortest))
    # Changes to another mode, and to another turn rate of the same mode.
    rates = np.maximum(model.generator, 0.0)
    inside = rates * (modes[:, None] == modes)
    changes = -np.expm1(-inside.sum(1)[now.model] * dt)
    weight = np.exp(now.log_weight)
    shares = [
        one / np.maximum(one.sum(1, keepdims=True), 1e-300) for one in (rates - inside, inside)
    ]
    joint = np.concatenate(
        [
            (part[..., None] * share[now.model]).swapaxes(1, 2)
            for part, share in zip(
                (weight * ends, weight * (1.0 - ends) * changes),
                shares,
                strict=True,
            )
        ],
        axis=1,
        # (B, 2 M, K)
    )
    # Histories that change to one turn rate are merged.
    total = joint.sum(2)
    shared = joint / np.where(total > 0.0, total, 1.0)[..., None]
    shared[..., 0] += total == 0.0
    ages = (shared[:, count:] * now.age[:, None]).sum(2)
    state, covariance = mixture(now.state, now.covariance, shared)
    with np.errstate(divide="ignore"):
        goes_on = now.log_weight + np.log1p(-ends) + np.log1p(-changes)
        log_weight = np.concatenate([goes_on, np.log(total)], axis=1)
    return Histories(
        np.concatenate([now.state, state], axis=1),
        np.concatenate([now.covariance, covariance], axis=1),
        np.concatenate([now.model, np.tile(np.arange(count), (len(steps), 2))], axis=1),
        np.concatenate([now.age, np.zeros_like(ages), ages], axis=1) + dt,
        log_weight,
    )


def _keep(now: Histories, count: int) -> Histories:
    """Return the most probable histories with normalised weights."""
    order = np.argsort(-now.log_weight, axis=1, kind="stable")[:, :count]
    rows = np.arange(len(order))[:, None]
    log_weight = now.log_weight[rows, order]
    log_weight = log_weight - log_weight[:, :1]
    log_weight -= np.log(np.exp(log_weight).sum(1, keepdims=True))
    return Histories(
        now.state[rows, order],
        now.covariance[rows, order],
        now.model[rows, order],
        now.age[rows, order],
        log_weight,
    )
