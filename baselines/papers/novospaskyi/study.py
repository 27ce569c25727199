"""The study: flights, tuning on 30 % of them, errors on the others, next to the published tables."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.papers.novospaskyi import tables
from baselines.papers.novospaskyi.anomaly import without_noise
from baselines.papers.novospaskyi.filters import COMBINED, CONTENDERS, ROBUST, SOUND, THESIS, run_contender
from baselines.papers.novospaskyi.flights import FLIGHTS, Flight, generate_flights
from baselines.papers.novospaskyi.point_mass import fly_point_masses
from baselines.papers.novospaskyi.published import PAPER, PARAMETERS, UNFILTERED
from baselines.papers.novospaskyi.quadrotor import import_engine
from baselines.papers.novospaskyi.radars import NOISES, Noise, Scan, Tracks, measure, scan_flight
from baselines.papers.novospaskyi.stored_flights import flight_file, fly_and_store, load_flight
from baselines.papers.novospaskyi.tasks import (
    TRAINING_NOISE,
    Task,
    Tuning,
    draw_test_tracks,
    evaluate,
    run_tasks,
    run_tuning,
)
from baselines.papers.reproduction import Reproduction
from hybrid_env.checks import check_integer, reject

FloatArray = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

TRAINING_SHARE = 0.3
TRIALS = 60
"""Trials of each tuning."""

RUNS = 10
"""Seeds of the noise on the test flights."""

BATCH = 32  # attempts of flights at once


@dataclass(frozen=True)
class Example:
    """One test flight for the figures.

    Attributes:
        flight: as flown.
        scan: what its radars see.
        tracks: its measurements with each noise.
        estimates: positions and velocities of filters by name, for each noise.
    """

    flight: Flight
    scan: Scan
    tracks: dict[Noise, Tracks]
    estimates: dict[Noise, dict[str, tuple[FloatArray, FloatArray]]]


def reproduce(
    runs: int = RUNS,
    seed: int = 0,
    *,
    folder: Path,
    physics: bool = False,
    flights: int = FLIGHTS,
    trials: int = TRIALS,
    workers: int = 1,
    progress: Progress = lambda stage, done, total: None,
) -> Reproduction:
    """Reproduce tables 3.5 and 3.6, and compare them with sound settings and robust filters.

    Args:
        runs: number of seeds of the noise on the test flights, at least 1.
        seed: of flights, radars, noise and tuning.
        folder: for finished trials and flights, from which a killed run goes on; it is created.
        physics: fly a quadrotor in PyBullet instead of a point mass.
        flights: number of flights, at least 4.
        trials: number of trials of each tuning.
        workers: number of processes. It does not change the results.
        progress: called with the stage, the work done and the total.

    Raises:
        ArgumentError: an argument is out of range, `folder` cannot be written, or PyBullet is not installed.
    """
    runs, seed = check_integer("runs", runs), check_integer("seed", seed, minimum=0)
    flights, trials = check_integer("flights", flights, 4), check_integer("trials", trials)
    check_integer("workers", workers)
    if physics:
        import_engine()
    folder = folder / ("quadrotor" if physics else "point-mass")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise reject("folder", str(folder), f"a writable folder ({error.strerror})") from None
    flown = (
        _quadrotor_flights(folder, flights, seed, workers, progress)
        if physics
        else list(generate_flights(flights, seed, fly_point_masses, BATCH))
    )
    scans = [scan_flight(flight, np.random.default_rng((seed, 1, k))) for k, flight in enumerate(flown)]
    count = round(TRAINING_SHARE * flights)
    training = {noise: measure(scans[:count], noise, (seed, TRAINING_NOISE)) for noise in NOISES}
    parameters = _tune(training, trials, seed, folder, workers, progress)
    errors = _evaluate(parameters, scans[count:], runs, seed, workers, progress)
    results = tables.Results(errors, parameters)
    return Reproduction(
        PAPER, runs, seed, tables.cells(results, seed), tables.findings(results, seed, flights, count),
        {"flight": _example(flown[count], scans[count], seed, parameters)}, RUNS,
    )  # fmt: skip


def _quadrotor_flights(folder: Path, count: int, seed: int, workers: int, progress: Progress) -> list[Flight]:
    """The first successful quadrotor flights, from files where they are there."""
    flown: list[Flight] = []
    attempt = 0
    while len(flown) < count:
        # no more attempts than can be needed, so that the number of processes does not matter
        batch = range(attempt, attempt + count - len(flown))
        before = len(flown)

        def show(done: int, before: int = before) -> None:
            progress("flights", before + done, count)

        run_tasks([(fly_and_store, (folder, seed, number)) for number in batch], workers, show)
        loaded = [load_flight(flight_file(folder, seed, number), seed, number)[1] for number in batch]
        flown += [flight for flight in loaded if flight is not None]
        attempt = batch.stop
    return flown


def _tune(
    training: dict[Noise, Tracks], trials: int, seed: int, folder: Path, workers: int, progress: Progress
) -> dict[Noise, dict[str, dict[str, Any]]]:
    """Tune all filters, the robust ones after the plain CV filter, with which they are compared."""
    tunings = [
        Tuning(name, noise, training, trials, seed, folder)
        for name in sorted(THESIS | SOUND, key=lambda name: "IMM" not in name)  # the longest first
        for noise in NOISES
    ]
    total = trials * (len(tunings) + len(ROBUST))

    def run(group: list[Tuning]) -> list[dict[str, Any]]:
        files = [tuning.file for tuning in tunings]
        tasks: list[Task] = [(run_tuning, (tuning,)) for tuning in group]
        return run_tasks(tasks, workers, lambda _: progress("tuning", _lines(files, trials), total))

    parameters: dict[Noise, dict[str, dict[str, Any]]] = {noise: {} for noise in NOISES}
    for tuning, best in zip(tunings, run(tunings), strict=True):
        assert tuning.noise is not None
        parameters[tuning.noise][tuning.name] = best
    plain = parameters["gaussian"]["CV"]
    reference = Tuning("CV", "gaussian", training, trials, seed, folder).cost(plain)
    robust = [Tuning(name, None, training, trials, seed, folder, plain, reference) for name in ROBUST]
    tunings += robust
    for tuning, best in zip(robust, run(robust), strict=True):
        for noise in NOISES:
            parameters[noise][tuning.name] = best
    imm, student = parameters["gaussian"]["IMM (CV, CA)"], parameters["gaussian"]["CV, Student-t"]
    for noise in NOISES:
        parameters[noise][COMBINED] = imm | {key: student[key] for key in ("degrees of freedom", "scale")}
    return parameters


def _lines(files: list[Path], most: int) -> int:
    """Number of finished trials in the files."""
    return sum(min(file.read_bytes().count(b'{"fing'), most) for file in files if file.exists())


def _evaluate(
    parameters: dict[Noise, dict[str, dict[str, Any]]],
    scans: list[Scan],
    runs: int,
    seed: int,
    workers: int,
    progress: Progress,
) -> dict[Noise, dict[str, FloatArray]]:
    """Errors on the test flights with the tuned and with the published parameters, see `tables.Results`."""
    rows: list[tuple[Noise, str, str | None, dict[str, Any]]] = []  # noise, label, filter, parameters
    for noise in NOISES:
        rows += [(noise, UNFILTERED, None, {})]
        rows += [(noise, name, name, parameters[noise][name]) for name in CONTENDERS]
        rows += [(noise, tables.as_published(name), name, PARAMETERS[noise][name]) for name in THESIS]
        rows += [(noise, tables.LIMIT_CV, "KF CV", without_noise(PARAMETERS[noise]["KF CV"]))]
    tasks: list[Task] = [
        (evaluate, (name, chosen, scans, noise, runs, seed)) for noise, _, name, chosen in rows
    ]
    found = run_tasks(tasks, workers, lambda done: progress("test flights", done, len(rows)))
    errors: dict[Noise, dict[str, FloatArray]] = {noise: {} for noise in NOISES}
    for (noise, label, _, _), values in zip(rows, found, strict=True):
        errors[noise][label] = values
    return errors


def _example(
    flight: Flight, scan: Scan, seed: int, parameters: dict[Noise, dict[str, dict[str, Any]]]
) -> Example:
    """The first test flight with estimates of every filter, and of KF CV with the published parameters."""
    tracks = {noise: draw_test_tracks([scan], noise, 1, seed) for noise in NOISES}
    estimates: dict[Noise, dict[str, tuple[FloatArray, FloatArray]]] = {}
    for noise in NOISES:
        chosen = dict(parameters[noise])
        estimates[noise] = {}
        for name, values in chosen.items():
            positions, velocities = run_contender(CONTENDERS[name], values, tracks[noise])
            estimates[noise][name] = positions[0], velocities[0]
        positions, velocities = run_contender(CONTENDERS["KF CV"], PARAMETERS[noise]["KF CV"], tracks[noise])
        estimates[noise][tables.as_published("KF CV")] = positions[0], velocities[0]
    return Example(flight, scan, tracks, estimates)
