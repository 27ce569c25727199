"""Adaptive trajectory estimation (ATE) on recorded measurements. Golubkov 2018, algorithm 1; Tsyganov 2019.

At every switch the bank starts at the current estimate with P := I; until the test decides, the output is
the old mode's estimate; then the chosen filter runs alone to the end of the piece. Tsyganov 2019 goes back
after a decision and computes the estimates of the piece so far with the chosen filter. The same test drives
`sprt.SPRTDecider` in the environment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.deciders.sprt import sprt_test, sprt_thresholds
from baselines.filters.recording import check_recording, note
from hybrid_env.checks import (
    check_choice,
    check_flag,
    check_positive,
    check_radii,
    noise_axes,
)
from hybrid_env.core import published_bank as bank
from hybrid_env.core.compilation import compiled, internal
from hybrid_env.core.in_place import in_place
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


@internal
def _likeliest_of_type(hypotheses: NDArray[Any], mode: int) -> int:
    n = hypotheses.size // 2
    best = mode
    for h in range(hypotheses.size):
        likelier = in_place(hypotheses[h]).log_likelihood[0] > in_place(hypotheses[best]).log_likelihood[0]
        if likelier and bank.mode_type(h, n) == bank.mode_type(mode, n):
            best = h
    return best


@compiled
def _track_run(
    measurements: FloatArray,
    lengths: NDArray[np.int64],
    start: FloatArray,
    filters: bank.Bank,
    radii: FloatArray,
    tau: float,
    process_variance: float,
    variances: FloatArray,
    upper: float,
    lower: float,
    straight_reference: bool,
    keep: bool,
    recalculation: int,
    refine: bool,
    estimates: FloatArray,
    covariances: FloatArray,
    modes: NDArray[np.int64],
    decided: NDArray[np.int64],
    ticks: NDArray[np.int64],
    undecided: NDArray[np.bool_],
    ratios: FloatArray,
) -> None:
    estimate, covariance = start.copy(), np.empty((2, 3))
    measurement = np.zeros((2, LANES))
    log_likelihood = np.empty(filters.hypotheses.size)
    rx, ry = variances[0], variances[-1]
    ratios[:] = np.nan
    active = 0
    k = 0
    for piece in range(lengths.size):
        if straight_reference:
            active = 0
        x, vx, y, vy = estimate
        anchor = (x, vx, y, vy)
        bank.anchor_bank(filters, 0, anchor, radii, tau, bank.IDENTITY, bank.IDENTITY)
        running = np.ones(log_likelihood.size, np.bool_)
        begin = k
        end = k + lengths[piece]
        ticks[piece] = lengths[piece]
        undecided[piece] = True
        while k < end and undecided[piece]:
            measurement[:, 0] = measurements[k]
            bank.step_bank(filters, 0, 1, measurement, process_variance, rx, ry)
            note(filters, active, estimates[k], covariances[k])
            modes[k] = active
            for h in range(log_likelihood.size):
                log_likelihood[h] = in_place(filters.hypotheses[h]).log_likelihood[0]
            ratios[k] = log_likelihood - log_likelihood[active]
            winner = sprt_test(log_likelihood, running, active, upper, lower)
            k += 1
            if winner >= 0:
                active = winner
                undecided[piece] = False
                ticks[piece] = k - begin
        if undecided[piece] and not keep:
            active = bank.likeliest(filters.hypotheses, 0)
        if recalculation != KEEP and not undecided[piece]:
            identity = bank.IDENTITY
            if recalculation == AS_PUBLISHED:
                bank.rewind(filters, 0, active, anchor)
            else:
                bank.anchor_bank(filters, 0, anchor, radii, tau, identity, identity)
            for j in range(begin, k):
                x, y = measurements[j]
                bank.step_alone(filters, 0, active, x, y, process_variance, rx, ry)
                note(filters, active, estimates[j], covariances[j])
                modes[j] = active
        for j in range(k, end):
            if refine:
                measurement[:, 0] = measurements[j]
                bank.step_bank(filters, 0, 1, measurement, process_variance, rx, ry)
                active = _likeliest_of_type(filters.hypotheses, active)
            else:
                x, y = measurements[j]
                bank.step_alone(filters, 0, active, x, y, process_variance, rx, ry)
            note(filters, active, estimates[j], covariances[j])
            modes[j] = active
        note(filters, active, estimate, covariance)
        decided[piece] = active
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
    process_variance = check_positive("process_variance", process_variance, allow_zero=True)
    variances = noise_axes(measurement_variance)
    upper, lower = sprt_thresholds(alpha, beta)
    keep = check_choice("undecided", undecided, ("keep", "likeliest")) == "keep"
    straight = check_choice("reference", reference, ("active", "straight")) == "straight"
    way = RECALCULATIONS[check_choice("recalculation", recalculation, RECALCULATIONS)]
    refine = check_flag("refine_radius", refine_radius)

    filters = bank.bank_arrays(bank_radii.size, variances.size)
    found: dict[str, Any] = {
        "estimates": np.empty((runs, total, 4)),
        "covariances": np.empty((runs, total, 2, 3)),
        "modes": np.empty((runs, total), np.int64),
        "decided": np.empty((runs, pieces.size), np.int64),
        "ticks": np.empty((runs, pieces.size), np.int64),
        "undecided": np.empty((runs, pieces.size), np.bool_),
        "ratios": np.empty((runs, total, filters.hypotheses.size)),
    }
    for run in range(runs):
        _track_run(
            values[run], pieces, starts[run], filters, bank_radii, tau, process_variance,
            variances, upper, lower, straight, keep, way, refine, *(array[run] for array in found.values()),
        )  # fmt: skip
    single = np.ndim(measurements) == 2
    return Tracks(**{name: array[0] if single else array for name, array in found.items()})
