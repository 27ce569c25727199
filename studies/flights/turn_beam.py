"""A beam of switch histories over turn rates: the semi-Markov posterior, in which short turns are
unlikely. A history is the present turn rate, the age of its mode and a filter (`turns`). At every
position it goes on or changes by a law of the durations. Those that change to one turn rate at one
position are merged, and the most probable ones kept.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import log_softmax

from baselines import mixture
from studies.flights.turns import (
    STRAIGHT,
    Batch,
    FloatArray,
    IntArray,
    TurnModel,
    start_turns,
    step_turns,
)


class Histories(NamedTuple):
    """K histories of each of B pieces of flights."""

    # (B, K, n), see `turns.step_turns`
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
    batch: Batch, model: TurnModel, shortest: tuple[float, float] = (0.0, 6.0), branches: int = 40
) -> FloatArray:
    """Return the probabilities (T, B, 3) of straight motion, left and right turns at every
    position.

    Args:
        batch: pieces of flights.
        model: settings of the filters.
        shortest: shortest duration of straight motion and of a turn [s]; beyond it a duration is
            exponential, with the mean of the model.
        branches: largest number of histories.
    """
    omega, modes = np.radians(model.rates), model.modes
    output = np.empty((*batch.times.shape, 3))
    tracks = np.arange(output.shape[1])[:, None]
    # One history of each turn rate, in the midst of its mode.
    start = np.arange(len(omega)), np.where(modes == STRAIGHT, *shortest), np.log(model.start)
    rates, ages, log_weights = (np.tile(values, (len(tracks), 1)) for values in start)
    beam = Histories(*start_turns(batch, len(omega), model), rates, ages, log_weights)
    for k, dt in enumerate(batch.steps):
        if k:
            beam = _branch(beam, dt[:, None], model, shortest)
            filters = (beam.state, beam.covariance, omega[beam.model], np.exp(beam.log_weight))
            state, covariance, log_likelihood, _ = step_turns(batch, k, dt, *filters, model)
            log_weight = beam.log_weight + log_likelihood
            # The most probable ones, with normalised weights.
            best = np.argsort(-log_weight, axis=1, kind="stable")[:, :branches]
            beam = Histories(
                state[tracks, best],
                covariance[tracks, best],
                beam.model[tracks, best],
                beam.age[tracks, best],
                log_softmax(log_weight[tracks, best], axis=1),
            )
        weights = np.exp(beam.log_weight)
        for mode in range(3):
            output[k, :, mode] = np.where(modes[beam.model] == mode, weights, 0.0).sum(1)
    return output


def _branch(
    beam: Histories, dt: FloatArray, model: TurnModel, shortest: tuple[float, float]
) -> Histories:
    """Return each history as it goes on, after steps (B, 1) [s], then changes to each turn rate in
    another and in the same mode.
    """
    modes, count = model.modes, len(model.rates)
    straight = modes[beam.model] == STRAIGHT
    least = np.where(straight, *shortest)
    # Within its shortest duration a mode does not end.
    exposed = np.maximum(beam.age + dt - least, 0.0) - np.maximum(beam.age - least, 0.0)
    ends = -np.expm1(-exposed / (np.where(straight, model.straight, model.turn) - least))
    # Changes to another mode, and to another turn rate of the same mode.
    rates = np.maximum(model.generator, 0.0)
    inside = rates * (modes[:, None] == modes)
    changes = -np.expm1(-inside.sum(1)[beam.model] * dt)
    weight = np.exp(beam.log_weight)
    joint = []
    for part, to in ((weight * ends, rates - inside), (weight * (1.0 - ends) * changes, inside)):
        share = to / np.maximum(to.sum(1, keepdims=True), 1e-300)
        joint.append((part[..., None] * share[beam.model]).swapaxes(1, 2))
    # Histories that change to one turn rate are merged, (B, 2 M, K).
    shared = np.concatenate(joint, axis=1)
    total = shared.sum(2)
    shared = shared / np.where(total > 0.0, total, 1.0)[..., None]
    shared[..., 0] += total == 0.0
    ages = (shared[:, count:] * beam.age[:, None]).sum(2)
    with np.errstate(divide="ignore"):
        goes_on = beam.log_weight + np.log1p(-ends) + np.log1p(-changes)
        changed = Histories(
            *mixture(beam.state, beam.covariance, shared),
            np.tile(np.arange(count), (len(dt), 2)),
            np.concatenate([np.zeros_like(ages), ages], axis=1),
            np.log(total),
        )
    pairs = zip(beam._replace(log_weight=goes_on), changed, strict=True)
    after = Histories(*(np.concatenate(pair, axis=1) for pair in pairs))
    return after._replace(age=after.age + dt)
