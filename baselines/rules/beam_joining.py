"""Which branches of a full beam become one; compiled code.

Switches to one mode at neighbouring ticks have nearly the same filters, and a beam that omits the
least probable of them loses the probability of all switches that are young. Joined branches keep
it: the more probable one of two takes the probability of the other, as in the reduction of mixtures
(Runnalls 2007), with a cost that needs ages only.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.checks import FloatArray
from hybrid_env.compiled import internal


@internal
def join_branches(histories: Any, weights: FloatArray, capacity: int) -> None:
    """Write the weights of the branches that remain, and infinite ones for all others.

    Of two branches of one mode and row, neighbours in age, joining costs the harmonic sum of their
    probabilities times the logarithm of the ratio of their ages; omitting a branch costs its
    probability. The cheapest is done until `capacity` branches are left.

    Args:
        histories: (B,) of the branches, see `beam_filters.Branches`.
        weights: (n,) negative logarithms of their probabilities, n of at most B branches; those
            with infinite ones do not remain.
        capacity: largest number that remains.
    """
    smallest = weights.min()
    shares = np.exp(smallest - weights)
    # Three ticks are added to the ages: the youngest are nearly the same.
    reach = np.log(histories.age[: weights.size] + 3.0)
    # Oldest first.
    kept = np.argsort(-histories.age[: weights.size], kind="mergesort")
    kept = kept[weights[kept] < np.inf]
    left = kept.size
    # Place of the last branch of each mode and row.
    last = np.empty(2 * histories.mode.max() + 2, np.int64)
    while left > capacity:
        last[:] = -1
        least = np.inf
        goes = -1
        takes = -1
        for k in range(left):
            b = kept[k]
            kind = 2 * histories[b].mode + histories[b].row
            before = last[kind]
            last[kind] = k
            if shares[b] < least:
                least = shares[b]
                goes = k
                takes = -1
            if before >= 0:
                older = kept[before]
                both = shares[b] + shares[older]
                cost = (
                    shares[b] * shares[older] / both * (reach[older] - reach[b])
                    if both > 0.0
                    else 0.0
                )
                if cost < least:
                    least = cost
                    goes, takes = (before, k) if shares[b] >= shares[older] else (k, before)
        if takes >= 0:
            shares[kept[takes]] += shares[kept[goes]]
        for k in range(goes, left - 1):
            kept[k] = kept[k + 1]
        left -= 1
    weights[:] = np.inf
    for k in range(left):
        weights[kept[k]] = smallest - math.log(max(shares[kept[k]], 1e-300))
