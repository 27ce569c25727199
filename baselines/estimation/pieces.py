"""Estimates along known modes, given all measurements. See `piece_filter` for the equations."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from baselines.estimation.piece_filter import (
    REACH,
    SEGMENT,
    TICK,
    Measured,
    Segments,
    compare_begins,
    compare_modes,
    filter_block,
    filter_memory,
    smooth_block,
    smooth_first,
)
from baselines.estimation.turns import SPREAD, STATES
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, Moments
from hybrid_env.compiled import run_compiled

# Places of x, vx, y, vy in the state, and of their covariance.
ORDER = np.array([0, 2, 1, 3])
ORDER_OF_BOTH = np.ix_(ORDER, ORDER)
# Ticks that are smoothed at a time.
PIECE_TICKS = 512
# Times at the begin of a piece in which its curvature may be the mean of that before and its own.
GRADUAL = np.array([0, 2, 4, 8, 16])


def _matrices(rates: FloatArray, tau: float) -> Moments:
    """Return how turns move in a tick.

    Args:
        rates: (K,) turn rates [rad/s].
        tau: length of a tick [s].

    Returns:
        (K, 6, 6) matrices of position, v and u, as `turns.turn_matrix`, and their derivatives by
        the turn rates.
    """

    def matrices(rate: FloatArray) -> FloatArray:
        angle = rate * tau
        cosine, sine = np.cos(angle), np.sin(angle)
        along = tau * np.sinc(angle / np.pi)
        across = 0.5 * tau * angle * np.sinc(0.5 * angle / np.pi) ** 2
        F = np.zeros((len(rate), 6, 6))
        for k in range(2):
            # A left turn by 90 degrees moves coordinate `other` to k.
            other, sign = 1 - k, 2.0 * k - 1.0
            F[:, k, k] = 1.0
            F[:, k, 2 + k] = along
            F[:, k, 4 + other] = sign * across
            F[:, 2 + k, 2 + k] = F[:, 4 + k, 4 + k] = cosine
            F[:, 2 + k, 4 + other] = F[:, 4 + k, 2 + other] = sign * sine
        return F

    # A step of the angle of a tick [rad] for which third derivatives have no weight.
    step = 1e-4 / tau
    return matrices(rates), (matrices(rates + step) - matrices(rates - step)) / (2.0 * step)


@dataclass(eq=False)
class PieceSmoother:
    """Estimates of an object whose modes are known, given all measurements.

    Attributes:
        measurements: (T, 2) positions [m], or (T, 4) with velocities [m/s], NaN where there is
            none.
        noises: (T, 3) covariances xx, xy, yy of the positions [m^2], or (T, 4) with the variance of
            each coordinate of the velocities [m^2/s^2].
        start: estimate (4,) and covariance (4, 4) one tick before the first measurement.
        motions: (M,) records `MOTION`.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2], of straight motion and turns.
        speed: usual one of the object [m/s], of turns after a stop or an unknown start.
        drift_variance: of the drift of the measured positions [m^2], as Q.
        freedom: of Student's t errors; 0 is normal ones.
    """

    measurements: FloatArray
    noises: FloatArray
    start: Moments
    motions: AnyArray
    tau: float
    process_variance: float
    speed: float
    drift_variance: float = 0.0
    freedom: float = 0.0

    def __post_init__(self) -> None:
        """Allocate the memory of a block."""
        self.pieces, self.of_pieces = np.empty((0, 3), int), self.motions[:0]
        self.rates, self.radii = np.empty((2, 0))
        # Modes of the last call of `smooth_first`.
        self.last: IntArray | None = None
        self.measured = Measured(self.measurements, self.noises)
        self.memory = filter_memory(min(PIECE_TICKS, len(self.measurements)))

    def _segments(self, pieces: IntArray, of_pieces: AnyArray, rates: FloatArray) -> Segments:
        """Return the segments of pieces, (K, 3), with their records `MOTION` and turn rates."""
        linear = of_pieces["linear"]
        # Places of the own states in [x, vx, y, vy, ax, ay] of a linear mode.
        states = [0, 2, 1, 3, 4, 5]
        own = np.ix_(states, states)
        records = np.zeros(len(of_pieces), SEGMENT)
        records["curvature"] = _curvatures(of_pieces)
        records["acceleration"] = np.where(linear, of_pieces["acceleration"], np.nan)
        records["stands"], records["rate"] = of_pieces["stands"], rates
        records["F"], records["slopes"] = _matrices(rates, self.tau)
        records["F"][linear] = of_pieces["F"][linear][:, own[0], own[1]]
        records["slopes"][linear] = 0.0
        records["B"] = np.where(linear[:, None], of_pieces["B"][:, states], 0.0)
        records["Q"][:, [0, 1], [0, 1]] = self.drift_variance
        records["Q"][:, [2, 3], [2, 3]] = self.process_variance
        records["Q"][linear] = of_pieces["Q"][linear][:, own[0], own[1]]
        begins = np.zeros(len(self.measurements), bool)
        begins[pieces[:, 0]] = True
        places = np.repeat(np.arange(len(pieces)), pieces[:, 1] - pieces[:, 0])
        return Segments(places, begins, records, SPREAD)

    def _filter(self, first: int, segments: Segments) -> int:
        """Filter the block that begins at a tick, and return the number of its ticks."""
        end = min(first + PIECE_TICKS, len(self.measurements))
        arguments = self.measured, first, end, segments
        run_compiled(filter_block, *arguments, self.speed, self.freedom, self.memory, 0)
        return end - first

    def begin(self) -> Moments:
        """Return state (7,) and covariance (7, 7) before the first segment, of the start."""
        x, P = np.zeros(STATES), np.zeros((STATES, STATES))
        x[:4], P[:4, :4] = self.start[0][ORDER], self.start[1][ORDER_OF_BOTH]
        return x, P

    def _anchor(self, state: FloatArray, covariance: FloatArray) -> None:
        """Let the next block begin with these."""
        before = self.memory.ticks[:1]
        before["state"], before["covariance"] = state, covariance

    def _rates(self, pieces: IntArray) -> FloatArray:
        """Return turn rates (K,) of pieces (K, 3): what was settled last where the middle of a
        piece had the same mode, else those of the modes at the usual speed.
        """
        rates = _curvatures(self.motions[pieces[:, 2]]) * self.speed
        if len(self.pieces) == 0:
            return rates
        middles = pieces[:, :2].sum(1) // 2
        last = np.searchsorted(self.pieces[:, 0], middles, side="right") - 1
        return np.where(self.pieces[last, 2] == pieces[:, 2], self.rates[last], rates)

    def settle(self, pieces: IntArray, gradual: IntArray | None = None) -> FloatArray:
        """Find turn rates of pieces, at which turns are linearised next, and radii; return the
        speeds (T,) at the ticks [m/s].

        Args:
            pieces: (K, 3) first tick, end, and row of `motions` of the segments.
            gradual: (K,) ticks for which a segment begins gradually, see `GRADUAL`; None is 0.
        """
        of_pieces, rates = self.motions[pieces[:, 2]], self._rates(pieces)
        if gradual is not None:
            split = (gradual > 0) & (np.diff(pieces[:, :2])[:, 0] > gradual)
            numbers = np.repeat(np.arange(len(pieces)), 1 + split)
            second = np.diff(numbers, prepend=-1) == 0
            first = split[numbers] & ~second
            begun, begun_rates = _gradual(of_pieces, rates)
            pieces, gradual = pieces[numbers], gradual[numbers]
            of_pieces, rates = of_pieces[numbers], rates[numbers]
            of_pieces[first], rates[first] = begun[numbers[first]], begun_rates[numbers[first]]
            pieces[second, 0] += gradual[second]
            pieces[first, 1] = pieces[first, 0] + gradual[first]
        self.pieces, self.of_pieces, self.rates = pieces, of_pieces, rates
        means = self._smooth_ticks()
        speeds: FloatArray = np.hypot(means[:, 2], means[:, 3])
        return speeds

    def smooth(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return estimates (T, 4) [x, vx, y, vy], covariances (T, 4, 4) and turns (T, 4), see
        `turns.TurnEstimate`, along the pieces that were settled last.
        """
        ticks = len(self.measurements)
        covariances, turns = np.empty((ticks, 4, 4)), np.empty((ticks, 4))
        means = self._smooth_ticks(covariances, turns)
        linear = np.repeat(self.of_pieces["linear"], np.diff(self.pieces[:, :2])[:, 0])
        turns[linear, 2:] = np.nan
        return means[:, ORDER], covariances, turns

    def _smooth_ticks(
        self, covariances: FloatArray | None = None, turns: FloatArray | None = None
    ) -> FloatArray:
        """Return smoothed states (T, 7) of the pieces, and find their turn rates and radii anew.

        Args:
            covariances: (T, 4, 4) of position and velocity, written; None if only states count.
            turns: (T, 4) see `smooth`, written; likewise.
        """
        ticks, m = self.measurements.shape
        memory = self.memory.ticks
        segments = self._segments(self.pieces, self.of_pieces, self.rates)
        self._anchor(*self.begin())
        anchors = []
        for first in range(0, ticks, PIECE_TICKS):
            anchors.append(memory[0].copy())
            memory[0] = memory[self._filter(first, segments)]
        means, spreads = np.empty((ticks, STATES)), np.empty((PIECE_TICKS, STATES, STATES))
        adjoint = np.zeros(STATES)
        information = np.zeros((0 if covariances is None else STATES, STATES))
        written = np.empty((0, 4)) if turns is None else turns
        for first, anchor in zip(range(0, ticks, PIECE_TICKS)[::-1], anchors[::-1], strict=True):
            memory[0] = anchor
            count = self._filter(first, segments)
            part = slice(first, first + count)
            smoothed = means[part], spreads[:count], written[part]
            run_compiled(smooth_block, self.memory, adjoint, information, m, *smoothed)
            if covariances is not None:
                covariances[part] = spreads[:count][:, ORDER_OF_BOTH[0], ORDER_OF_BOTH[1]]
        last = means[self.pieces[:, 1] - 1]
        self.rates = last[:, 6]
        with np.errstate(divide="ignore", invalid="ignore"):
            self.radii = np.hypot(last[:, 2], last[:, 3]) / np.abs(self.rates)
        return means

    @cached_property
    def _modes(self) -> Segments:
        """Segments of all modes, of which the track has none yet."""
        rates = _curvatures(self.motions) * self.speed
        return self._segments(np.empty((0, 3), int), self.motions, rates)

    def smooth_first(self, modes: IntArray, begins: BoolArray) -> Moments:
        """Return estimate (4,) and covariance (4, 4) of the first tick given the measurements of
        all, at most `PIECE_TICKS`. At the next call all ticks are one later.

        Args:
            modes: (T,) of the ticks.
            begins: (T,) True where a segment begins.
        """
        if self.last is None:
            first = self.memory.ticks[1:2]
            first["state"], first["covariance"] = self.begin()
            self.last = np.full(len(modes), -1)
        segments = self._modes._replace(places=modes, begins=begins)
        means, spreads = np.empty((1, STATES)), np.empty((1, STATES, STATES))
        arguments = self.measured, segments, self.speed, self.freedom
        run_compiled(smooth_first, *arguments, self.memory, self.last, means, spreads)
        self.last = modes
        return means.take(ORDER), spreads[0][ORDER_OF_BOTH]

    def _filtered(self, ticks: IntArray, segments: Segments) -> tuple[AnyArray, float]:
        """Return records `TICK` before some ticks (n,), from the measurements before them, and how
        large innovations are: the median of their squared normalised lengths, 1 if the model holds.
        """
        before = np.zeros(len(ticks), TICK)
        memory, m = self.memory.ticks, self.measurements.shape[1]
        distances = []
        self._anchor(*self.begin())
        for first in range(0, len(self.measurements), PIECE_TICKS):
            count = self._filter(first, segments)
            ticks_of = memory[1 : count + 1]
            errors, inverses = ticks_of["error"][:, :m], ticks_of["inverse"][:, :m, :m]
            distances.append(np.einsum("ti,tij,tj->t", errors, inverses, errors))
            here = np.flatnonzero((ticks >= first) & (ticks < first + count))
            before[here] = memory[ticks[here] - first]
            memory[0] = memory[count]
        measured = ~np.isnan(self.measurements[:, 0])
        # Over the median of the squared length of a normalised innovation.
        expected = chdtri(m, 0.5)
        misfit = np.median(np.concatenate(distances)[measured]) / expected
        return before, float(misfit)

    def compare_modes(self, pieces: IntArray, numbers: IntArray) -> FloatArray:
        """Return log-likelihoods of what is measured in some pieces if they had other modes, (n,
        M): of the first `10 REACH` ticks of each.

        Args:
            pieces: (K, 3) of the track.
            numbers: (n,) of those that are compared.
        """
        segments = self._segments(pieces, self.motions[pieces[:, 2]], self._rates(pieces))
        some = pieces[numbers]
        before, _ = self._filtered(some[:, 0], segments)
        compared = np.zeros((len(some), len(self.motions)))
        arguments = self.measured, some, self._modes, self.speed, self.freedom, self.memory
        run_compiled(compare_modes, *arguments, before, compared)
        return compared

    def compare(
        self, numbers: IntArray, gradual: IntArray, stride: int, process_share: float
    ) -> tuple[FloatArray, float]:
        """Return log-likelihoods of what is measured around the begins of pieces that were settled
        last, (n, G, 2 REACH + 1): if they begin gradually, and up to `REACH` times before or after;
        -inf where one cannot. Also return how large innovations are, 1 if the model holds.

        Args:
            numbers: (n,) of the pieces, not the first one.
            gradual: (G,) times for which they do, the first 0, see `GRADUAL`.
            stride: number of ticks of a time.
            process_share: of the process noise that counts.
        """
        pieces = self.pieces
        of_pieces = self.motions[pieces[:, 2]]
        # The smoothed radius, unless it is far from that of the mode.
        with np.errstate(divide="ignore", invalid="ignore"):
            factors = self.radii / np.abs(of_pieces["signed_radius"])
        of_pieces["signed_radius"] *= np.where(factors > 0.0, factors.clip(0.5, 2.0), 1.0)
        begun, begun_rates = _gradual(of_pieces, self.rates)
        rates = np.append(self.rates, begun_rates)
        segments = self._segments(pieces, np.concatenate([of_pieces, begun]), rates)
        # Relative deviation of the curvature of a turn from what was smoothed.
        segments = segments._replace(spread=0.2)
        segments.records["Q"] *= process_share
        begins = pieces[numbers, 0]
        ticks = begins - pieces[numbers - 1, 0] - 1
        firsts = begins - stride * np.minimum(ticks // stride, REACH)
        before, misfit = self._filtered(firsts, segments)
        compared = np.full((len(numbers), len(gradual), 2 * REACH + 1), -np.inf)
        arguments = self.measured, pieces, segments, self.speed, self.freedom, self.memory
        starts = numbers, firsts, before
        run_compiled(compare_begins, *arguments, *starts, stride * gradual, stride, compared)
        return compared, misfit


def _curvatures(of_pieces: AnyArray) -> FloatArray:
    """Return 1 / radius of records `MOTION`, 0 of straight motion."""
    radii = of_pieces["signed_radius"]
    return np.divide(1.0, radii, out=np.zeros(len(radii)), where=radii != 0.0)


def _gradual(of_pieces: AnyArray, rates: FloatArray) -> tuple[AnyArray, FloatArray]:
    """Return records `MOTION` and turn rates (K,) of pieces whose curvature is the mean of that
    before and their own, the same ones at the begin of a track, and of and after linear modes.
    """
    begun = of_pieces.copy()
    linear = of_pieces["linear"]
    turns = np.append(False, ~(linear[1:] | linear[:-1]))

    def mean(values: FloatArray) -> FloatArray:
        return np.where(turns, 0.5 * (values + np.append(0.0, values[:-1])), values)

    means = mean(_curvatures(of_pieces))
    radii = np.divide(1.0, means, out=np.zeros(len(means)), where=means != 0.0)
    begun["signed_radius"][turns] = radii[turns]
    return begun, mean(rates)
