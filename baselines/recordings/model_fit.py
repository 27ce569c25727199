"""Measurement noise, process noise, turn radii and durations by maximum likelihood of the
innovations. What is not given is found first on a coarse grid, then by the simplex method. Lengths
are in standard deviations of the measurement and times in ticks, so that units do not matter. The
bank is that of `imm_pass`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from baselines.recordings.imm_pass import NO_OUTPUT, Chunks, fit_chunks, imm_pass, recorded_pass
from baselines.recordings.scatter import median_speed, median_step, noise_estimate
from baselines.recordings.ticks import TickGrid
from baselines.rules.measurements import run_compiled
from hybrid_env.checks import ArgumentError, FloatArray
from hybrid_env.compiled import FilterModel, ImmBank, bank_arrays

# Smallest standard deviation of a measurement, over the median motion of a tick.
SMALLEST_NOISE = 1e-4
# Turns of a tick that are tried [rad]: 0.004 to 1.02.
ANGLES = tuple(float(angle) for angle in 0.004 * 2.0 ** (0.5 * np.arange(17)))
# The duration of modes that only change at known switches.
NEVER = 0.0
# Ticks.
DURATIONS = (10.0, 1e5)
# Difference of log-likelihoods beyond the criterion: the filters are only an approximation.
CLEARLY = 5.0


@dataclass(frozen=True)
class TrackModel:
    """What the filters assume of a recording, in its units."""

    # Of turns, each to the left and to the right.
    radii: tuple[float, ...]
    # R of each coordinate.
    measurement_variance: float
    # Q of each velocity in a tick.
    process_variance: float
    # Mean, of a segment [ticks].
    duration: float
    # Median.
    speed: float
    # Tick.
    tau: float
    # Names of the attributes above that were not given.
    estimated: tuple[str, ...] = ()
    # Whether turns of these radii explain the recording better than straight motion alone.
    turns: bool = True
    # Proposed by the recording, which they explain better than the given ones.
    better_radii: tuple[float, ...] = ()

    @property
    def of_bank(self) -> FilterModel:
        """Return the model of the bank, of lengths in any unit and times in ticks, with geometric
        durations.
        """
        modes = 2 * len(self.radii) + 1
        hazard = 0.0
        if self.radii and self.duration != NEVER:
            hazard = min(1.0 / self.duration, 1.0 - 1.0 / modes)
        variances = self.measurement_variance, self.measurement_variance
        probabilities = 1.0 - hazard, hazard / max(modes - 1, 1)
        return FilterModel(1.0, self.process_variance, *variances, *probabilities)

    @property
    def turn_rates(self) -> tuple[float, ...]:
        """Turn rates of the radii at the median speed [rad / time unit]."""
        return tuple(self.speed / radius for radius in self.radii)


# Logarithm of the likelihood of a recording; the number of modes may differ.
Likelihood: TypeAlias = Callable[[TrackModel], float]


def fit_model(
    grid: TickGrid,
    radii: Sequence[float] | None = None,
    measurement_variance: float | None = None,
    process_variance: float | None = None,
    duration: float | None = None,
    lengths: Sequence[int] = (),
) -> TrackModel:
    """Find what is not given of a model by maximum likelihood; a recording that does not move is
    refused, and one that stands for a while, see `_check_radii`. Without radii [unit of length],
    one to three are proposed, as many as the Bayesian information criterion allows. With a radar R
    is its `nominal_variance`. With lengths, the ticks between known switches, the mean duration has
    no effect.
    """
    tau = grid.tau
    if grid.radar is not None:
        measurement_variance = nominal_variance(grid)
    rough = noise_estimate(grid) if measurement_variance is None else measurement_variance
    rough = rough or 0.0
    speed = median_speed(grid, rough)
    step = max(speed, median_step(grid) or 0.0)
    if step == 0.0 and rough == 0.0:
        raise ArgumentError("the recording does not move: all measured positions are equal")
    rough = max(rough, (SMALLEST_NOISE * step) ** 2)
    scale = math.sqrt(rough)
    speed = max(speed, SMALLEST_NOISE * scale)
    chunks = fit_chunks(grid, scale, lengths)

    def likelihood(at: TrackModel) -> float:
        bank = bank_arrays(ImmBank, len(at.radii))
        radii = np.array(at.radii, float)
        total = run_compiled(imm_pass, chunks, bank, radii, at.of_bank, NO_OUTPUT)
        return total if math.isfinite(total) else -math.inf

    # Ticks.
    given = TrackModel(
        tuple(radius / scale for radius in radii or ()),
        1.0,
        -1.0 if process_variance is None else process_variance * tau**2 / rough,
        NEVER if lengths else 75.0 if duration is None else max(duration, DURATIONS[0]),
        speed / scale,
        1.0,
    )
    # Q tau^2 / R that are tried.
    processes = (1e-5, 1e-3, 1e-1) if process_variance is None else (given.process_variance,)
    known = {
        "measurement_variance": measurement_variance,
        "process_variance": process_variance,
        "radii": radii,
    }
    free = [name for name, value in known.items() if value is None]
    penalty = math.log(np.count_nonzero(~np.isnan(chunks.measurements[:, :, 0])))
    proposed = _proposed(likelihood, given, processes)
    if radii is None:
        best = _more_radii(likelihood, _refine(likelihood, proposed, free), free, penalty)
    else:
        given_radii = [replace(given, process_variance=q) for q in processes]
        best = _refine(likelihood, max(given_radii, key=likelihood), free)
    value = likelihood(best)
    margin = 0.5 * penalty * len(best.radii) if radii is None else 0.0
    turns = value > _straight(likelihood, best, free, value - margin) + margin
    better: tuple[float, ...] = ()
    if radii is not None and likelihood(proposed) > value + CLEARLY:
        better = _refine(likelihood, proposed, ["radii"]).radii
    if lengths:
        duration = float(np.mean(lengths))
    if duration is None:
        duration = _counted_duration(chunks, best)
        free.append("duration")
    if measurement_variance is None:
        measurement_variance = best.measurement_variance * rough
    if turns and {"radii", "measurement_variance"} <= set(free):
        deviation = math.sqrt(measurement_variance)
        _check_radii([radius * scale for radius in best.radii], speed, deviation)
    fitted, better = (
        tuple(sorted(radius * scale for radius in some)) for some in (best.radii, better)
    )
    return TrackModel(
        fitted if radii is None else tuple(radii),
        measurement_variance,
        best.process_variance * rough / tau**2 if process_variance is None else process_variance,
        duration,
        speed / tau,
        tau,
        tuple(free),
        turns,
        better,
    )


def _check_radii(radii: Sequence[float], step: float, deviation: float) -> None:
    """Refuse found radii that no object has which moves by a step in a tick: they are the noise
    while it stands.
    """
    # Of a turn that is told from a standing object, over the standard deviation of the noise.
    smallest_radius = 3.0
    for radius in radii:
        small = radius < smallest_radius * deviation < smallest_radius * step
        if small or step / radius > 2.0 * math.pi:
            why = f"below {smallest_radius:g} standard deviations ({deviation:.3g}) of the noise"
            raise ArgumentError(
                "the object stands still in a part of the recording, which looks like turns of"
                f" radius {radius:.3g}, {why if small else 'more than a turn in a tick'}: cut that"
                " part out, or give --radii"
            )


def nominal_variance(grid: TickGrid) -> float:
    """Return the median over the measurements of a radar of the geometric mean of their two
    variances.
    """
    assert grid.radar is not None
    points = np.concatenate([piece.measurements for piece in grid.pieces])
    noises = np.array([grid.radar.noise(x, y) for x, y in points[~np.isnan(points[:, 0])].tolist()])
    return float(np.median(np.sqrt(noises[:, 0] * noises[:, 2] - noises[:, 1] ** 2)))


def _proposed(likelihood: Likelihood, given: TrackModel, processes: Sequence[float]) -> TrackModel:
    """Return the best point of a grid of one radius and Q."""
    points = [
        replace(given, process_variance=q, radii=(given.speed / angle,))
        for q in processes
        for angle in ANGLES[::2]
    ]
    best = max(points, key=likelihood)
    near = [replace(best, radii=(best.radii[0] * factor,)) for factor in (0.7, 1.0, 1.4)]
    return max(near, key=likelihood)


def _more_radii(
    likelihood: Likelihood,
    best: TrackModel,
    free: list[str],
    penalty: float,
) -> TrackModel:
    """Add radii while the criterion allows it. penalty: logarithm of the number of measurements."""
    # Smallest difference of the logarithms of two radii that are proposed together.
    distinct = 0.25
    value = likelihood(best)
    while len(best.radii) < 3:
        more = [
            replace(best, radii=(*best.radii, radius))
            for radius in (best.speed / angle for angle in ANGLES)
            if min(abs(math.log(radius / other)) for other in best.radii) > distinct
        ]
        candidate = max(more, key=likelihood)
        if likelihood(candidate) < value + 0.5 * penalty:
            break
        candidate = _refine(likelihood, candidate, free)
        likeliest = likelihood(candidate)
        closest = np.diff(np.sort(np.log(candidate.radii))).min()
        if likeliest < value + penalty + CLEARLY or closest < distinct:
            break
        best = candidate
        value = likeliest
    return best


def _straight(likelihood: Likelihood, best: TrackModel, free: list[str], limit: float) -> float:
    """Return the largest likelihood of straight motion alone; one that is far below a limit is
    rough.
    """
    noises = [name for name in free if name != "radii"]
    factors = 10.0 ** np.arange(7) if "process_variance" in free else (1.0,)
    points = [
        replace(best, radii=(), process_variance=best.process_variance * factor)
        for factor in factors
    ]
    start = max(points, key=likelihood)
    value = likelihood(start)
    return value if value < limit - 50.0 else likelihood(_refine(likelihood, start, noises))


def _refine(likelihood: Likelihood, start: TrackModel, free: list[str]) -> TrackModel:
    """Return the point of the largest likelihood near a start, by the simplex method in
    logarithms.
    """
    # It loads slowly.
    from scipy.optimize import minimize

    names = [name for name in free if name != "radii"]
    radii = start.radii if "radii" in free else ()
    origin = np.array(
        [math.log(value) for value in (*(vars(start)[name] for name in names), *radii)]
    )
    if not origin.size:
        return start

    def parameters(vector: FloatArray) -> TrackModel:
        tried = np.exp(np.clip(vector, -60.0, 60.0)).tolist()
        changes: dict[str, Any] = dict(zip(names, tried, strict=False))
        if "process_variance" in changes:
            # Q tau^2 / R.
            changes["process_variance"] = max(changes["process_variance"], 1e-10)
        if radii:
            changes["radii"] = tuple(tried[len(names) :])
        return replace(start, **changes)

    widths = {"measurement_variance": 0.3, "process_variance": 1.0}
    steps = [*(widths[name] for name in names), *[0.2] * len(radii)]
    cost = minimize(
        lambda vector: -likelihood(parameters(vector)),
        origin,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([origin, origin + np.diag(steps)]),
            "maxfev": 60,
            "fatol": 0.1,
            "xatol": 0.1,
        },
    )
    return parameters(cost.x)


def _counted_duration(chunks: Chunks, model: TrackModel) -> float:
    """Return the mean duration of a mode [ticks] by the changes of the most probable one, as the
    likelihood says little about it. Short changes, made by noise, do not count; without one it is
    the duration of the recording.
    """
    probabilities = recorded_pass(chunks, np.array(model.radii, float), model.of_bank).probabilities
    changes = 0
    total = 0
    for lane in np.moveaxis(probabilities, 3, 1).reshape(-1, *probabilities.shape[1:3]):
        # NaN is not.
        # Probability of a mode that counts.
        sure = lane[lane.max(1) > 0.6].argmax(1)
        total += int((~np.isnan(lane[:, 0])).sum())
        if sure.size:
            runs = np.flatnonzero(np.diff(sure, prepend=-1))
            # Ticks of a change that counts.
            kept = sure[runs[np.diff(np.append(runs, sure.size)) >= 5]]
            changes += int((np.diff(kept) != 0).sum())
    return min(max(total / (changes + 1.0), DURATIONS[0]), DURATIONS[1])
