"""The study: flights, tuning on 30 % of them, errors on the others, next to the published
tables.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studies.papers.reproduction import Reproduction
from studies.radar import radars, tables
from studies.radar.filters import (
    COMBINED,
    CONTENDERS,
    ROBUST,
    SOUND,
    THESIS,
    run_contender,
)
from studies.radar.flights import FLIGHTS, Flight, point_mass_flights
from studies.radar.parallel import Progress, run_calls, silent
from studies.radar.radars import NOISES, Noise, Scan, Tracks, measure, scan_flight
from studies.radar.tables import PAPER, PARAMETERS, UNFILTERED
from studies.radar.tuning import Tuning, errors

FloatArray = NDArray[np.float64]

# Trials of each tuning.
TRIALS = 60
# Seeds of the noise on the test flights.
RUNS = 10
# Trials of a tuning in one call.
PART = 10


@dataclass(frozen=True)
class Example:
    """One test flight for the figures: what its radars see, and estimates of filters by noise
    and name.
    """

    flight: Flight
    scan: Scan
    tracks: dict[Noise, Tracks]
    # Positions and velocities.
    estimates: dict[Noise, dict[str, tuple[FloatArray, FloatArray]]]


def reproduce(
    runs: int = RUNS,
    seed: int = 0,
    *,
    folder: Path,
    flights: int = FLIGHTS,
    trials: int = TRIALS,
    fly: Callable[[int, int], list[Flight]] = point_mass_flights,
    jobs: int = 1,
    progress: Progress = silent,
) -> Reproduction:
    """Reproduce tables 3.5 and 3.6, and compare them with sound settings and robust filters.

    Args:
        runs: number of seeds of the noise on the test flights, at least 1.
        seed: of flights, radars, noise and tuning.
        folder: for finished trials, from which a killed run goes on; it is created.
        flights: number of flights, at least 4.
        trials: number of trials of each tuning.
        fly: returns a number of flights for a seed.
        jobs: number of processes for tunings and evaluations; the results do not depend on it.
        progress: called with the stage, the work done and the total.
    """
    folder.mkdir(parents=True, exist_ok=True)
    flown = fly(flights, seed)
    scans = [
        scan_flight(flight, np.random.default_rng((seed, 1, k))) for k, flight in enumerate(flown)
    ]
    first = round(radars.TRAINING_SHARE * flights)
    training = {
        noise: measure(scans[:first], noise, (seed, radars.TRAINING_NOISE)) for noise in NOISES
    }
    parameters = tune_filters(training, seed, folder, trials, jobs, progress)
    calls = {
        (noise, label): partial(evaluate, *of, scans[first:], noise, runs, seed)
        for noise in NOISES
        for label, of in {UNFILTERED: (None, {}), **_rows(noise, parameters[noise])}.items()
    }
    found = run_calls(calls, jobs, progress, "test flights")
    by_noise = {
        noise: {label: values for (of, label), values in found.items() if of == noise}
        for noise in NOISES
    }
    results = tables.Results(by_noise, parameters)
    return Reproduction(
        PAPER,
        runs,
        seed,
        tables.cells(results, seed),
        tables.findings(results, seed, flights, first),
        {"flight": _example(flown[first], scans[first], seed, parameters)},
        RUNS,
        f"{FLIGHTS} flights",
    )


def tune_filters(
    training: dict[Noise, Tracks],
    seed: int,
    folder: Path,
    trials: int = TRIALS,
    jobs: int = 1,
    progress: Progress = silent,
    robust: Sequence[str] = tuple(ROBUST),
) -> dict[Noise, dict[str, dict[str, Any]]]:
    """Parameters of all filters by noise and name, tuned on the training flights, the robust ones
    after the plain CV filter, with which they are compared; arguments as of `reproduce`.
    """
    # The longest first.
    names = sorted(THESIS | SOUND, key=lambda name: "IMM" not in name)
    parts = range(0, trials, PART)
    filters = len(names) * len(NOISES) + len(robust)

    def tuned(tunings: dict[Any, Tuning], before: int) -> dict[Any, Any]:
        """Best parameters; each part continues the trials of the one before, so that progress is
        seen.
        """
        found: dict[Any, Any] = {}
        for number, done in enumerate(parts):
            calls = {
                name: replace(of_filter, trials=min(done + PART, trials)).run
                for name, of_filter in tunings.items()
            }
            finished = before * len(parts) + number * len(tunings)
            whole = filters * len(parts)
            found = run_calls(calls, jobs, progress, "tuning", finished, whole)
        return found

    tuning = partial(
        Tuning,
        training=training,
        trials=trials,
        seed=seed,
        folder=folder,
    )
    found = tuned({(noise, name): tuning(name, noise) for name in names for noise in NOISES}, 0)
    parameters = {noise: {name: found[noise, name] for name in names} for noise in NOISES}
    plain = parameters["gaussian"]["CV"]
    reference = tuning("CV", "gaussian").cost(plain)
    later = {name: tuning(name, None, plain=plain, reference=reference) for name in robust}
    found = tuned(later, filters - len(robust))
    imm = parameters["gaussian"]["IMM (CV, CA)"]
    student = found["CV, Student-t"]
    found[COMBINED] = imm | {key: student[key] for key in ("degrees of freedom", "scale")}
    return {noise: parameters[noise] | found for noise in NOISES}


def evaluate(
    name: str | None,
    parameters: dict[str, Any],
    scans: list[Scan],
    noise: Noise,
    runs: int,
    seed: int,
) -> FloatArray:
    """`tuning.errors` of a filter, or of no filter, on the test flights, (runs, F, 4)."""
    parts = [vars(measure(scans, noise, (seed, radars.TEST_NOISE, run))) for run in range(runs)]
    together = Tracks(*(np.concatenate([part[key] for part in parts]) for key in parts[0]))
    return errors(name, parameters, together).reshape(
        runs,
        len(scans),
        4,
    )


def _rows(noise: Noise, tuned: dict[str, dict[str, Any]]) -> dict[str, tuple[str, dict[str, Any]]]:
    """Names and parameters of the filters by label: tuned, and those of the thesis as published."""
    published = PARAMETERS[noise]
    # Of gains 1 and 2 / t.
    limit = tuple(1e-6 * variance for variance in published["KF CV"]["variances"])
    return {
        **{name: (name, found) for name, found in tuned.items()},
        **{tables.as_published(name): (name, published[name]) for name in THESIS},
        tables.LIMIT_CV: ("KF CV", published["KF CV"] | {"variances": limit}),
    }


def _example(
    flight: Flight,
    scan: Scan,
    seed: int,
    parameters: dict[Noise, dict[str, dict[str, Any]]],
) -> Example:
    """The first test flight with estimates of every filter."""
    tracks = {noise: measure([scan], noise, (seed, radars.TEST_NOISE, 0)) for noise in NOISES}
    estimates: dict[Noise, dict[str, tuple[FloatArray, FloatArray]]] = {
        noise: {} for noise in NOISES
    }
    for noise in NOISES:
        for label, (name, chosen) in _rows(noise, parameters[noise]).items():
            positions, velocities = run_contender(
                CONTENDERS[name],
                chosen,
                tracks[noise],
            )
            estimates[noise][label] = positions[0], velocities[0]
    return Example(flight, scan, tracks, estimates)
