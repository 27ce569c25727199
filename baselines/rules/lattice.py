"""The lattice of the beam: who began when, from whom; compiled code.

A node is a segment that may be: a mode, the tick at which it begins, and the group of its parents.
The beam of `beam_filters` walks over the nodes that are probable, and what is kept of each tick are
their weights. A node begins from the mixture of its parents, the nodes of a group that may have
ended before it, and the share of a parent in this mixture is its probability given that the node
began: later measurements say nothing more about it, because the filter of the node begins at the
mixture. With the weight w of parent j at tick k - 1, the probability h that its segment ends then,
and the probability q that the mode of node i follows its mode, the share is

    s_ij = w_j h_j q_ij / sum over all parents l of i of w_l h_l q_il

Backwards, from the weights at the last tick, every node hands its probability to its parents at the
tick of its begin. That is the smoother of a hidden semi-Markov model, Yu 2010, "Hidden semi-Markov
models", on nodes that merge as in the interacting multiple model smoother, Helmick, Blair & Hoffman
1995.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baselines.rules.beam_filters import (
    FIRST,
    LATER,
    BeamModel,
    Branches,
    Walk,
    begin_branch,
    branch_arrays,
    groups_of,
    hazard_at,
    walk_branches,
    walk_memory,
)
from baselines.rules.measurements import estimate_in
from hybrid_env.checks import AnyArray, Float32Array, FloatArray, IntArray
from hybrid_env.compiled import compiled, run_compiled


class Lattice(NamedTuple):
    """The nodes that are probable at T ticks, from the measurements up to each.

    Those of tick k are at `offsets[k]` up to `offsets[k + 1]`; the numbers of nodes are those of
    `beam_filters.Walk`, counted from the tick.
    """

    # Number of the first of the ticks.
    first: int
    # (T + 1,)
    offsets: IntArray
    # (n,)
    nodes: AnyArray
    # (n,) to which they belong when the next nodes begin; empty if there is one group.
    groups: AnyArray
    # (n,) probabilities; 0 of what is no node.
    weights: Float32Array
    # (T,) probability that a segment ends before a tick, or `BY_LAW`.
    ends: FloatArray
    # Largest number of groups.
    most: int
    # Log-likelihood of the measurements.
    evidence: float


@compiled
def _begin(branches: Branches, starts: FloatArray, model: BeamModel) -> None:
    """Begin a branch of every mode at every start, (k, 14), one tick before the first measurement:
    an estimate, and the upper triangle of its covariance.
    """
    modes = model.motions.size
    weight = -np.log(modes * len(starts))
    b = 0
    for k in range(len(starts)):
        anchor, covariance = estimate_in(starts[k])
        for mode in range(modes):
            begin_branch(branches, 0, b, mode, FIRST, 0, anchor, covariance, weight, model)
            branches.histories[0, b].age = 0
            b += 1
    branches.counts[0] = b
    branches.evidence[0] = 0.0


class LatticeWalk:
    """The forward pass over the lattice of a track.

    Args:
        starts: (k, 14) see `_begin`, all equally probable.
        model: without a prior of laws; its branches are the nodes of a tick.

    Attributes:
        ticks: number of those that were walked.
        most: largest number of groups.
    """

    def __init__(self, starts: FloatArray, model: BeamModel):
        modes = model.motions.size
        model = model._replace(branches=max(model.branches, modes * len(starts)))
        self.model = model
        self.branches = branch_arrays(1, model)
        self.memory = walk_memory()
        self.log_probability = np.zeros((1, modes))
        self.ticks = 0
        self.most = groups_of(model)
        run_compiled(_begin, self.branches, starts, model)

    def extend(
        self,
        measurements: FloatArray,
        ends: FloatArray,
        nodes: AnyArray,
        groups: AnyArray,
        weights: Float32Array,
    ) -> None:
        """Walk over further T measurements, and write what is probable at their ticks.

        Args:
            measurements: (T, 2) or (T, 9), see `sensing.write_measured`; NaN where there is none.
            ends: (T,) as of `Lattice`; that of the first tick of the track is 0.
            nodes: (T, 1, B) as `groups` and `weights` those of `beam_filters.Walk`, written.
            groups: see above.
            weights: see above.
        """
        weights[:] = 0.0
        walk = Walk(measurements[:, None], ends, self.ticks, nodes, groups, weights)
        arguments = self.memory, walk, self.log_probability, self.model
        run_compiled(walk_branches, self.branches, *arguments)
        self.ticks += len(measurements)

    def arrays(self, ticks: int) -> list[AnyArray]:
        """Return memory for nodes, groups and weights of some ticks, see `extend`."""
        shape = ticks, 1, self.model.branches
        return [np.zeros(shape, kind) for kind in (np.int32, np.uint16, np.float32)]

    def lattice(self, offsets: IntArray, arrays: Sequence[AnyArray], ends: FloatArray) -> Lattice:
        """Return the lattice of the last ticks.

        Args:
            offsets: (T + 1,) as of `Lattice`.
            arrays: nodes, groups and weights of all ticks, one after the other.
            ends: (T,) as of `Lattice`.
        """
        evidence = float(self.branches.evidence[0])
        nodes, groups, weights = arrays
        first = self.ticks - len(ends)
        return Lattice(first, offsets, nodes, groups, weights, ends, self.most, evidence)


def walk_lattice(
    measurements: FloatArray, starts: FloatArray, ends: FloatArray, model: BeamModel
) -> Lattice:
    """Walk over all measurements of a track; the arguments are those of `LatticeWalk`."""
    walk = LatticeWalk(starts, model)
    kept = [np.zeros(0, array.dtype) for array in walk.arrays(0)]
    offsets = np.zeros(len(ends) + 1, int)
    # That many ticks are walked at a time.
    block = 4096
    for first in range(0, len(ends), block):
        part = slice(first, first + block)
        arrays = walk.arrays(len(ends[part]))
        walk.extend(measurements[part], ends[part], *arrays)
        probable = arrays[-1] > 0.0
        offsets[1:][part] = kept[0].size + probable.sum((1, 2)).cumsum()
        if walk.most == 1:
            arrays[1] = arrays[1][:0]
        for array, values in zip(kept, arrays, strict=True):
            more = values[probable[: len(values)]]
            # In place, because those of a long recording are larger than all else.
            array.resize(array.size + more.size, refcheck=False)
            array[array.size - more.size :] = more
    return walk.lattice(offsets, kept, ends)


@compiled
def _smooth(
    first: int,
    offsets: IntArray,
    nodes: AnyArray,
    groups: AnyArray,
    weights: Float32Array,
    ends: FloatArray,
    most: int,
    probabilities: FloatArray,
    model: BeamModel,
) -> None:
    """Bring the weights of the last tick back to the first one.

    Args:
        first: as `offsets`, `nodes`, `groups`, `weights`, `ends` and `most` those of a `Lattice`.
        offsets: see above.
        nodes: see above.
        groups: see above.
        weights: see above.
        ends: see above.
        most: see above.
        probabilities: (T, M) of the modes given all measurements, written.
        model: of the beam.
    """
    ticks = offsets.size - 1
    modes = model.motions.size
    # Probability of each node that lives at the present tick, and begins in the ticks.
    kinds = modes * most
    alive = np.zeros(ticks * kinds)
    now = np.zeros(modes)
    total = 0.0
    for j in range(offsets[ticks - 1], offsets[ticks]):
        total += weights[j]
    for j in range(offsets[ticks - 1], offsets[ticks]):
        if weights[j] > 0.0:
            node = nodes[j] + (ticks - 1) * kinds
            if node >= 0:
                alive[node] += weights[j] / total
            now[nodes[j] // most % modes] += weights[j] / total
    for k in range(ticks - 1, -1, -1):
        # Sums of shares have errors of rounding.
        total = 0.0
        for mode in range(modes):
            total += max(now[mode], 0.0)
        for mode in range(modes):
            probabilities[k, mode] = max(now[mode], 0.0) / total
        if k == 0:
            break
        # Probability of each node and its end.
        endings = np.zeros(offsets[k] - offsets[k - 1])
        parents = np.zeros(endings.size, np.int64)
        for j in range(endings.size):
            weight = weights[offsets[k - 1] + j]
            if weight > 0.0:
                segment = nodes[offsets[k - 1] + j] // most
                parents[j] = segment % modes
                age = 1 - segment // modes
                row = FIRST if age == first + k else LATER
                endings[j] = weight * hazard_at(row, parents[j], age, ends[k], model)
        shares = np.empty(endings.size)
        for kind in range(kinds):
            begun = alive[k * kinds + kind]
            # So small a probability stays with its mode, and is not handed to the parents.
            if begun < 1e-12:
                continue
            mode = kind // most
            total = 0.0
            for j in range(shares.size):
                shares[j] = 0.0
                if most == 1 or groups[offsets[k - 1] + j] == kind % most:
                    shares[j] = endings[j] * model.order[parents[j], mode]
                total += shares[j]
            if total == 0.0:
                # Its parents were too improbable to be kept: it follows those that were.
                for j in range(shares.size):
                    shares[j] = weights[offsets[k - 1] + j]
                    total += shares[j]
            now[mode] -= begun
            for j in range(shares.size):
                if shares[j] > 0.0:
                    node = nodes[offsets[k - 1] + j] + (k - 1) * kinds
                    if node >= 0:
                        alive[node] += begun * shares[j] / total
                    now[node // most % modes] += begun * shares[j] / total


def smooth_lattice(lattice: Lattice, model: BeamModel) -> FloatArray:
    """Return the probabilities of the modes at every tick, (T, M), given all measurements."""
    probabilities = np.zeros((len(lattice.ends), model.motions.size))
    run_compiled(_smooth, *lattice[:-1], probabilities, model)
    return probabilities
