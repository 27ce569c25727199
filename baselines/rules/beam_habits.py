"""What a branch of the beam learns of an object's habits: durations and order of its segments; compiled code.

The law of the durations is one of L laws: one for all modes ("same"), or one for straight motion and another for turns,
independent of each other ("straight", "turns"). Given the history of a branch, these beliefs are exact by Bayes' rule:
a segment that ends multiplies the belief in each law by the probability of its duration. The filters of a branch do not
depend on the laws, so that all laws share them. The next modes are equally likely, or they have a Dirichlet prior,
whose posterior follows from counts. Branches that merge average their habits.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.core.compilation import internal, summing

Laws = NDArray[np.float32]  # (L,) of one number for each law

SAME = 0  # row of the beliefs in one law for all modes; rows 1 and 2 are straight motion and turns
NEGLIGIBLE = 1e-3  # probability of a parent whose habits are left out of a mixture
SMALLEST = np.float32(1e-30)  # beliefs below become 0: denormal numbers are slow
PSEUDO_COUNT = 0.5  # of each next mode, if they are not equally likely


class Habits(NamedTuple):
    """Habits of N tracks, S slots for each.

    Rows of `laws` are "same", "straight" and "turns". The last two have the same sum, the probability that they differ.
    """

    laws: NDArray[np.float32]  # (N, S, 3, L) joint probabilities of law and kind when the present segment began
    beliefs: NDArray[np.float32]  # (N, S, L) sum of the rows of `laws` that concern the present segment
    orders: NDArray[np.float32]  # (N, S, M, M) expected number of switches from a mode (row) to another
    following: FloatArray  # (N, S, M) probability that each mode follows the present segment
    habitual: NDArray[np.float32]  # (N, S) probability that the next modes are not equally likely


@internal
def begin_habits(habits: Habits, track: int, slots: int, prior: FloatArray, habitual: float) -> None:
    """Give the first slots of a track, one for each mode, the prior of the laws, (3, L), and of habits."""
    for slot in range(slots):
        habits.laws[track, slot] = prior
        habits.orders[track, slot] = 0.0
        habits.habitual[track, slot] = habitual
        _begin_segment(habits, track, slot, slot)


@internal
def _begin_segment(habits: Habits, track: int, slot: int, mode: int) -> None:
    """Write what concerns a segment of a mode: the beliefs, and the probabilities of the next modes."""
    laws, beliefs = habits.laws[track, slot], habits.beliefs[track, slot]
    same, own = laws[SAME], laws[2 if mode > 0 else 1]
    for law in range(beliefs.size):
        beliefs[law] = same[law] + own[law]
    counts, habitual = habits.orders[track, slot, mode], habits.habitual[track, slot]
    total, modes = 0.0, counts.size
    for k in range(modes):
        total += counts[k]
    for k in range(modes):
        counted = (counts[k] + PSEUDO_COUNT) / (total + PSEUDO_COUNT * (modes - 1))
        probability = habitual * counted + (1.0 - habitual) / (modes - 1)
        habits.following[track, slot, k] = 0.0 if k == mode else probability


@summing
def expected_hazard(beliefs: Laws, lasted: Laws, ended: Laws) -> float:
    """Return the probability that a segment ends after its present tick, given (L,) beliefs when it began.

    lasted, ended: (L,) probabilities that it lasts to this tick, and that it ends after it.
    """
    total, ends = np.float32(0.0), np.float32(0.0)
    for law in range(beliefs.size):
        total += beliefs[law] * lasted[law]
        ends += beliefs[law] * ended[law]
    return min(float(ends / total), 1.0) if total > 0.0 else 1.0


@summing
def _sums(
    same: NDArray[np.float32], own: NDArray[np.float32], ended: NDArray[np.float32]
) -> tuple[np.float32, np.float32, np.float32]:
    """Return the sums of same x ended, own x ended and own."""
    total, part, before = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for law in range(ended.size):
        total += same[law] * ended[law]
        part += own[law] * ended[law]
        before += own[law]
    return total, part, before


@internal
def _add_product(
    target: NDArray[np.float32], scale: np.float32, values: NDArray[np.float32], ended: NDArray[np.float32]
) -> None:
    for law in range(ended.size):
        target[law] += scale * values[law] * ended[law]


@internal
def _add_posterior(target: Laws, laws: Laws, weight: float, turns: int, ended: Laws) -> None:
    """Add the beliefs (3, L) after the end of a segment, times a weight; see `expected_hazard`.

    laws: when it began; turns: 1 if it was a turn.
    """
    same, own, before = _sums(laws[SAME], laws[1 + turns], ended)
    if same + own <= 0.0:
        target += np.float32(weight) * laws
        return
    scale = np.float32(weight / (same + own))
    _add_product(target[SAME], scale, laws[SAME], ended)
    _add_product(target[1 + turns], scale, laws[1 + turns], ended)
    if before > 0.0:
        goal, values, share = target[2 - turns], laws[2 - turns], scale * own / before
        for law in range(ended.size):
            goal[law] += share * values[law]


@internal
def free_slots(used: IntArray, habits: Habits) -> IntArray:
    """Return M slots of a track that none of its branches uses. used: those of its branches."""
    taken = np.zeros(habits.laws.shape[1], np.bool_)
    for k in range(used.size):
        taken[used[k]] = True
    return np.flatnonzero(~taken)[: habits.orders.shape[2]]


@internal
def merge_habits(
    habits: Habits, track: int, slot: int, mode: int, weights: FloatArray,
    slots: IntArray, modes: IntArray, rows: IntArray, ages: IntArray, tables: NDArray[np.float32],
) -> None:  # fmt: skip
    """Write the habits of a branch that begins with a switch to a mode: the mixture of its parents."""
    laws, orders = habits.laws[track, slot], habits.orders[track, slot]
    laws[:] = np.float32(0.0)
    orders[:] = np.float32(0.0)
    least, total, habitual = NEGLIGIBLE * weights.max(), 0.0, 0.0
    for b in range(weights.size):
        if weights[b] > least:
            total += weights[b]
    for b in range(weights.size):
        if weights[b] > least:
            share = weights[b] / total
            ended = tables[rows[b], min(ages[b], tables.shape[1]) - 1, 1]
            turns = 1 if modes[b] > 0 else 0
            _add_posterior(laws, habits.laws[track, slots[b]], share, turns, ended)
            by_chance = (1.0 - habits.habitual[track, slots[b]]) / (orders.shape[0] - 1)
            habitual += share * (1.0 - by_chance / habits.following[track, slots[b], mode])
            counts = habits.orders[track, slots[b]]
            for row in range(counts.shape[0]):
                for column in range(counts.shape[0]):
                    orders[row, column] += np.float32(share) * counts[row, column]
            orders[modes[b], mode] += np.float32(share)
    for row in range(3):
        values = laws[row]
        for law in range(values.size):
            values[law] = values[law] if values[law] > SMALLEST else np.float32(0.0)
    habits.habitual[track, slot] = habitual
    _begin_segment(habits, track, slot, mode)
