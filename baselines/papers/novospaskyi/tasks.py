"""The work of the study in independent tasks, done here or by several processes."""

import hashlib
import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_EXCEPTION, ProcessPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines import estimation
from baselines.papers.novospaskyi.filters import CONTENDERS, Parameters, run_contender
from baselines.papers.novospaskyi.metrics import flight_errors
from baselines.papers.novospaskyi.radars import NOISES, Noise, Scan, Tracks, measure
from baselines.papers.novospaskyi.tuning import tune

FloatArray = NDArray[np.float64]
Task = tuple[Callable[..., Any], tuple[Any, ...]]

LARGEST_LOSS = 0.0075
"""Loss of the robust filters with Gaussian noise, as a share of the error of CV, that is not penalised."""

PENALTY = 100.0
"""Relative growth of the cost per loss above `LARGEST_LOSS`."""

TRAINING_NOISE, TEST_NOISE = 2, 3
"""Streams of random numbers of a seed; 0 draws the paths and 1 the radars."""

_POLL = 0.3  # seconds between two looks at the progress of other processes


def errors(name: str, parameters: Parameters, tracks: Tracks) -> FloatArray:
    """Position RMSE and MAE [m], velocity RMSE and MAE [m/s] of every flight, (N, 4)."""
    positions, velocities = run_contender(CONTENDERS[name], parameters, tracks)
    return np.stack(
        flight_errors(positions, tracks.positions) + flight_errors(velocities, tracks.velocities), axis=-1
    )


def unfiltered_errors(tracks: Tracks) -> FloatArray:
    """The same, (N, 4), of the measurements as positions, and a velocity of 0."""
    return np.stack(
        flight_errors(tracks.measurements, tracks.positions)
        + flight_errors(np.zeros_like(tracks.velocities), tracks.velocities),
        axis=-1,
    )


@dataclass(frozen=True)
class Tuning:
    """One filter to tune.

    Attributes:
        name: of the contender.
        noise: of the flights; None for a robust filter, which gets one set of parameters for both noises.
        training: measurements of the training flights with each noise.
        trials: number of trials.
        seed: of the sampler.
        folder: of the tuning files; it exists.
        plain: parameters of the plain CV filter with Gaussian noise, for robust filters: their process noise.
        reference: its training error [m].
    """

    name: str
    noise: Noise | None
    training: dict[Noise, Tracks]
    trials: int
    seed: int
    folder: Path
    plain: Parameters = field(default_factory=dict)
    reference: float = np.nan

    @property
    def file(self) -> Path:
        """File of the finished trials."""
        return self.folder / f"{self.name.replace(' ', '_')}-{self.noise or 'both'}.jsonl"

    @property
    def fingerprint(self) -> str:
        """Digest of everything that the cost depends on, also of the source code of the filters."""
        contender = CONTENDERS[self.name]
        digest = hashlib.sha256(
            repr(
                (self.name, contender.space, contender.start, self.seed, self.plain, self.reference)
            ).encode()
        )
        for tracks in self.training.values() if self.noise is None else [self.training[self.noise]]:
            for array in (tracks.times, tracks.measurements, tracks.positions):
                digest.update(array.tobytes())
        for source in sorted(Path(estimation.__file__).parent.glob("*.py")):
            digest.update(source.read_bytes())
        return digest.hexdigest()[:16]

    def cost(self, parameters: Parameters) -> float:
        """Mean position RMSE of the training flights [m] (section 2.3.3).

        For a robust filter that with Levy noise, raised if the loss with Gaussian noise exceeds
        `LARGEST_LOSS`.
        """
        parameters = {**self.plain, **parameters}
        if self.noise is not None:
            return float(errors(self.name, parameters, self.training[self.noise])[:, 0].mean())
        gaussian, levy = (
            float(errors(self.name, parameters, self.training[noise])[:, 0].mean()) for noise in NOISES
        )
        loss = gaussian / self.reference - 1.0
        return levy * (1.0 + PENALTY * max(loss - LARGEST_LOSS, 0.0))

    def run(self) -> dict[str, Any]:
        """The best parameters; finished trials are read from the file."""
        contender = CONTENDERS[self.name]
        best = tune(
            contender.space, contender.start, self.cost, self.trials, self.seed, self.file, self.fingerprint
        )
        return {**self.plain, **best}


def run_tuning(tuning: Tuning) -> dict[str, Any]:
    """`Tuning.run` as a function, for another process."""
    return tuning.run()


def draw_test_tracks(scans: list[Scan], noise: Noise, runs: int, seed: int) -> Tracks:
    """Measurements of the test flights with so many seeds of the noise, run by run: N = runs x flights."""
    parts = [measure(scans, noise, (seed, TEST_NOISE, run)) for run in range(runs)]
    return Tracks(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("times", "measurements", "positions", "velocities")
        )
    )


def evaluate(
    name: str | None, parameters: Parameters, scans: list[Scan], noise: Noise, runs: int, seed: int
) -> FloatArray:
    """`errors` of a filter, or of no filter, on the test flights, (runs, F, 4)."""
    tracks = draw_test_tracks(scans, noise, runs, seed)
    found = unfiltered_errors(tracks) if name is None else errors(name, parameters, tracks)
    return found.reshape(runs, len(scans), 4)


def run_tasks(tasks: Iterable[Task], workers: int, tick: Callable[[int], None]) -> list[Any]:
    """Run functions with their arguments.

    Args:
        tasks: functions and arguments; both can be pickled.
        workers: number of processes; 1 runs the tasks in this one.
        tick: called now and then with the number of finished tasks.

    Returns:
        The results, in the order of the tasks.
    """
    listed = list(tasks)
    if workers == 1 or len(listed) == 1:
        results: list[Any] = []
        for function, arguments in listed:
            tick(len(results))
            results.append(function(*arguments))
        tick(len(results))
        return results
    # spawned, because a process with threads, for example of a progress display, must not be forked
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_end_with_parent) as pool:
        futures = [pool.submit(function, *arguments) for function, arguments in listed]
        try:
            pending = set(futures)
            while pending:
                done, pending = wait(pending, timeout=_POLL, return_when=FIRST_EXCEPTION)
                for future in done:
                    future.result()  # raises its error
                tick(len(futures) - len(pending))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return [future.result() for future in futures]


def _end_with_parent() -> None:
    """End this process when the one that started it is killed; it would wait for tasks for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:

        def wait_for_end() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=wait_for_end, daemon=True).start()
