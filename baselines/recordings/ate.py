"""Adaptive trajectory estimation (ATE) on recorded measurements. Golubkov 2018, algorithm 1; Tsyganov 2019.

At every switch the bank starts at the current estimate with P := I; until the test decides, the output is
the old mode's estimate; then the chosen filter runs alone to the end of the piece. Tsyganov 2019 goes back
after a decision and computes the estimates of the piece so far with the chosen filter. The same test drives
`sprt.SPRTDecider` in the environment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.deciders.sprt import sprt_test, sprt_thresholds
from baselines.filters.recording import Filters, check_recording, make_filters, write_estimate
from hybrid_env.checks import check_choice, check_flag, check_positive, check_radii
from hybrid_env.core.compilation import compiled, internal
from hybrid_env.core.published_bank import (
    IDENTITY,
    PublishedBank,
    State,
    begin_published,
    follow_published,
    likeliest,
    mode_type,
    set_estimate,
    step_published,
)
from hybrid_env.core.records import LANES

FloatArray = NDArray[np.float64]

KEEP, AS_PUBLISHED, REWIND = 0, 1, 2
RECALCULATIONS = {"none": KEEP, "as_published": AS_PUBLISHED, "rewind": REWIND}


@dataclass(frozen=True)
class Tracks:
    """What ATE found, for n runs of T ticks in K pieces and M hypotheses; a single run has no first axis.

    Attributes:
        estimates: (n, T, 4) [x, vx, y, vy] [m, m/s]; at the tick of a decision still the old mode's.
        covariances: (n, T, 2, 3) of (position, velocity) on each axis: P_XX, P_XV, P_VV.
        modes: (n, T) mode whose filter gave the estimate, an index into the bank.
        decided: (n, K) mode of each piece.
        ticks: (n, K) decision tick within the piece, its length where none was made.
        undecided: (n, K) True where the piece ended without a decision.
        ratios: (n, T, M) log-likelihood ratio to the active mode, NaN after the decision.
    """

    estimates: FloatArray
    covariances: FloatArray
    modes: NDArray[np.int64]
    decided: NDArray[np.int64]
    ticks: NDArray[np.int64]
    undecided: NDArray[np.bool_]
    ratios: FloatArray


class _Rule(NamedTuple):
    """The test and what follows a decision; see `track`."""

    upper: float
    lower: float
    straight_reference: bool
    keep: bool
    recalculation: int
    refine: bool


class _Output(NamedTuple):
    """The arrays of `Tracks` for one run."""

    estimates: FloatArray
    covariances: FloatArray
    modes: NDArray[np.int64]
    decided: NDArray[np.int64]
    ticks: NDArray[np.int64]
    undecided: NDArray[np.bool_]
    ratios: FloatArray


@internal
def _likeliest_of_type(hypotheses: NDArray[Any], mode: int) -> int:
    n = hypotheses.size // 2
    best = mode
    for h in range(hypotheses.size):
        likelier = hypotheses[h].log_likelihood[0] > hypotheses[best].log_likelihood[0]
        if likelier and mode_type(h, n) == mode_type(mode, n):
            best = h
    return best


@internal
def _write_tick(bank: PublishedBank, mode: int, k: int, output: _Output) -> None:
    write_estimate(bank, mode, output.estimates[k], output.covariances[k])
    output.modes[k] = mode


@internal
def _recalculate(
    measurements: FloatArray,
    ticks: tuple[int, int],
    anchor: State,
    mode: int,
    filters: Filters,
    way: int,
    output: _Output,
) -> None:
    """Estimates of the piece up to the decision, by the decided filter. Tsyganov 2019, lines 17 to 20."""
    bank, radii, model = filters
    measurement = np.zeros((2, LANES))
    if way == AS_PUBLISHED:
        set_estimate(bank.hypotheses[mode], 0, anchor)
    else:
        begin_published(bank, 0, anchor, IDENTITY, radii, model)
    for k in range(ticks[0], ticks[1]):
        measurement[:, 0] = measurements[k]
        follow_published(bank, 0, mode, measurement, model)
        _write_tick(bank, mode, k, output)


@compiled
def _track_run(
    measurements: FloatArray,
    lengths: NDArray[np.int64],
    start: FloatArray,
    filters: Filters,
    rule: _Rule,
    output: _Output,
) -> None:
    bank, radii, model = filters
    estimate, covariance = start.copy(), np.empty((2, 3))
    measurement = np.zeros((2, LANES))
    log_likelihood = np.empty(bank.hypotheses.size)
    output.ratios[:] = np.nan
    active = 0
    k = 0
    for piece in range(lengths.size):
        if rule.straight_reference:
            active = 0
        x, vx, y, vy = estimate
        anchor = (x, vx, y, vy)
        begin_published(bank, 0, anchor, IDENTITY, radii, model)
        running = np.ones(log_likelihood.size, np.bool_)
        begin = k
        end = k + lengths[piece]
        output.ticks[piece] = lengths[piece]
        output.undecided[piece] = True
        while k < end and output.undecided[piece]:
            measurement[:, 0] = measurements[k]
            step_published(bank, 0, 1, measurement, model)
            _write_tick(bank, active, k, output)
            for h in range(log_likelihood.size):
                log_likelihood[h] = bank.hypotheses[h].log_likelihood[0]
            output.ratios[k] = log_likelihood - log_likelihood[active]
            winner = sprt_test(log_likelihood, running, active, rule.upper, rule.lower)
            k += 1
            if winner >= 0:
                active = winner
                output.undecided[piece] = False
                output.ticks[piece] = k - begin
        if output.undecided[piece] and not rule.keep:
            active = likeliest(bank.hypotheses, 0)
        if rule.recalculation != KEEP and not output.undecided[piece]:
            _recalculate(measurements, (begin, k), anchor, active, filters, rule.recalculation, output)
        for j in range(k, end):
            measurement[:, 0] = measurements[j]
            if rule.refine:
                step_published(bank, 0, 1, measurement, model)
                active = _likeliest_of_type(bank.hypotheses, active)
            else:
                follow_published(bank, 0, active, measurement, model)
            _write_tick(bank, active, j, output)
        write_estimate(bank, active, estimate, covariance)
        output.decided[piece] = active
        k = end


def track(
    measurements: ArrayLike,
    lengths: Sequence[int] | NDArray[np.int64],
    start: ArrayLike | None = None,
    *,
    radii: ArrayLike = (5.0,),
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float | ArrayLike = 0.1,
    alpha: float = 1e-3,
    beta: float | None = None,
    undecided: Literal["keep", "likeliest"] = "keep",
    recalculation: Literal["none", "as_published", "rewind"] = "none",
    reference: Literal["active", "straight"] = "active",
    refine_radius: bool = False,
) -> Tracks:
    """Follow recorded coordinates through pieces whose modes are unknown.

    Args:
        measurements: (T, 2) coordinates [m], or (n, T, 2) of n runs.
        lengths: (K,) ticks of the pieces; they add up to T.
        start: (4,) or (n, 4) estimate one tick before the first measurement, [x, vx, y, vy] [m, m/s];
            None takes `first_estimate`.
        radii: turn radii of the bank [m].
        tau: tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        alpha, beta: errors of the first and second kind; beta None takes alpha.
        undecided: a piece without a decision keeps the old mode, as published, or takes the likeliest.
        recalculation: of the estimates from the start of the piece to the decision, by the chosen filter
            (Tsyganov 2019, lines 16 to 21). "as_published" goes back to the piece's first state but not to
            its covariance: the print initialises no filter, so the data are used twice. "rewind" goes back
            to both.
        reference: hypothesis that the others are tested against: the mode decided last, as published, or
            always "straight".
        refine_radius: after the decision all turns of the decided side go on, and the likeliest of them is
            the active one; the published algorithm leaves the radius as decided.

    Returns:
        Estimates, modes and decisions; without the first axis for a single run.

    Raises:
        ArgumentError: names the argument, its value and what is allowed.
    """
    tau = check_positive("tau", tau)
    values, pieces, starts = check_recording(measurements, lengths, start, tau)
    runs, total = values.shape[:2]
    bank_radii = check_radii("radii", radii)
    filters = make_filters(bank_radii, tau, process_variance, measurement_variance)
    upper, lower = sprt_thresholds(alpha, beta)
    keep = check_choice("undecided", undecided, ("keep", "likeliest")) == "keep"
    straight = check_choice("reference", reference, ("active", "straight")) == "straight"
    way = RECALCULATIONS[check_choice("recalculation", recalculation, RECALCULATIONS)]
    refine = check_flag("refine_radius", refine_radius)

    rule = _Rule(upper, lower, straight, keep, way, refine)
    found: dict[str, Any] = {
        "estimates": np.empty((runs, total, 4)),
        "covariances": np.empty((runs, total, 2, 3)),
        "modes": np.empty((runs, total), np.int64),
        "decided": np.empty((runs, pieces.size), np.int64),
        "ticks": np.empty((runs, pieces.size), np.int64),
        "undecided": np.empty((runs, pieces.size), np.bool_),
        "ratios": np.empty((runs, total, filters.bank.hypotheses.size)),
    }
    for run in range(runs):
        output = _Output(**{name: array[run] for name, array in found.items()})
        _track_run(values[run], pieces, starts[run], filters, rule, output)
    single = np.ndim(measurements) == 2
    return Tracks(**{name: array[0] if single else array for name, array in found.items()})
