"""The model of a recording: noise, turn radii and durations by maximum likelihood of the
innovations, and whether it fits. What is not given is found first on a coarse grid, then by the
simplex method. Lengths are in standard deviations of the measurement and times in ticks, so that
units do not matter. The bank is that of `imm_pass`. If a model fits, innovations divided by their
standard deviations are white, with a variance of 1: Bar-Shalom, Li and Kirubarajan 2001,
"Estimation with applications to tracking and navigation", section 5.4.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from baselines.recordings.imm_pass import Pass, TrackModel, grid_chunks, run_pass
from baselines.recordings.scatter import median_speed, noise_estimate, step_length
from baselines.recordings.ticks import TickGrid
from baselines.recordings.track_modes import in_units
from hybrid_env.checks import ArgumentError, FloatArray
from hybrid_env.compiled import LANES
from hybrid_env.modes import Mode, Stop, Stopping, radii_of_modes

# Turns of a tick that are tried [rad]: 0.004 to 1.02.
ANGLES = tuple(float(angle) for angle in 0.004 * 2.0 ** (0.5 * np.arange(17)))
# Smallest angle in a tick [rad] of a turn that is told from straight motion: .2 in 75 ticks.
SMALLEST_ANGLE = 0.2 / 75.0
# Difference of log-likelihoods beyond the criterion: the filters are only an approximation.
CLEARLY = 5.0


# Logarithm of the likelihood of a recording; the number of modes may differ.
Likelihood: TypeAlias = Callable[[TrackModel], float]


def fit_model(
    grid: TickGrid,
    radii: Sequence[float] | None = None,
    measurement_variance: float | None = None,
    process_variance: float | None = None,
    duration: float | None = None,
    lengths: Sequence[int] = (),
    modes: tuple[Mode, ...] = (),
) -> TrackModel:
    """Find what is not given of a model by maximum likelihood; a recording that does not move is
    refused. Without radii [unit of length] and modes, one to three radii are proposed, as many as
    the Bayesian information criterion allows. With a radar R is its `nominal_variance`. With
    lengths, the ticks between known switches, the mean duration has no effect.
    """
    # Smallest standard deviation of a measurement, over the median motion of a tick.
    smallest_noise = 1e-4
    tau = grid.tau
    if grid.radar is not None:
        measurement_variance = nominal_variance(grid)
    rough = measurement_variance or noise_estimate(grid) or 0.0
    speed = median_speed(grid, rough)
    step = max(speed, step_length(grid) or 0.0)
    if step == 0.0 and rough == 0.0:
        raise ArgumentError("the recording does not move: most positions are equal")
    rough = max(rough, (smallest_noise * step) ** 2)
    scale = math.sqrt(rough)
    speed = max(speed, smallest_noise * scale)
    chunks, _ = grid_chunks(grid, scale, lengths, 512, 4096)

    def likelihood(at: TrackModel) -> float:
        total = run_pass(chunks, at).log_likelihood
        return total if math.isfinite(total) else -math.inf

    # Q tau^2 / R that are tried.
    processes: tuple[float, ...] = (1e-5, 1e-3, 1e-1)
    if process_variance is not None:
        processes = (process_variance * tau**2 / rough,)
    given = TrackModel(
        tuple(radius / scale for radius in radii or ()),
        1.0,
        processes[0],
        math.inf if lengths else 75.0 if duration is None else max(duration, 10.0),
        speed / scale,
        1.0,
    )
    if modes:
        radii = radii_of_modes(modes)
        units = 1.0 / scale, tau / scale, tau, speed / tau
        given = replace(given, modes=tuple(in_units(mode, *units) for mode in modes))
    known = {
        "measurement_variance": measurement_variance,
        "process_variance": process_variance,
        "radii": radii,
    }
    free = [name for name, value in known.items() if value is None]
    penalty = math.log(np.count_nonzero(~np.isnan(chunks.measurements[:, :, 0])))
    proposed = _proposed(likelihood, given, processes) if not modes else given
    margin = 0.0
    better: tuple[float, ...] = ()
    if radii is not None:
        given_radii = [replace(given, process_variance=q) for q in processes]
        given = max(given_radii, key=likelihood)
    best = _refine(likelihood, proposed if radii is None else given, free)
    if grid.radar is None:
        best = _with_drift(likelihood, best, free, penalty)
    if radii is None:
        best = _more_radii(likelihood, best, free, penalty)
        margin = 0.5 * penalty * len(best.radii)
    elif not modes:
        proposed = replace(proposed, drift_variance=best.drift_variance)
        if likelihood(proposed) > likelihood(best) + CLEARLY:
            better = _refine(likelihood, proposed, ["radii"]).radii
    limit = likelihood(best) - margin
    turns = bool(modes) or limit > _straight(likelihood, best, free, limit)
    if grid.velocities:
        best = _with_velocities(likelihood, best, free)
    if lengths:
        duration = float(np.mean(lengths))
    if duration is None:
        duration = _counted_duration(run_pass(chunks, best))
        free.append("duration")
    return TrackModel(
        tuple(sorted(radius * scale for radius in best.radii) if radii is None else radii),
        measurement_variance or best.measurement_variance * rough,
        best.process_variance * rough / tau**2 if process_variance is None else process_variance,
        duration,
        speed / tau,
        tau,
        tuple(free),
        turns,
        tuple(sorted(radius * scale for radius in better)),
        modes,
        best.drift_variance * rough,
        best.velocity_variance * rough / tau**2,
    )


def check_radii(model: TrackModel) -> None:
    """Refuse a model if a radius that was found is none of a moving object."""
    free = {"radii", "measurement_variance"} <= set(model.estimated)
    if free and model.turns and _turns_are_noise(model):
        raise ArgumentError(
            "the object stands still in a part of the recording, which looks like turns of a radius"
            " below three standard deviations of the noise, or of more than a turn in a tick: give"
            " --radii, or --modes with a stop"
        )


def _turns_are_noise(model: TrackModel) -> bool:
    """Return whether a radius is none of a moving object, but the noise while it stands."""
    step = model.speed * model.tau
    smallest_radius = 3.0 * math.sqrt(model.measurement_variance)
    return any(
        radius < smallest_radius < 3.0 * step or step / radius > 2.0 * math.pi
        for radius in model.radii
    )


def nominal_variance(grid: TickGrid) -> float:
    """Return the median over the measurements of a radar of the geometric mean of their two
    variances.
    """
    assert grid.radar is not None
    points = np.concatenate([piece.measurements[piece.measured] for piece in grid.pieces])
    xx, xy, yy = np.transpose([grid.radar.noise(x, y) for x, y in points.tolist()])
    return float(np.median(np.sqrt(xx * yy - xy**2)))


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


def _with_drift(
    likelihood: Likelihood, steady: TrackModel, free: list[str], penalty: float
) -> TrackModel:
    """Return a model with a drift of the measured positions, and add it to the names of what is
    free, if the criterion allows it; otherwise the one that was given. penalty: as of
    `_more_radii`.
    """
    # Over R; a smaller drift is not told from errors of the filters where the mode switches.
    least = 0.5
    value = likelihood(steady)
    points = [
        replace(
            steady,
            drift_variance=drift * steady.measurement_variance,
            process_variance=steady.process_variance * (q if "process_variance" in free else 1.0),
        )
        for drift in (1.0, 10.0)
        for q in (0.01, 0.1, 1.0)
    ]
    start = max(points, key=likelihood)
    if likelihood(start) < value:
        return steady
    drifting = _refine(likelihood, start, [*free, "drift_variance"])
    clearly = likelihood(drifting) > value + 0.5 * penalty + CLEARLY
    if not clearly or drifting.drift_variance < least * drifting.measurement_variance:
        return steady
    free.append("drift_variance")
    return _refine(likelihood, drifting, free)


def _with_velocities(likelihood: Likelihood, blind: TrackModel, free: list[str]) -> TrackModel:
    """Return a model with the variance of measured velocities that has the largest likelihood, and
    add it to the names of what is free; the one that was given if they are no velocities of the
    object.
    """
    points = [
        replace(blind, velocity_variance=(share * blind.speed) ** 2)
        for share in (0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
    ]
    names = [name for name in free if name not in ("radii", "duration")]
    best = _refine(likelihood, max(points, key=likelihood), [*names, "velocity_variance"])
    # Half of the speed in each coordinate is no more than chance.
    if best.velocity_variance > (0.5 * blind.speed) ** 2:
        return blind
    free.append("velocity_variance")
    return best


def _more_radii(
    likelihood: Likelihood, best: TrackModel, free: list[str], penalty: float
) -> TrackModel:
    """Add radii while the criterion allows it. penalty: logarithm of the number of measurements."""
    # Smallest difference of the logarithms of two radii that are proposed together.
    distinct = 0.25

    def is_turn(radius: float) -> bool:
        """Whether a turn is told from straight motion, from the noise and from the opposite one."""
        angle = best.speed / radius
        noise = 3.0 * math.sqrt(best.measurement_variance)
        return SMALLEST_ANGLE < angle < 1.0 and radius > noise

    value = likelihood(best)
    while len(best.radii) < 3:
        more = [
            replace(best, radii=(*best.radii, radius))
            for radius in (best.speed / angle for angle in ANGLES)
            if min(abs(math.log(radius / other)) for other in best.radii) > distinct
            and is_turn(radius)
        ]
        if not more:
            break
        candidate = max(more, key=likelihood)
        if likelihood(candidate) < value + 0.5 * penalty:
            break
        candidate = _refine(likelihood, candidate, free)
        likeliest = likelihood(candidate)
        closest = np.diff(np.sort(np.log(candidate.radii))).min()
        if (
            likeliest < value + penalty + CLEARLY
            or closest < distinct
            or not all(map(is_turn, candidate.radii))
        ):
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
    origin = np.log([*(getattr(start, name) for name in names), *radii])
    if not origin.size:
        return start

    def parameters(vector: FloatArray) -> TrackModel:
        # Not below a Q tau^2 / R of 1e-10.
        values = np.exp(np.clip(vector, -23.0, 60.0)).tolist()
        changes: dict[str, Any] = dict(zip(names, values, strict=False))
        if radii:
            largest = start.speed / SMALLEST_ANGLE
            changes["radii"] = tuple(min(radius, largest) for radius in values[len(names) :])
        return replace(start, **changes)

    widths = dict.fromkeys(("process_variance", "drift_variance", "velocity_variance"), 1.0)
    widths["measurement_variance"] = 0.3
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


def with_stop(grid: TickGrid, moving: TrackModel, whole: TrackModel, longest: float) -> TrackModel:
    """Return a model with a stop as its last mode, of the moving parts of a recording with a mean
    duration that counts the stops, or of the whole one; or the model of the whole recording without
    a stop, as of an object that is slow for a moment.

    A drifting sensor hides the difference of their likelihoods. Where the object stands for two
    windows or more, the stop need not explain the recording better, else clearly. A part of a long
    recording is enough if it shows the stop.

    Args:
        grid: of the whole recording.
        moving: model of the parts in which the object moves.
        whole: model of the recording.
        longest: windows in which it stands, see `without_standing`.
    """
    stopping = [
        replace(model, modes=(*model.all_modes, Stop()), estimated=(*model.estimated, "modes"))
        for model in (moving, whole)
    ]
    models = [*stopping, moving, whole]
    margin = -CLEARLY if longest >= 2.0 else CLEARLY
    enough = 200_000
    for most in (enough, math.inf):
        passes, places = zip(*(model.run(grid, (), 2048, most) for model in models), strict=True)
        values = [each.log_likelihood for each in passes]
        ticks = sum(end - first for _, first, end in places[0])
        # Stops look like turns to the whole recording, whose radii explain a little more at every
        # tick.
        best = int(values[1] > values[0] + 0.005 * ticks)
        stops = values[best] > max(values[2:]) + margin
        # Of many short pieces the part is smaller than it may be.
        if ticks == grid.total or (stops and 2 * ticks > enough):
            break
    # Given radii are those of the object.
    if not stops or ("radii" in moving.estimated and _turns_are_noise(models[best])):
        return whole
    found = models[best]
    if "duration" in moving.estimated:
        found = replace(found, duration=_counted_duration(passes[best]))
    return _with_stopping(grid, found, enough)


def _with_stopping(grid: TickGrid, model: TrackModel, most: float) -> TrackModel:
    """Return a model with a stop that also knows how the object slows down to it, if that explains
    the recording better, or a part of it with at most so many ticks.
    """

    def likelihood(modes: tuple[Mode, ...]) -> float:
        return replace(model, modes=modes).run(grid, (), 2048, most)[0].log_likelihood

    # A time within a factor of two is good enough.
    times = [model.tau * ticks for ticks in (1.5, 4.5, 13.5, 40.5)]
    values = [likelihood((*model.modes, Stopping(time))) for time in times]
    if max(values) < likelihood(model.modes) + CLEARLY:
        return model
    return replace(model, stopping_time=times[int(np.argmax(values))])


def _counted_duration(result: Pass) -> float:
    """Return the mean duration of a mode [ticks] by the changes of the most probable one, as the
    likelihood says little about it. Short changes, made by noise, do not count; without one it is
    the duration of the recording.
    """
    probabilities = result.probabilities
    changes = 0
    total = 0
    for lane in np.moveaxis(probabilities, 3, 1).reshape(-1, *probabilities.shape[1:3]):
        total += int((~np.isnan(lane[:, 0])).sum())
        # Where a mode is probable enough to count.
        modes = lane[lane.max(1) > 0.6].argmax(1)
        begins = np.flatnonzero(np.diff(modes, prepend=-1))
        # Ticks of a change that counts.
        kept = modes[begins[np.diff(begins, append=modes.size) >= 5]]
        changes += int((np.diff(kept) != 0).sum())
    return float(np.clip(total / (changes + 1.0), 10.0, 1e5))


def check_consistency(
    grid: TickGrid, model: TrackModel, lengths: Sequence[int] = ()
) -> tuple[list[FloatArray], list[str]]:
    """Return the normalised innovations of each piece of a recording, (T, 2), of the most probable
    mode, NaN without a measurement and where filters start; and a plain sentence for everything
    that does not fit. Lengths are those between known switches.
    """
    # Ticks; the filters start anew at the beginning of each chunk.
    found, places = model.run(grid, lengths, 2048)
    innovations = [np.full((len(piece.measurements), 2), np.nan) for piece in grid.pieces]
    for k, (index, first, end) in enumerate(places):
        innovations[index][first:end] = found.white[k // LANES, : end - first, :, k % LANES]
    # No product joins two pieces.
    joined = np.concatenate(
        [np.pad(rows, ((0, 1), (0, 0)), constant_values=np.nan) for rows in innovations]
    )
    squared = (joined**2).sum(1)
    count = np.count_nonzero(~np.isnan(squared))
    if count < 30:
        sentence = f"only {count} innovations: whether the model fits cannot be checked"
        return innovations, [sentence, *_further(grid)]
    noise = noise_estimate(grid) if grid.radar is None else None
    # 1 if the model holds, as the next one; not of a radar, whose noise depends on the range.
    scatter = 1.0 if noise is None else math.sqrt(noise / model.measurement_variance)
    # Median of the squared length of a normalised innovation in two dimensions.
    ratio = math.sqrt(float(np.nanmedian(squared)) / (2.0 * math.log(2.0)))
    # A single outlier must not decide.
    near = np.clip(joined, -5.0, 5.0)
    products = near[1:] * near[:-1]
    total = float(np.nanmean(near**2))
    known = total and not np.isnan(products).all()
    # Of successive ones, 0 if the model holds.
    correlation = float(np.nanmean(products)) / total if known else 0.0
    given, better = (
        ", ".join(f"{radius:.4g}" for radius in radii)
        for radii in (model.radii, model.better_radii)
    )
    options = ("measurement_variance", "process_variance", "radii")
    known_before = [name.replace("_", "-") for name in options if name not in model.estimated]
    reasons = {
        f"leave out --{' and --'.join(known_before)}, which is then found": bool(known_before),
        "the noise changes, or the motion is none of lines and arcs": ratio > 1.0,
        "positions without noise, as of a simulation, or smoothed ones": True,
    }
    reason = next(text for text, true in reasons.items() if true)
    says = "positions are repeated, rounded or computed"
    if scatter > 1.0:
        says = "the noise changes along the recording"
    # Computed positions have none.
    noisy = noise is not None and noise > (1e-6 * model.speed * model.tau) ** 2
    if noisy and "measurement_variance" not in model.estimated:
        says = f"they say --measurement-variance {noise:.3g}"
    # What explains others comes first.
    misfits = {
        f"the measurements scatter {scatter:.3g} times what R says: {says}": (
            not 1.0 / 3.0 <= scatter <= 3.0
        ),
        f"residuals are {ratio:.3g} times what the model says: {reason}": (
            not 1.0 / 1.5 <= ratio <= 1.5
        ),
        f"turns of radius {given} do not explain the recording, {better} does: give it by"
        " --radii": bool(better),
        f"turns of radius {given} explain the recording no better than straight motion: give other"
        " --radii, or none to find them": not (model.turns or "radii" in model.estimated),
        f"successive residuals are correlated by {correlation:.2f}: the model does not fit"
        " (motion other than lines and arcs, smoothed positions, or wrong radii)": (
            abs(correlation) > max(0.25, 4.0 / math.sqrt(2.0 * count))
        ),
    }
    sentences = [sentence for sentence, true in misfits.items() if true][:1]
    # Squared length that a normalised innovation exceeds with probability 0.001.
    far = float((squared > 13.8 * max(ratio, 1.0) ** 2).sum()) / count
    if far > 0.02:
        sentences.append(
            f"{far:.1%} of the residuals are outliers, more than three standard deviations off"
        )
    return innovations, sentences + _further(grid)


def _further(grid: TickGrid) -> list[str]:
    """Return sentences about what no model explains."""
    sentences = []
    if grid.radar is not None:
        points = np.concatenate([piece.measurements for piece in grid.pieces])
        farthest = float(np.nanmax(np.hypot(*(points - grid.radar.position).T)))
        # Bend of an arc of the length of the bearing error, see `Radar`.
        of_range, of_bearing = grid.radar.deviations
        bend = farthest * of_bearing**2 / of_range
        if bend > 0.25:
            sentences.append(
                "the bearing error is too large for the range deviation (range * deviation^2 is"
                f" {bend:.2g} of it, at most 0.25 is consistent): errors are larger than the"
                " covariances say"
            )
    return sentences
