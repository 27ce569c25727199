"""The posterior of a semi-Markov mode over histories of switches, with pruning; compiled code.

A branch is one history: the present mode, the age of its segment, and an anchor-aware filter
(`hybrid_env.core.banks.anchor_aware`) that started from the estimate of the branch at its last
switch. At every tick a branch continues or switches to one of the other modes, with the
probabilities that the law of the durations gives for its age. Every continuation predicts, is
weighted by the likelihood of the measurement, and the most probable ones are kept.

The continuations that switch at one tick to one mode have nearly the same estimate. They are merged
into one branch, whose filter starts from the mean and the covariance of their mixture: a branch is
a pair of mode and age. In short recordings only those merge that agree in the segments before. A
branch may also carry what its history says about the law of the durations and of the next mode; see
`beam_habits`.
"""

import math
from typing import NamedTuple

import numpy as np

from baselines.rules.beam_habits import (
    Habits,
    begin_habits,
    expected_hazard,
    free_slots,
    merge_habits,
)
from baselines.rules.beam_joining import join_branches
from baselines.rules.measurements import copy_filter, estimate_in
from hybrid_env.checks import AnyArray, Float32Array, FloatArray, IntArray
from hybrid_env.compiled import (
    AWARE_HYPOTHESIS,
    INNOVATION,
    LANES,
    MEASURED,
    FilterModel,
    State,
    Triangle4,
    aligned_zeros,
    begin_motion,
    compiled,
    covariance_of,
    estimate_of,
    internal,
    step_motion,
    write_measured,
)

# Rows of the table of hazards: the first segment of an episode, later ones.
FIRST, LATER = 0, 1
# In place of the probability that every segment ends after a tick, where the law says it.
BY_LAW = -1.0
# Probability of a branch at a tick below which it is no node of a lattice, see `lattice`.
SMALLEST = 1e-7
# Segments of a history that may be told apart from those of another one when both end.
DEPTH = 3
# A branch: its present mode, ticks of the present segment so far, 1 at its first measurement,
# `FIRST` or `LATER`, the index of its habits in `habits`, the probability that its segment would
# end at its last tick, 0 of a new one, its group, see `_group`, that of its parents at its begin,
# and its last segments, the present one first: tick of the begin times M, plus the mode; -1 of one
# in which its parents differ.
HISTORY = np.dtype(
    [
        ("mode", np.int64),
        ("age", np.int64),
        ("row", np.int64),
        ("slot", np.int64),
        ("hazard", np.float64),
        ("group", np.int64),
        ("parents", np.int64),
        ("segments", np.int64, (DEPTH,)),
    ]
)


class Branches(NamedTuple):
    """The branches of N tracks, at most B for each; branch b is lane b % LANES of group b //
    LANES.
    """

    # (N, B / LANES) records `AWARE_HYPOTHESIS`; `log_likelihood` is the log weight of the branch.
    filters: AnyArray
    # (N, B) records `HISTORY`
    histories: AnyArray
    # (N,) number of branches.
    counts: IntArray
    # (N,) log-likelihood of all measurements so far.
    evidence: FloatArray
    # What the branches know of durations and order.
    habits: Habits


class BeamModel(NamedTuple):
    """What the branches assume.

    The first half of the rows of `hazards` is `FIRST`, the other one `LATER`, each by K laws; older
    segments have its last column. Rows of `tables` are `FIRST` and `LATER`, columns ages less 1:
    probabilities that a segment lasts to an age (0), and that it ends after it (1), by each law;
    older segments have the last column. A beam that learns the laws uses neither `hazards` nor
    `order`.
    """

    # (M,) records `memory.MOTION`
    motions: AnyArray
    # (2 K, ages) probability that a segment ends after each age, see above.
    hazards: FloatArray
    # (M,) law of each mode.
    law_places: IntArray
    # (M, M) probability of the next mode (column) by the present one. Without meaning if learned.
    order: FloatArray
    # (2, ages, 2, L) of the laws among which a beam learns, see above; L is 0 if not.
    tables: Float32Array
    # (3, L) of the laws, see `Habits`
    prior: FloatArray
    # Prior probability that the next modes are not equally likely, likewise.
    habitual: float
    # Model of the filters.
    filters: FilterModel
    # (k,) records `memory.SENSOR`
    sensors: AnyArray
    # Whether branches of a full beam become one, see `beam_joining`, or the least probable are
    # omitted.
    joined: bool
    # Largest number of last segments in which branches must agree to be merged, see `_group`.
    depth: int


def branch_arrays(tracks: int, branches: int, modes: int = 0, laws: int = 0) -> Branches:
    """Return `branches` empty branches for each track, rounded up to a multiple of LANES; they
    learn if there are `laws`.
    """
    groups = -(-branches // LANES)
    slots, modes = (groups * LANES + modes, modes) if laws else (0, 0)
    habits = Habits(
        np.zeros((tracks, slots, 3, laws), np.float32),
        np.zeros((tracks, slots, laws), np.float32),
        np.zeros((tracks, slots, modes, modes), np.float32),
        np.zeros((tracks, slots, modes)),
        np.zeros((tracks, slots), np.float32),
    )
    return Branches(
        aligned_zeros((tracks, groups), AWARE_HYPOTHESIS),
        np.zeros((tracks, groups * LANES), HISTORY),
        np.zeros(tracks, np.int64),
        np.zeros(tracks),
        habits,
    )


@internal
def begin_branch(
    branches: Branches,
    track: int,
    b: int,
    mode: int,
    row: int,
    slot: int,
    anchor: State,
    covariance: Triangle4,
    log_weight: float,
    model: BeamModel,
) -> None:
    """Begin branch b of a track with a segment of a mode, from an estimate and its covariance."""
    kalman = branches.filters[track, b // LANES]
    lane = b % LANES
    begin_motion(kalman, lane, anchor, covariance, model.motions[mode], model.filters)
    kalman.log_likelihood[lane] = log_weight
    history = branches.histories[track, b]
    history.mode = mode
    history.age = 1
    history.row = row
    history.slot = slot
    history.hazard = 0.0
    history.group = 0
    history.parents = 0
    history.segments[:] = -1
    history.segments[0] = mode


@compiled
def begin_branches(branches: Branches, track: int, start: FloatArray, model: BeamModel) -> None:
    """Replace the branches of a track by one of every mode; `start` as in
    `MeasurementDecider.begin_track`.
    """
    modes = model.motions.size
    anchor, covariance = estimate_in(start)
    for mode in range(modes):
        weight = start[14 + mode]
        begin_branch(branches, track, mode, mode, FIRST, mode, anchor, covariance, weight, model)
    branches.counts[track] = modes
    branches.evidence[track] = 0.0
    if model.prior.size > 0:
        begin_habits(branches.habits, track, modes, model.prior, model.habitual)


@internal
def _copy_branch(
    source: Branches, source_track: int, b: int, target: Branches, track: int, c: int
) -> None:
    """Copy branch b of a track to branch c of another."""
    old = source.filters[source_track, b // LANES]
    copy_filter(old, b % LANES, target.filters[track, c // LANES], c % LANES)
    target.histories[track, c] = source.histories[source_track, b]


@internal
def _moments_of(branches: Branches, track: int) -> FloatArray:
    """Return estimates and covariances of the branches of a track, (branches, 14), as in
    `estimate_in`.
    """
    moments = np.empty((branches.counts[track], 14))
    filters = branches.filters[track]
    for b in range(moments.shape[0]):
        for k, value in enumerate(estimate_of(filters, b // LANES, b % LANES)):
            moments[b, k] = value
        for k, value in enumerate(covariance_of(filters[b // LANES], b % LANES)):
            moments[b, 4 + k] = value
    return moments


@internal
def _mixture_of(moments: FloatArray, shares: FloatArray, total: float) -> tuple[State, Triangle4]:
    """Return mean and covariance of branches, whose moments are those of `_moments_of`, weighted by
    shares (branches,) of a total.
    """
    mixed = np.zeros(14)
    difference = np.empty(4)
    for b in range(shares.size):
        if shares[b] > 0.0:
            share = shares[b] / total
            for k in range(4):
                mixed[k] += share * moments[b, k]
    for b in range(shares.size):
        if shares[b] > 0.0:
            share = shares[b] / total
            for k in range(4):
                difference[k] = moments[b, k] - mixed[k]
            k = 4
            for row in range(4):
                for column in range(row, 4):
                    mixed[k] += share * (moments[b, k] + difference[row] * difference[column])
                    k += 1
    return estimate_in(mixed)


@internal
def _agreement(one: IntArray, other: IntArray) -> int:
    """Return how many first numbers of two arrays are the same."""
    k = 0
    while k < one.size and one[k] == other[k]:
        k += 1
    return k


@internal
def groups_of(capacity: int, model: BeamModel) -> int:
    """Return the largest number of groups among `capacity` branches, see `_group`."""
    return max(1, capacity // model.motions.size) if model.depth > 0 else 1


@internal
def _group(branches: Branches, track: int, model: BeamModel) -> None:
    """Write the group of every branch of a track: segments begin from the mixture of a group.

    The branches of a group agree in their last segments, in as many of `model.depth` as leave room
    for all segments that begin.
    """
    histories = branches.histories[track]
    count = branches.counts[track]
    firsts = np.empty(groups_of(histories.size, model), np.int64)
    for depth in range(model.depth, -1, -1):
        groups = 0
        for b in range(count):
            group = 0
            segments = histories[b].segments
            while (
                group < groups and _agreement(segments, histories[firsts[group]].segments) < depth
            ):
                group += 1
            if group == firsts.size:
                groups += 1
                break
            if group == groups:
                firsts[group] = b
                groups += 1
            histories[b].group = group
        if groups <= firsts.size:
            break


@internal
def _switch(
    branches: Branches,
    track: int,
    weights: FloatArray,
    children: Branches,
    count: int,
    free: IntArray,
    all_shares: FloatArray,
    tick: int,
    model: BeamModel,
) -> int:
    """Write one child for every mode and group of parents, after `count` others: the mixture of
    parents in other modes. Return their number.

    weights: (branches,) probability of a branch and its end; free: (M,) slots for the habits of the
    children; all_shares: (M, branches) is written: probabilities of each child and its parent.
    """
    learns = model.prior.size > 0
    modes = model.motions.size
    histories = branches.histories[track]
    shares = np.zeros(weights.size)
    moments = _moments_of(branches, track)
    for mode in range(modes):
        groups = 0
        for b in range(weights.size):
            history = histories[b]
            groups = max(groups, history.group + 1)
            if weights[b] == 0.0:
                continue
            probability = model.order[history.mode, mode]
            if learns:
                probability = branches.habits.following[track, history.slot, mode]
            all_shares[mode, b] = weights[b] * probability
        for group in range(groups):
            largest = 0.0
            for b in range(weights.size):
                shares[b] = all_shares[mode, b] if histories[b].group == group else 0.0
                largest = max(largest, shares[b])
            if largest == 0.0:
                continue
            total = 0.0
            parent = -1
            agreed = DEPTH
            for b in range(weights.size):
                # Less probable parents are left out of the mixture.
                if shares[b] <= 1e-9 * largest:
                    shares[b] = 0.0
                    continue
                total += shares[b]
                parent = b if parent < 0 else parent
                same = _agreement(histories[b].segments, histories[parent].segments)
                agreed = min(agreed, same)
            anchor, covariance = _mixture_of(moments, shares, total)
            slot = free[mode] if learns else 0
            weight = math.log(total)
            begin_branch(children, 0, count, mode, LATER, slot, anchor, covariance, weight, model)
            history = children.histories[0, count]
            history.parents = group
            history.segments[0] = tick * modes + mode
            for k in range(min(agreed, DEPTH - 1)):
                history.segments[1 + k] = histories[parent].segments[k]
            count += 1
    return count


@internal
def hazard_at(row: int, mode: int, age: int, ends: float, model: BeamModel) -> float:
    """Return the probability that a segment ends after an age; `ends` if that is not `BY_LAW`."""
    if ends != BY_LAW:
        return ends
    law = row * (model.hazards.shape[0] // 2) + model.law_places[mode]
    return model.hazards[law, min(age, model.hazards.shape[1]) - 1]


@internal
def _extend(
    branches: Branches, track: int, children: Branches, ends: float, tick: int, model: BeamModel
) -> tuple[int, FloatArray]:
    """Write the continuations of all branches of a track to `children`, (1, ...), oldest first
    if theirs are. ends: probability that a segment ends before the tick, or `BY_LAW`.

    Return their number, and the probabilities of each child that begins and its parent, (M,
    branches).
    """
    count = 0
    learns = model.prior.size > 0
    switches = np.zeros(branches.counts[track])
    for b in range(switches.size):
        history = branches.histories[track, b]
        if learns:
            column = min(history.age, model.tables.shape[1]) - 1
            hazard = expected_hazard(
                branches.habits, track, history.slot, model.tables, history.row, column
            )
        else:
            hazard = hazard_at(history.row, history.mode, history.age, ends, model)
        weight = branches.filters[track, b // LANES].log_likelihood[b % LANES]
        switches[b] = hazard * math.exp(weight)
        if hazard < 1.0:
            _copy_branch(branches, track, b, children, 0, count)
            children.histories[0, count].age += 1
            children.histories[0, count].hazard = hazard
            continues = weight + math.log1p(-hazard)
            children.filters[0, count // LANES].log_likelihood[count % LANES] = continues
            count += 1
    shares = np.zeros((model.motions.size, switches.size))
    free = np.empty(0, np.int64)
    if learns:
        free = free_slots(branches.histories[track, : switches.size], branches.habits)
    count = _switch(branches, track, switches, children, count, free, shares, tick, model)
    return count, shares


class WalkMemory(NamedTuple):
    """Temporary memory of a walk over branches."""

    # (1, ...) continuations of the branches of a track.
    children: Branches
    # (1,) record `INNOVATION`
    innovations: AnyArray
    # (1,) record `MEASURED`
    measured: AnyArray
    # (1,) record `AWARE_HYPOTHESIS`: filters that are not advanced with the others.
    apart: AnyArray


def walk_memory(branches: Branches, model: BeamModel) -> WalkMemory:
    """Return memory for a walk over branches."""
    modes = model.motions.size
    capacity = branches.histories.shape[1]
    return WalkMemory(
        branch_arrays(1, modes + (2 if model.depth else 1) * capacity),
        aligned_zeros((1,), INNOVATION),
        aligned_zeros((1,), MEASURED),
        aligned_zeros((1,), AWARE_HYPOTHESIS),
    )


class Walk(NamedTuple):
    """Ticks over which the branches of N tracks go, and what is kept of them.

    Of a beam that keeps nothing, `nodes`, `groups` and `weights` have no element.
    """

    # (T, N, 2) or (T, N, 9), see `sensing.write_measured`
    measurements: FloatArray
    # (T,) probability that every segment ends before a tick, or `BY_LAW`.
    ends: FloatArray
    # Number of the first of the ticks.
    first: int
    # (T, N, B) last segment of each branch, see `HISTORY`, times `groups_of`, plus the group of its
    # parents. The tick of its begin is counted from the present one.
    nodes: AnyArray
    # (T, N, B) groups of the branches.
    groups: AnyArray
    # (T, N, B) probabilities of the branches; 0 of none, and below `SMALLEST`.
    weights: Float32Array


@internal
def _advance(children: Branches, group: int, memory: WalkMemory, model: BeamModel) -> None:
    """Advance the filters of a group of branches by a tick.

    Straight motion and turns have the same filter, whose lanes are advanced together; those of
    linear modes are kept apart meanwhile, and advanced one by one.
    """
    kalman = children.filters[0, group]
    histories = children.histories[0, group * LANES : (group + 1) * LANES]
    apart, motions = memory.apart[0], model.motions
    innovation, measured = memory.innovations[0], memory.measured[0]
    for lane in range(LANES):
        if motions[histories[lane].mode].linear:
            copy_filter(kalman, lane, apart, lane)
    # With signed numbers the loop over lanes is no SIMD code.
    first, last = np.uint64(0), np.uint64(LANES)
    arguments = None, measured, model.sensors, model.filters
    step_motion(kalman, innovation, first, last, *arguments)
    for lane in range(LANES):
        motion = motions[histories[lane].mode]
        if motion.linear:
            copy_filter(apart, lane, kalman, lane)
            first = np.uint64(lane)
            others = motion, measured, model.sensors, model.filters
            step_motion(kalman, innovation, first, first + np.uint64(1), *others)


@compiled
def walk_branches(
    branches: Branches,
    memory: WalkMemory,
    walk: Walk,
    log_probability: FloatArray,
    model: BeamModel,
) -> None:
    """Advance the branches of all tracks tick by tick, and write the log probabilities of the modes
    at the last one, (N, M).
    """
    children, measured = memory.children, memory.measured
    capacity = branches.histories.shape[1]
    for each in range(walk.measurements.shape[0] * walk.measurements.shape[1]):
        track = each % walk.measurements.shape[1]
        tick = each // walk.measurements.shape[1]
        for lane in range(LANES):
            write_measured(measured[0], lane, walk.measurements[tick, track])
        number = walk.first + tick
        count, shares = _extend(branches, track, children, walk.ends[tick], number, model)
        weights = np.empty(count)
        for group in range((count + LANES - 1) // LANES):
            _advance(children, group, memory, model)
            kalman = children.filters[0, group]
            for c in range(group * LANES, min(count, (group + 1) * LANES)):
                weights[c] = -kalman.log_likelihood[c % LANES]
        if model.joined:
            order = join_branches(children.histories[0], weights, capacity)
        else:
            order = np.argsort(weights, kind="mergesort")
        kept = min(order.size, capacity)
        # The most probable branch has the smallest weight.
        smallest = weights[order[:kept]].min()
        # Far less probable ones are left out; one that explains less for a while may be right.
        while not model.joined and weights[order[kept - 1]] - smallest > 150.0:
            kept -= 1
        probabilities = np.exp(smallest - weights[order[:kept]])
        total = probabilities.sum()
        probabilities /= total
        shift = smallest - math.log(total)
        log_probability[track] = 0.0
        # Before their parents are overwritten.
        for k in range(kept if model.prior.size > 0 else 0):
            child = children.histories[0, order[k]]
            if child.age == 1:
                merge_habits(
                    branches.habits,
                    track,
                    child.slot,
                    child.mode,
                    shares[child.mode],
                    branches.histories[track],
                    model.tables,
                )
        for k in range(kept):
            c = order[k]
            _copy_branch(children, 0, c, branches, track, k)
            log_weight = shift - weights[c]
            branches.filters[track, k // LANES].log_likelihood[k % LANES] = log_weight
            log_probability[track, children.histories[0, c].mode] += probabilities[k]
        branches.counts[track] = kept
        branches.evidence[track] -= shift
        for mode in range(log_probability.shape[1]):
            log_probability[track, mode] = math.log(max(log_probability[track, mode], 1e-300))
        if model.depth > 0:
            _group(branches, track, model)
        for b in range(kept if walk.nodes.size > 0 else 0):
            history = branches.histories[track, b]
            begun = history.segments[0] - number * model.motions.size
            walk.nodes[tick, track, b] = begun * groups_of(capacity, model) + history.parents
            walk.groups[tick, track, b] = history.group
            likely = probabilities[b] > SMALLEST
            walk.weights[tick, track, b] = probabilities[b] if likely else 0.0
