"""Adaptive trajectory estimation (ATE) on recorded measurements. Golubkov 2018, algorithm 1;
Tsyganov 2019.

At every switch the bank starts from the current estimate with P := I. Until the decision, the
output is the estimate of the last decided mode; after it, that of the chosen filter. Tsyganov 2019
adds a recalculation of the estimates since the switch by the chosen filter. The rule `ate` of
`hybridtrack` is the same test in the environment.
"""

import copy
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines import sprt_thresholds
from studies.arrays import FloatArray, IntArray

# From a state [x, vx, y, vy] to position and velocity as complex numbers.
PLANE = np.array([[1.0, 0.0], [0.0, 1.0], [1.0j, 0.0], [0.0, 1.0j]])


class Tracks(NamedTuple):
    """Results of ATE for n runs of T ticks, K segments and M hypotheses.

    Attributes:
        estimates: (n, T, 4) estimates [x, vx, y, vy] [m, m/s]. Without recalculation, those up to
            and including the tick of the decision are estimates of the previous mode.
        decided: (n, K) decided mode of each segment.
        ticks: (n, K) decision time since the switch [ticks]; the segment length if undecided.
        undecided: (n, K) True if the segment ended without a decision.
        ratios: (n, T, M) log-likelihood ratios to the active hypothesis, NaN after the decision.
    """

    estimates: FloatArray
    decided: IntArray
    ticks: IntArray
    undecided: NDArray[np.bool_]
    ratios: FloatArray


class PublishedFilters:
    """The filters of the papers, which start from P := I: n runs of M hypotheses, straight motion
    first, then left and right turns. Centre and rate of a turn are those of the anchor. Points of
    the plane are complex numbers x + i y, and both axes share the covariance.

    Args:
        radii: turn radii [m].
        tau: length of a tick [s].
        process_variance, variance: Q [m^2/s^2], and R [m^2].

    Attributes:
        numbers: (n, M, 9) position, velocity, centre, covariance xx, xv, vv, and a, b, c of the
            transition: x' = a x + b v and v' = c x + a v from the centre.
        log_likelihood: (n, M) of the measurements since `begin`.
    """

    def __init__(self, radii: ArrayLike, tau: float, process_variance: float, variance: float):
        turns = np.asarray(radii, float)
        self.radii = np.concatenate([[0.0], turns, -turns])
        self.tau, self.process_variance, self.variance = tau, process_variance, variance

    def begin(self, anchor: FloatArray) -> None:
        """Start all filters from estimates (n, 4)."""
        x, v = (anchor @ PLANE).T[..., None]
        turns = self.radii != 0.0
        rate = np.abs(v) / np.where(turns, self.radii, 1.0)
        cosine, sine = np.cos(rate * self.tau), np.sin(rate * self.tau)
        transition = (
            np.where(turns, cosine, 1.0),
            np.where(turns, sine / rate, self.tau),
            np.where(turns, -rate * sine, 0.0),
        )
        centre = np.where(turns, x + 1j * v / rate, 0.0)
        columns = np.broadcast_arrays(x, v, centre, 1.0, 0.0, 1.0, *transition)
        self.numbers = np.stack(columns, axis=-1)
        self.log_likelihood = np.zeros(rate.shape)

    def step(self, measured: FloatArray) -> None:
        """Advance by one tick to measurements (n, 2) [m]."""
        x, v, centre, *spread, a, b, c = np.moveaxis(self.numbers, -1, 0)
        xx, xv, vv = np.real(spread)
        x, v = centre + a * (x - centre) + b * v, c * (x - centre) + a * v
        a, b, c = (part.real for part in (a, b, c))
        xx, xv, vv = (
            a * a * xx + 2.0 * a * b * xv + b * b * vv,
            a * c * xx + (a * a + b * c) * xv + a * b * vv,
            c * c * xx + 2.0 * a * c * xv + a * a * vv + self.process_variance,
        )
        total = xx + self.variance
        innovation = (measured @ [1.0, 1.0j])[:, None] - x
        x, v = x + xx / total * innovation, v + xv / total * innovation
        xx, xv, vv = xx * self.variance / total, xv * self.variance / total, vv - xv**2 / total
        self.numbers = np.stack([x, v, centre, xx, xv, vv, a, b, c], axis=-1)
        surprise = 0.5 * np.abs(innovation) ** 2 / total + np.log(2.0 * np.pi * total)
        self.log_likelihood = self.log_likelihood - surprise

    @property
    def estimates(self) -> FloatArray:
        """(n, M, 4) estimates [x, vx, y, vy]."""
        state = self.numbers[..., :2]
        return np.concatenate([state.real, state.imag], axis=-1)


def track_ate(
    measurements: FloatArray,
    lengths: Sequence[int] | IntArray,
    start: ArrayLike,
    *,
    radii: ArrayLike = (5.0,),
    tau: float = 0.1,
    process_variance: float = 0.001,
    measurement_variance: float = 0.1,
    **options: Any,
) -> Tracks:
    """Estimate the trajectory of recorded positions with unknown modes and known switch times.

    Args:
        measurements: (n, T, 2) measured positions of n runs [m].
        lengths: (K,) segment lengths [ticks], with sum T.
        start: (4,) or (n, 4) estimate [x, vx, y, vy] one tick before the first measurement [m,
            m/s].
        radii: turn radii of the bank [m].
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2].
        options: of `_run_ate`.
    """
    filters = PublishedFilters(radii, tau, process_variance, measurement_variance)
    starts = np.broadcast_to(np.asarray(start, float), (len(measurements), 4))
    return _run_ate(filters, measurements, lengths, starts, **options)


def _run_ate(
    filters: PublishedFilters,
    measurements: FloatArray,
    lengths: Sequence[int] | IntArray,
    starts: FloatArray,
    *,
    alpha: float = 1e-3,
    undecided: Literal["keep", "likeliest"] = "keep",
    recalculation: Literal["none", "as_published", "rewind", "literal"] = "none",
    reference: Literal["active", "straight"] = "active",
) -> Tracks:
    """Estimate trajectories with the test of Golubkov 2018, algorithm 1.

    Args:
        filters, measurements, lengths: as of `track_ate`.
        starts: (n, 4) estimates one tick before the first measurement; P is the identity.
        alpha: error probability of both types.
        undecided: mode of a segment that ends without a decision: "keep" for the last decided mode,
            as published, "likeliest" for the most likely hypothesis.
        recalculation: whether the chosen filter recomputes the estimates from the switch to the
            decision (Tsyganov 2019, lines 16 to 21). "literal" restores nothing, as these lines are
            printed. "as_published", with which the published table comes out, restores the estimate
            at the switch but not its covariance; the data are therefore used twice. "rewind"
            restores both.
        reference: hypothesis in the denominator of the ratios: "active" for the last decided mode,
            as published, or always "straight".
    """
    upper, lower = sprt_thresholds(alpha)
    runs = np.arange(len(measurements))
    anchor = starts
    active = np.zeros(runs.size, np.int64)
    results: list[Any] = []
    for part in np.split(measurements, np.cumsum(lengths)[:-1], axis=1):
        filters.begin(anchor)
        shape = filters.log_likelihood.shape
        if reference == "straight":
            active = np.zeros_like(active)
        first, chosen = active, active
        running = np.ones(shape, np.bool_)
        done = np.zeros(runs.size, np.bool_)
        ticks = np.full(runs.size, part.shape[1])
        # Numbers of the chosen filter at the decision.
        numbers = np.zeros((runs.size, 1, 9), np.complex128)
        outputs, ratios_of, every = [], [], []
        for k, measured in enumerate(part.swapaxes(0, 1), start=1):
            filters.step(measured)
            likelihood = filters.log_likelihood
            every.append(filters.estimates)
            outputs.append(every[-1][runs, active])
            ratio = likelihood - likelihood[runs, first][:, None]
            ratios_of.append(np.where(done[:, None], np.nan, ratio))
            tested = running & (np.arange(shape[1]) != first[:, None])
            largest = np.where(tested, ratio, -np.inf)
            running = running & (ratio > lower)
            accepted = largest.max(1) >= upper
            new = ~done & (accepted | ~(tested & running).any(1))
            chosen = np.where(new & accepted, largest.argmax(1), chosen)
            active = np.where(new, chosen, active)
            ticks[new] = k
            done = done | new
            if recalculation in ("as_published", "literal"):
                numbers[new, 0] = filters.numbers[new, chosen[new]]
        if undecided == "likeliest":
            active = np.where(done, active, likelihood.argmax(1))
        output, last = np.stack(outputs, axis=1), every[-1][runs, active]
        if recalculation == "rewind":
            before = (np.arange(part.shape[1]) < ticks[:, None]) & done[:, None]
            again = np.stack(every, axis=1)[runs, :, chosen]
            output = np.where(before[..., None], again, output)
        elif recalculation != "none":
            # From the switch again. Tsyganov 2019, lines 17 to 20.
            if recalculation == "as_published":
                numbers[:, 0, :2] = anchor @ PLANE
            alone = copy.copy(filters)
            alone.numbers, alone.log_likelihood = numbers, np.zeros((runs.size, 1))
            for k in range(part.shape[1]):
                alone.step(part[:, k])
                output[done, k] = alone.estimates[done, 0]
            last = np.where(done[:, None], output[:, -1], last)
        anchor = last
        results.append((output, active, ticks, ~done, np.stack(ratios_of, axis=1)))
    estimates, *of_segments, of_ticks = zip(*results, strict=True)
    decided, times, missed = (np.stack(parts, axis=1) for parts in of_segments)
    ratios = np.concatenate(of_ticks, axis=1)
    return Tracks(np.concatenate(estimates, axis=1), decided, times, missed, ratios)
