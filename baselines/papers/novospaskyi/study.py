"""The study: flights, tuning on 30 % of them, errors on the others, next to the published tables."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from baselines.papers.novospaskyi import tables
from baselines.papers.novospaskyi.filters import COMBINED, CONTENDERS, ROBUST, SOUND, THESIS, run_contender
from baselines.papers.novospaskyi.flights import FLIGHTS, Flight, point_mass_flights
from baselines.papers.novospaskyi.radars import (
    NOISES,
    TEST_NOISE,
    TRAINING_NOISE,
    TRAINING_SHARE,
    Noise,
    Scan,
    Tracks,
    measure,
    scan_flight,
)
from baselines.papers.novospaskyi.tables import PAPER, PARAMETERS, UNFILTERED, without_noise
from baselines.papers.novospaskyi.tuning import Tuning, errors
from baselines.papers.reproduction import Reproduction
from hybrid_env.checks import FloatArray, check_integer, reject

Progress = Callable[[str, int, int], None]
Calls = Mapping[Any, Callable[[], Any]]
# Runs independent calls by name, and calls back with the name of each that has ended.
Run = Callable[[Calls, Callable[[Any], None]], Iterator[tuple[Any, Any]]]
TRIALS = 60  # trials of each tuning
RUNS = 10  # seeds of the noise on the test flights
PART = 10  # trials of a tuning in one call


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


def one_by_one(calls: Calls, on_done: Callable[[Any], None]) -> Iterator[tuple[Any, Any]]:
    """A `Run` in this process."""
    for name, call in calls.items():
        result = call()
        on_done(name)
        yield name, result


def reproduce(
    runs: int = RUNS,
    seed: int = 0,
    *,
    folder: Path,
    flights: int = FLIGHTS,
    trials: int = TRIALS,
    fly: Callable[[int, int], list[Flight]] = point_mass_flights,
    run: Run = one_by_one,
    progress: Progress = lambda stage, done, total: None,
) -> Reproduction:
    """Reproduce tables 3.5 and 3.6, and compare them with sound settings and robust filters.

    Args:
        runs: number of seeds of the noise on the test flights, at least 1.
        seed: of flights, radars, noise and tuning.
        folder: for finished trials, from which a killed run goes on; it is created.
        flights: number of flights, at least 4.
        trials: number of trials of each tuning.
        fly: returns a number of flights for a seed.
        run: where tunings and evaluations run, for example in several processes. It does not change
            the results.
        progress: called with the stage, the work done and the total.

    Raises:
        ArgumentError: an argument is out of range, or `folder` cannot be written.
    """
    runs, seed = check_integer("runs", runs), check_integer("seed", seed, minimum=0)
    flights, trials = check_integer("flights", flights, 4), check_integer("trials", trials)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise reject("folder", str(folder), f"a writable folder ({error.strerror})") from None
    work = _Work(run, progress)
    flown = fly(flights, seed)
    scans = [scan_flight(flight, np.random.default_rng((seed, 1, k))) for k, flight in enumerate(flown)]
    count = round(TRAINING_SHARE * flights)
    training = {noise: measure(scans[:count], noise, (seed, TRAINING_NOISE)) for noise in NOISES}
    parameters = tune_filters(training, seed, folder, trials, run, progress)
    results = tables.Results(_evaluate(work, parameters, scans[count:], runs, seed), parameters)
    return Reproduction(
        PAPER, runs, seed, tables.cells(results, seed), tables.findings(results, seed, flights, count),
        {"flight": _example(flown[count], scans[count], seed, parameters)}, RUNS, f"{FLIGHTS} flights",
    )  # fmt: skip


@dataclass(frozen=True)
class _Work:
    """Where calls run, and who is told about their progress."""

    run: Run
    progress: Progress

    def results(self, stage: str, calls: Calls, before: int = 0, total: int | None = None) -> dict[Any, Any]:
        """Results by name of calls of a stage, of which `before` are done."""
        done = before

        def show(_: Any) -> None:
            nonlocal done
            done += 1
            self.progress(stage, done, total or len(calls))

        self.progress(stage, done, total or len(calls))
        return dict(self.run(calls, show))


def tune_filters(
    training: dict[Noise, Tracks],
    seed: int,
    folder: Path,
    trials: int = TRIALS,
    run: Run = one_by_one,
    progress: Progress = lambda stage, done, total: None,
    robust: Sequence[str] = tuple(ROBUST),
) -> dict[Noise, dict[str, dict[str, Any]]]:
    """Return the parameters of all filters by noise and name, tuned on the training flights.

    The robust ones are tuned after the plain CV filter, with which they are compared. Arguments as of
    `reproduce`; `robust` are the names of the robust ones.
    """
    work = _Work(run, progress)
    tuning = partial(Tuning, training=training, trials=trials, seed=seed, folder=folder)
    names = sorted(THESIS | SOUND, key=lambda name: "IMM" not in name)  # the longest first
    tunings = {(noise, name): tuning(name, noise) for name in names for noise in NOISES}
    count = len(tunings) + len(robust)
    found = _tune_in_parts(work, tunings, 0, count)
    parameters = {noise: {name: found[noise, name] for name in names} for noise in NOISES}
    plain = parameters["gaussian"]["CV"]
    reference = tuning("CV", "gaussian").cost(plain)
    later = {name: tuning(name, None, plain=plain, reference=reference) for name in robust}
    found = _tune_in_parts(work, later, len(tunings), count)
    imm, student = parameters["gaussian"]["IMM (CV, CA)"], found["CV, Student-t"]
    found[COMBINED] = imm | {key: student[key] for key in ("degrees of freedom", "scale")}
    return {noise: parameters[noise] | found for noise in NOISES}


def _tune_in_parts(work: _Work, tunings: dict[Any, Tuning], before: int, count: int) -> dict[Any, Any]:
    """Best parameters by name; each part continues the trials of the one before, so that progress is seen.

    Of `count` tunings in all, `before` are done.
    """
    trials = next(iter(tunings.values())).trials
    parts = range(0, trials, PART)
    found: dict[Any, Any] = {}
    for number, done in enumerate(parts):
        calls = {name: replace(one, trials=min(done + PART, trials)).run for name, one in tunings.items()}
        finished = before * len(parts) + number * len(tunings)
        found = work.results("tuning", calls, finished, count * len(parts))
    return found


def draw_test_tracks(scans: list[Scan], noise: Noise, runs: int, seed: int) -> Tracks:
    """Measurements of the test flights with `runs` seeds of the noise, run by run: N = runs x flights."""
    parts = [measure(scans, noise, (seed, TEST_NOISE, run)) for run in range(runs)]
    return Tracks(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Tracks)))


def evaluate(
    name: str | None, parameters: dict[str, Any], scans: list[Scan], noise: Noise, runs: int, seed: int
) -> FloatArray:
    """`tuning.errors` of a filter, or of no filter, on the test flights, (runs, F, 4)."""
    return errors(name, parameters, draw_test_tracks(scans, noise, runs, seed)).reshape(runs, len(scans), 4)


def _rows(noise: Noise, tuned: dict[str, dict[str, Any]]) -> dict[str, tuple[str, dict[str, Any]]]:
    """Names and parameters of the filters by label: tuned, and those of the thesis as published."""
    published = PARAMETERS[noise]
    return {
        **{name: (name, found) for name, found in tuned.items()},
        **{tables.as_published(name): (name, published[name]) for name in THESIS},
        tables.LIMIT_CV: ("KF CV", without_noise(published["KF CV"])),
    }


def _evaluate(
    work: _Work, parameters: dict[Noise, dict[str, dict[str, Any]]], scans: list[Scan], runs: int, seed: int
) -> dict[Noise, dict[str, FloatArray]]:
    """Errors on the test flights with the tuned and with the published parameters, see `tables.Results`."""
    calls = {}
    for noise in NOISES:
        for label, (name, chosen) in {UNFILTERED: (None, {}), **_rows(noise, parameters[noise])}.items():
            calls[noise, label] = partial(evaluate, name, chosen, scans, noise, runs, seed)
    found: dict[Noise, dict[str, FloatArray]] = {noise: {} for noise in NOISES}
    for (noise, label), values in work.results("test flights", calls).items():
        found[noise][label] = values
    return found


def _example(flight: Flight, scan: Scan, seed: int, parameters: dict[Noise, dict[str, dict[str, Any]]]) -> Example:
    """The first test flight with estimates of every filter."""
    tracks = {noise: draw_test_tracks([scan], noise, 1, seed) for noise in NOISES}
    estimates: dict[Noise, dict[str, tuple[FloatArray, FloatArray]]] = {noise: {} for noise in NOISES}
    for noise in NOISES:
        for label, (name, chosen) in _rows(noise, parameters[noise]).items():
            positions, velocities = run_contender(CONTENDERS[name], chosen, tracks[noise])
            estimates[noise][label] = positions[0], velocities[0]
    return Example(flight, scan, tracks, estimates)
