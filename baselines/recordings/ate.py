"""Adaptive trajectory estimation (ATE) on recorded measurements. Golubkov 2018, algorithm 1;
Tsyganov 2019.

At every switch the bank starts from the current estimate with P := I. Until the decision, the
output is the estimate of the last decided mode; after it, only the chosen filter runs on. Tsyganov
2019 adds a recalculation of the estimates since the switch by the chosen filter. `sprt.SPRTDecider`
is the same test in the environment.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from baselines.recordings.start import line_weights
from baselines.rules.measurements import run_compiled
from baselines.rules.sprt import sprt_test, sprt_thresholds
from hybrid_env.checks import (
    BoolArray,
    FloatArray,
    IntArray,
    check_array,
    check_choice,
    check_integer,
    checked,
    dimensions,
    reject,
)
from hybrid_env.compiled import (
    IDENTITY,
    LANES,
    FilterModel,
    PublishedBank,
    bank_arrays,
    compiled,
    estimate_of,
    internal,
    likeliest,
    likeliest_of_type,
    operations,
    set_estimate,
)
from hybrid_env.limits import Quantity, QuantityOrZero, axis_variances, distinct_radii


class Tracks(NamedTuple):
    """Results of ATE for n runs of T ticks, K segments and M hypotheses. A single run has no
    first axis.

    Attributes:
        estimates: (n, T, 4) estimates [x, vx, y, vy] [m, m/s]. Without recalculation, those up to
            and including the tick of the decision are estimates of the previous mode.
        covariances: (n, T, 2, 3) P_XX, P_XV, P_VV of (position, velocity) on each axis.
        modes: (n, T) hypothesis whose filter provides the estimate.
        decided: (n, K) decided mode of each segment.
        ticks: (n, K) decision time since the switch [ticks]; the segment length if undecided.
        undecided: (n, K) True if the segment ended without a decision.
        ratios: (n, T, M) log-likelihood ratios to the active hypothesis, NaN after the decision.
    """

    estimates: FloatArray
    covariances: FloatArray
    modes: IntArray
    decided: IntArray
    ticks: IntArray
    undecided: BoolArray
    ratios: FloatArray


class Rule(NamedTuple):
    """Thresholds and options of the algorithm, see `track_ate`."""

    upper: float
    lower: float
    straight_reference: bool
    keep: bool
    # Index into `RECALCULATIONS`.
    recalculation: int
    refine: bool


# What is restored before the recalculation: nothing is recalculated, the estimate of the decided
# filter, all of all filters, and nothing.
RECALCULATIONS = ("none", "as_published", "rewind", "literal")


@internal
def _write_tick(bank: PublishedBank, mode: int, k: int, output: Tracks) -> None:
    for j, value in enumerate(estimate_of(bank.hypotheses, mode, 0)):
        output.estimates[k, j] = value
    for j, value in enumerate(operations.covariance(bank, mode, 0)):
        output.covariances[k, j] = value
    output.modes[k] = mode


@internal
def _follow(bank: PublishedBank, mode: int, measurement: FloatArray, model: FilterModel) -> None:
    """Advance the filter of one hypothesis, without its log-likelihood."""
    before = bank.hypotheses[mode].log_likelihood[0]
    operations.step(bank, mode, mode + 1, 0, 1, measurement, model)
    bank.hypotheses[mode].log_likelihood[0] = before


@compiled
def _track_run(
    measurements: FloatArray,
    lengths: IntArray,
    start: FloatArray,
    bank: PublishedBank,
    radii: FloatArray,
    model: FilterModel,
    rule: Rule,
    output: Tracks,
) -> None:
    """Apply ATE to one run in the first lane of a bank. Golubkov 2018, algorithm 1. Covariances
    are upper triangles, (T, 10).
    """
    anchor = (start[0], start[1], start[2], start[3])
    measurement = np.zeros((2, LANES))
    log_likelihood = np.empty(bank.hypotheses.size)
    # Straight, left, right.
    types = np.zeros(log_likelihood.size, np.int64)
    types[1 : radii.size + 1] = 1
    types[radii.size + 1 :] = 2
    output.ratios[:] = np.nan
    active = 0
    k = 0
    for segment in range(lengths.size):
        if rule.straight_reference:
            active = 0
        operations.begin(bank, 0, anchor, IDENTITY, radii, model)
        running = np.ones(log_likelihood.size, np.bool_)
        begin = k
        end = k + lengths[segment]
        output.ticks[segment] = lengths[segment]
        output.undecided[segment] = True
        while k < end and output.undecided[segment]:
            measurement[:, 0] = measurements[k]
            operations.step(bank, 0, log_likelihood.size, 0, 1, measurement, model)
            _write_tick(bank, active, k, output)
            for h in range(log_likelihood.size):
                log_likelihood[h] = bank.hypotheses[h].log_likelihood[0]
            output.ratios[k] = log_likelihood - log_likelihood[active]
            winner = sprt_test(log_likelihood, running, active, rule.upper, rule.lower)
            k += 1
            if winner >= 0:
                active = winner
                output.undecided[segment] = False
                output.ticks[segment] = k - begin
        first = k
        if not output.undecided[segment] and rule.recalculation > 0:
            # From the switch again. Tsyganov 2019, lines 17 to 20.
            first = begin
            if rule.recalculation == 1:
                set_estimate(bank.hypotheses[active], 0, anchor)
            elif rule.recalculation == 2:
                operations.begin(bank, 0, anchor, IDENTITY, radii, model)
        if output.undecided[segment] and not rule.keep:
            active = likeliest(bank.hypotheses, 0)
        for j in range(first, end):
            measurement[:, 0] = measurements[j]
            # The radius may be refined among all filters, if these have gone back too.
            if (rule.refine and j >= k) or (rule.recalculation == 2 and j < k):
                operations.step(bank, 0, log_likelihood.size, 0, 1, measurement, model)
            else:
                _follow(bank, active, measurement, model)
            if rule.refine and j >= k:
                active = likeliest_of_type(bank.hypotheses, types, 0, types[active])
            _write_tick(bank, active, j, output)
        anchor = estimate_of(bank.hypotheses, active, 0)
        output.decided[segment] = active
        k = end


def track_ate(
    measurements: ArrayLike,
    lengths: Sequence[int] | IntArray,
    start: ArrayLike | None = None,
    *,
    radii: ArrayLike = (5.0,),
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
    alpha: float = 1e-3,
    beta: float | None = None,
    undecided: Literal["keep", "likeliest"] = "keep",
    recalculation: Literal["none", "as_published", "rewind", "literal"] = "none",
    reference: Literal["active", "straight"] = "active",
    refine_radius: bool = False,
) -> Tracks:
    """Estimate the trajectory of recorded positions with unknown modes and known switch times.

    Args:
        measurements: (T, 2) measured positions [m], or (n, T, 2) for n runs.
        lengths: (K,) segment lengths [ticks], with sum T.
        start: (4,) or (n, 4) estimate [x, vx, y, vy] one tick before the first measurement [m,
            m/s]; None uses `first_estimate`.
        radii: turn radii of the bank [m].
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        alpha: type I error probability of the test.
        beta: type II error probability of the test; None uses alpha.
        undecided: mode of a segment that ends without a decision: "keep" for the last decided mode,
            as published, "likeliest" for the most likely hypothesis.
        recalculation: whether the chosen filter recomputes the estimates from the switch to the
            decision (Tsyganov 2019, lines 16 to 21). "literal" restores nothing, as these lines are
            printed. "as_published", with which the published table comes out, restores the estimate
            at the switch but not its covariance; the data are therefore used twice. "rewind"
            restores both.
        reference: hypothesis in the denominator of the ratios: "active" for the last decided mode,
            as published, or always "straight".
        refine_radius: True runs all filters after the decision and uses the most likely hypothesis
            of the decided type; the published algorithm does not change the decided radius.
    """
    tau = checked("tau", tau, Quantity)
    single = dimensions(measurements) == 2
    values = check_array("measurements", measurements, (None, 2) if single else (None, None, 2))
    values = values[None] if single else values
    runs, total = values.shape[:2]
    ticks = [check_integer("lengths", length) for length in lengths]
    # Of Python's integers, which cannot overflow.
    if sum(ticks) != total:
        raise reject("lengths", ticks, f"lengths whose sum is {total}, the number of measurements")
    segment_lengths = np.array(ticks, np.int64)
    if start is None:
        starts = first_estimate(values, tau)
    else:
        starts = check_array("start", start, (4,) if dimensions(start) == 1 else (runs, 4))
        starts = np.broadcast_to(starts, (runs, 4))
    bank_radii = np.array(distinct_radii(radii))
    variances = axis_variances(measurement_variance)
    process_variance = checked("process_variance", process_variance, QuantityOrZero)
    model = FilterModel(tau, process_variance, float(variances[0]), float(variances[-1]))
    bank = bank_arrays(PublishedBank, bank_radii.size, variances.size)
    rule = Rule(
        *sprt_thresholds(alpha, beta),
        check_choice("reference", reference, ("active", "straight")) == "straight",
        check_choice("undecided", undecided, ("keep", "likeliest")) == "keep",
        RECALCULATIONS.index(check_choice("recalculation", recalculation, RECALCULATIONS)),
        checked("refine_radius", refine_radius, bool),
    )
    shape = (runs, total)
    segments = (runs, segment_lengths.size)
    tracks = Tracks(
        np.empty((*shape, 4)),
        np.empty((*shape, 10)),
        np.empty(shape, np.int64),
        np.empty(segments, np.int64),
        np.empty(segments, np.int64),
        np.empty(segments, np.bool_),
        np.empty((*shape, bank.hypotheses.size)),
    )
    for run in range(runs):
        of_run = Tracks(*(array[run] for array in tracks))
        measured = values[run], segment_lengths, starts[run]
        run_compiled(_track_run, *measured, bank, bank_radii, model, rule, of_run)
    # Of each axis, from the upper triangles.
    tracks = tracks._replace(covariances=tracks.covariances[..., [[0, 1, 4], [7, 8, 9]]])
    return Tracks(*(array[0] for array in tracks)) if single else tracks


def first_estimate(measurements: FloatArray, tau: float) -> FloatArray:
    """Fit a straight line to the first ten measurements by least squares.

    Args:
        measurements: (n, T, 2) measured positions of n runs [m].
        tau: length of a tick [s].

    Returns:
        (n, 4) estimates [x, vx, y, vy] one tick before the first measurement [m, m/s].
    """
    used = measurements[:, :10]
    times = tau * np.arange(1, used.shape[1] + 1)
    # A single measurement has no velocity.
    weights = line_weights(times) if len(times) > 1 else np.array([[1.0], [0.0]])
    return (weights @ used).swapaxes(-1, -2).reshape(-1, 4)
