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
    """The branches of N tracks, see `BeamModel.branches`; branch b is lane b % LANES of group b //
    LANES.
    """

    # (N, lanes / LANES) records `AWARE_HYPOTHESIS`; `log_likelihood` is the log weight of the
    # branch.
    filters: AnyArray
    # (N, lanes) records `HISTORY`
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
    # Largest number of branches of a track that are kept at a tick.
    branches: int


def branch_arrays(tracks: int, model: BeamModel) -> Branches:
    """Return memory for the branches of some tracks, and for those that begin at a tick."""
    laws, modes = model.prior.shape[1], model.motions.size
    groups = -(-(model.branches + modes * groups_of(model)) // LANES)
    slots, modes = (model.branches + modes, modes) if laws else (0, 0)
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
def _mix(
    moments: FloatArray, weights: FloatArray, kinds: IntArray, totals: FloatArray, mixed: FloatArray
) -> None:
    """Write the moments of the mixture of each kind, (K, 14), and its weight, (K,).

    Args:
        moments: (n, 14) of what is mixed, as in `_moments_of`.
        weights: (n,) of each.
        kinds: (n,) of each.
        totals: (K,) see above, written.
        mixed: (K, 14) see above, written.
    """
    totals[:] = 0.0
    mixed[:] = 0.0
    shares = np.zeros(weights.size)
    difference = np.empty(4)
    for b in range(weights.size):
        totals[kinds[b]] += weights[b]
    for b in range(weights.size):
        kind = kinds[b]
        if weights[b] > 0.0:
            share = shares[b] = weights[b] / totals[kind]
            for k in range(4):
                mixed[kind, k] += share * moments[b, k]
    for b in range(weights.size):
        kind, share = kinds[b], shares[b]
        if share > 0.0:
            for k in range(4):
                difference[k] = moments[b, k] - mixed[kind, k]
            k = 4
            for row in range(4):
                for column in range(row, 4):
                    spread = moments[b, k] + difference[row] * difference[column]
                    mixed[kind, k] += share * spread
                    k += 1


@internal
def _agreement(one: IntArray, other: IntArray) -> int:
    """Return how many first numbers of two arrays are the same."""
    k = 0
    while k < one.size and one[k] == other[k]:
        k += 1
    return k


@internal
def groups_of(model: BeamModel) -> int:
    """Return the largest number of groups of the branches of a track, see `_group`."""
    return max(1, model.branches // model.motions.size) if model.depth > 0 else 1


@internal
def _group(branches: Branches, track: int, model: BeamModel) -> None:
    """Write the group of every branch of a track: segments begin from the mixture of a group.

    The branches of a group agree in their last segments, in as many of `model.depth` as leave room
    for all segments that begin.
    """
    histories = branches.histories[track]
    count = branches.counts[track]
    firsts = np.empty(groups_of(model), np.int64)
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
def _write_segments(
    histories: AnyArray, weights: FloatArray, new: int, group: int, model: BeamModel
) -> None:
    """Write the segments before that of a new branch in which its parents agree.

    Args:
        histories: (lanes,) of the branches.
        weights: (parents,) as of `_switch`.
        new: number of the branch.
        group: of its parents.
        model: of the beam.
    """
    shares = np.empty(weights.size)
    for b in range(weights.size):
        follows = model.order[histories[b].mode, histories[new].mode]
        shares[b] = weights[b] * follows if histories[b].group == group else 0.0
    parent = -1
    agreed = DEPTH - 1
    least = 1e-9 * shares.max()
    for b in range(shares.size):
        # Less probable parents do not count.
        if shares[b] > least:
            parent = b if parent < 0 else parent
            agreed = min(agreed, _agreement(histories[b].segments, histories[parent].segments))
    for k in range(agreed):
        histories[new].segments[1 + k] = histories[parent].segments[k]


@internal
def _switch(
    branches: Branches, track: int, weights: FloatArray, tick: int, model: BeamModel
) -> int:
    """Begin a branch for every mode and group of parents, after the others: at the mixture of
    parents in other modes. Return the number of all branches.

    weights: (parents,) probability of a branch and its end.
    """
    learns = model.prior.size > 0
    modes = model.motions.size
    histories = branches.histories[track]
    count = weights.size
    groups = 0
    for b in range(count):
        groups = max(groups, histories[b].group + 1)
    moments = _moments_of(branches, track)
    free = np.empty(0, np.int64)
    # What a branch has learned says which mode follows; otherwise its mode does, and all branches
    # of a group and a mode are mixed before.
    if learns:
        free = free_slots(histories[:count], branches.habits)
        totals = weights
    else:
        kinds = np.empty(count, np.int64)
        for b in range(count):
            kinds[b] = histories[b].group * modes + histories[b].mode
        totals, parts = np.empty(groups * modes), np.empty((groups * modes, 14))
        _mix(moments, weights, kinds, totals, parts)
        moments = parts
    # What each group consists of.
    size = totals.size // groups
    shares = np.empty(size)
    together = np.zeros(size, np.int64)
    total, mixed = np.empty(1), np.empty((1, 14))
    for mode in range(modes):
        for group in range(groups):
            first = group * size
            for k in range(size):
                if learns:
                    follows = branches.habits.following[track, histories[k].slot, mode]
                else:
                    follows = model.order[k, mode]
                shares[k] = totals[first + k] * follows
            _mix(moments[first : first + size], shares, together, total, mixed)
            if total[0] == 0.0:
                continue
            anchor, covariance = estimate_in(mixed[0])
            slot = free[mode] if learns else 0
            begun = LATER, slot, anchor, covariance, math.log(total[0])
            begin_branch(branches, track, count, mode, *begun, model)
            histories[count].parents = group
            histories[count].segments[0] = tick * modes + mode
            if model.depth > 0:
                _write_segments(histories, weights, count, group, model)
            if learns:
                merge_habits(branches.habits, track, slot, mode, shares, histories, model.tables)
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
def _extend(branches: Branches, track: int, ends: float, tick: int, model: BeamModel) -> int:
    """Let all branches of a track continue, and begin those that follow them. Return the number of
    both. ends: probability that a segment ends before the tick, or `BY_LAW`.
    """
    learns = model.prior.size > 0
    switches = np.empty(branches.counts[track])
    filters, histories = branches.filters[track], branches.histories[track]
    for b in range(switches.size):
        history = histories[b]
        if learns:
            column = min(history.age, model.tables.shape[1]) - 1
            arguments = branches.habits, track, history.slot, model.tables, history.row, column
            history.hazard = expected_hazard(*arguments)
        else:
            history.hazard = hazard_at(history.row, history.mode, history.age, ends, model)
        weight = filters[b // LANES].log_likelihood[b % LANES]
        switches[b] = history.hazard * math.exp(weight)
    count = _switch(branches, track, switches, tick, model)
    for b in range(switches.size):
        history = histories[b]
        history.age += 1
        continues = math.log1p(-history.hazard) if history.hazard < 1.0 else -np.inf
        filters[b // LANES].log_likelihood[b % LANES] += continues
    return count


class WalkMemory(NamedTuple):
    """Temporary memory of a walk over branches."""

    # (1,) record `INNOVATION`
    innovations: AnyArray
    # (1,) record `MEASURED`
    measured: AnyArray
    # (1,) record `AWARE_HYPOTHESIS`: filters that are not advanced with the others.
    apart: AnyArray


def walk_memory() -> WalkMemory:
    """Return memory for a walk over branches."""
    return WalkMemory(
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
    # (T, N, B) probabilities of the branches; 0 of none, and of those below 1e-7.
    weights: Float32Array


@internal
def _advance(
    filters: AnyArray, histories: AnyArray, count: int, memory: WalkMemory, model: BeamModel
) -> FloatArray:
    """Advance the filters of a track by a tick, and return the negative logarithms of the weights
    of its `count` branches.

    Straight motion and turns have the same filter, and those of a group are advanced together;
    those of linear modes are kept apart meanwhile, and advanced one by one.
    """
    apart, motions = memory.apart[0], model.motions
    innovation, measured = memory.innovations[0], memory.measured[0]
    weights = np.empty(count)
    for group in range((count + LANES - 1) // LANES):
        kalman = filters[group]
        start = group * LANES
        for lane in range(LANES):
            if motions[histories[start + lane].mode].linear:
                copy_filter(kalman, lane, apart, lane)
        # With signed numbers the loop over lanes is no SIMD code.
        first, last = np.uint64(0), np.uint64(LANES)
        arguments = None, measured, model.sensors, model.filters
        step_motion(kalman, innovation, first, last, *arguments)
        for lane in range(LANES):
            motion = motions[histories[start + lane].mode]
            if motion.linear:
                copy_filter(apart, lane, kalman, lane)
                first = np.uint64(lane)
                others = motion, measured, model.sensors, model.filters
                step_motion(kalman, innovation, first, first + np.uint64(1), *others)
        for lane in range(min(LANES, count - start)):
            weights[start + lane] = -kalman.log_likelihood[lane]
    return weights


@internal
def _select(branches: Branches, track: int, weights: FloatArray, model: BeamModel) -> FloatArray:
    """Keep the most probable branches of a track, or join some of a full beam, and leave out far
    less probable ones; return their weights.

    weights: (n,) negative logarithms of the probabilities of its branches, changed.
    """
    if model.joined:
        join_branches(branches.histories[track], weights, model.branches)
    # One that explains less for a while may be right.
    largest = weights.min() + 150.0
    kept = weights.size
    b = 0
    while b < kept:
        if weights[b] <= largest:
            b += 1
        else:
            kept -= 1
            _move_last(branches, track, weights, kept, b)
    while kept > model.branches:
        kept -= 1
        _move_last(branches, track, weights, kept, weights[: kept + 1].argmax())
    return weights[:kept]


@internal
def _move_last(branches: Branches, track: int, weights: FloatArray, last: int, b: int) -> None:
    """Put the last branch of a track, and its weight, in the place of branch b."""
    weights[b] = weights[last]
    filters, histories = branches.filters[track], branches.histories[track]
    copy_filter(filters[last // LANES], last % LANES, filters[b // LANES], b % LANES)
    histories[b] = histories[last]


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
    measured = memory.measured
    for each in range(walk.measurements.shape[0] * walk.measurements.shape[1]):
        track = each % walk.measurements.shape[1]
        tick = each // walk.measurements.shape[1]
        filters, histories = branches.filters[track], branches.histories[track]
        for lane in range(LANES):
            write_measured(measured[0], lane, walk.measurements[tick, track])
        number = walk.first + tick
        count = _extend(branches, track, walk.ends[tick], number, model)
        weights = _advance(filters, histories, count, memory, model)
        weights = _select(branches, track, weights, model)
        # The most probable branch has the smallest weight.
        smallest = weights.min()
        probabilities = np.exp(smallest - weights)
        total = probabilities.sum()
        probabilities /= total
        shift = smallest - math.log(total)
        log_probability[track] = 0.0
        for b in range(weights.size):
            filters[b // LANES].log_likelihood[b % LANES] = shift - weights[b]
            log_probability[track, histories[b].mode] += probabilities[b]
        branches.counts[track] = weights.size
        branches.evidence[track] -= shift
        for mode in range(log_probability.shape[1]):
            log_probability[track, mode] = math.log(max(log_probability[track, mode], 1e-300))
        if model.depth > 0:
            _group(branches, track, model)
        for b in range(weights.size if walk.nodes.size > 0 else 0):
            history = histories[b]
            begun = history.segments[0] - number * model.motions.size
            walk.nodes[tick, track, b] = begun * groups_of(model) + history.parents
            walk.groups[tick, track, b] = history.group
            # Others are no nodes of a lattice, see `lattice`.
            likely = probabilities[b] > 1e-7
            walk.weights[tick, track, b] = probabilities[b] if likely else 0.0
