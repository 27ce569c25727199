"""What a branch of the beam learns of an object's habits: durations and order of its segments;
compiled code.

The law of the durations is one of L laws: one for all modes ("same"), or one for straight motion
and another for turns, independent of each other ("straight", "turns"). Given the history of a
branch, these beliefs are exact by Bayes' rule: a segment that ends multiplies the belief in each
law by the probability of its duration. The filters of a branch do not depend on the laws, so that
all laws share them. The next modes are equally likely, or they have a Dirichlet prior, whose
posterior follows from counts. Branches that merge average their habits.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_env.checks import AnyArray, Float32Array, FloatArray, IntArray
from hybrid_env.compiled import internal, summing

# Beliefs below become 0: denormal numbers are slow.
SMALLEST_BELIEF = np.float32(1e-30)


class Habits(NamedTuple):
    """Habits of N tracks, S slots for each.

    Rows of `laws` are "same", "straight" and "turns". The last two have the same sum, the
    probability that they differ.
    """

    # (N, S, 3, L) joint probabilities of law and kind when the present segment began.
    laws: Float32Array
    # (N, S, L) sum of the rows of `laws` that concern the present segment.
    beliefs: Float32Array
    # (N, S, M, M) expected number of switches from a mode (row) to another.
    orders: Float32Array
    # (N, S, M) probability that each mode follows the present segment.
    following: FloatArray
    # (N, S) probability that the next modes are not equally likely.
    habitual: Float32Array


@internal
def begin_habits(
    habits: Habits, track: int, slots: int, prior: FloatArray, habitual: float
) -> None:
    """Give the first slots of a track, one for each mode, the prior of the laws, (3, L), and of
    habits.
    """
    for slot in range(slots):
        habits.laws[track, slot] = prior
        habits.orders[track, slot] = 0.0
        habits.habitual[track, slot] = habitual
        _begin_segment(habits, track, slot, slot)


@internal
def _begin_segment(habits: Habits, track: int, slot: int, mode: int) -> None:
    """Write what concerns a segment of a mode: the beliefs, and the probabilities of the next
    modes.
    """
    laws = habits.laws
    kind = 2 if mode > 0 else 1
    for law in range(laws.shape[3]):
        habits.beliefs[track, slot, law] = laws[track, slot, 0, law] + laws[track, slot, kind, law]
    counts = habits.orders[track, slot, mode]
    habitual = habits.habitual[track, slot]
    # Added to the count of each next mode, if these are not equally likely.
    pseudo_count = 0.5
    total = 0.0
    modes = counts.size
    for k in range(modes):
        total += counts[k]
    for k in range(modes):
        counted = (counts[k] + pseudo_count) / (total + pseudo_count * (modes - 1))
        probability = habitual * counted + (1.0 - habitual) / (modes - 1)
        habits.following[track, slot, k] = 0.0 if k == mode else probability


@summing
def expected_hazard(
    habits: Habits, track: int, slot: int, tables: Float32Array, row: int, column: int
) -> float:
    """Return the probability that a segment ends after its present tick, by the beliefs when it
    began.

    row, column: of the tables, see `beam_filters.BeamModel`.
    """
    total = np.float32(0.0)
    ends = np.float32(0.0)
    for law in range(tables.shape[3]):
        total += habits.beliefs[track, slot, law] * tables[row, column, 0, law]
        ends += habits.beliefs[track, slot, law] * tables[row, column, 1, law]
    return min(float(ends / total), 1.0) if total > 0.0 else 1.0


@summing
def _sums(
    laws: Float32Array,
    track: int,
    slot: int,
    kind: int,
    tables: Float32Array,
    row: int,
    column: int,
) -> tuple[np.float32, np.float32, np.float32]:
    """Return sums over the laws: of row 0, "same", times the probability of the end, of row `kind`
    times it, of `kind` alone.
    """
    total = np.float32(0.0)
    part = np.float32(0.0)
    before = np.float32(0.0)
    for law in range(laws.shape[3]):
        total += laws[track, slot, 0, law] * tables[row, column, 1, law]
        part += laws[track, slot, kind, law] * tables[row, column, 1, law]
        before += laws[track, slot, kind, law]
    return total, part, before


@internal
def _add_posterior(
    laws: Float32Array, track: int, slot: int, history: Any, weight: float, tables: Float32Array
) -> None:
    """Add to the laws of a slot those of a history after the end of its segment, times a weight.

    Arrays are indexed and not sliced: numba counts references to slices.
    """
    parent = history.slot
    row = history.row
    column = min(history.age, tables.shape[1]) - 1
    kind = 2 if history.mode > 0 else 1
    other = 3 - kind
    joint, apart, before = _sums(laws, track, parent, kind, tables, row, column)
    if joint + apart <= 0.0:
        laws[track, slot] += np.float32(weight) * laws[track, parent]
        return
    scale = np.float32(weight / (joint + apart))
    share = scale * apart / before if before > 0.0 else np.float32(0.0)
    for law in range(laws.shape[3]):
        ended = scale * tables[row, column, 1, law]
        laws[track, slot, 0, law] += ended * laws[track, parent, 0, law]
        laws[track, slot, kind, law] += ended * laws[track, parent, kind, law]
        laws[track, slot, other, law] += share * laws[track, parent, other, law]


@internal
def free_slots(histories: AnyArray, habits: Habits) -> IntArray:
    """Return M slots of a track that none of its branches uses."""
    taken = np.zeros(habits.laws.shape[1], np.bool_)
    for k in range(histories.size):
        taken[histories[k].slot] = True
    return np.flatnonzero(~taken)[: habits.orders.shape[2]]


@internal
def merge_habits(
    habits: Habits,
    track: int,
    slot: int,
    mode: int,
    weights: FloatArray,
    parents: AnyArray,
    tables: Float32Array,
) -> None:
    """Write the habits of a branch that begins with a switch to a mode: the mixture of its
    parents, records `beam_filters.HISTORY`.
    """
    laws = habits.laws[track, slot]
    orders = habits.orders[track, slot]
    laws[:] = np.float32(0.0)
    orders[:] = np.float32(0.0)
    # Habits of less probable parents are left out of the mixture.
    least = 1e-3 * weights.max()
    total = 0.0
    habitual = 0.0
    for b in range(weights.size):
        if weights[b] > least:
            total += weights[b]
    for b in range(weights.size):
        if weights[b] > least:
            share = weights[b] / total
            parent = parents[b]
            _add_posterior(habits.laws, track, slot, parent, share, tables)
            by_chance = (1.0 - habits.habitual[track, parent.slot]) / (orders.shape[0] - 1)
            habitual += share * (1.0 - by_chance / habits.following[track, parent.slot, mode])
            for row in range(orders.shape[0]):
                for column in range(orders.shape[0]):
                    orders[row, column] += (
                        np.float32(share) * habits.orders[track, parent.slot, row, column]
                    )
            orders[parent.mode, mode] += np.float32(share)
    for row in range(3):
        for law in range(laws.shape[1]):
            laws[row, law] *= np.float32(laws[row, law] > SMALLEST_BELIEF)
    habits.habitual[track, slot] = habitual
    _begin_segment(habits, track, slot, mode)
