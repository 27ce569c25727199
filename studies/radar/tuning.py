"""Tuning of the filters with Optuna, which can be killed and resumed: trial n depends on nothing
but the seed and the trials before it, which are kept in a file.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from studies.radar.filters import (
    COMBINED,
    CONTENDERS,
    ROBUST,
    SOUND,
    THESIS,
    Parameters,
    filter_tracks,
)
from studies.radar.flights import FloatArray
from studies.radar.radars import NOISES, Noise, Tracks
from studies.results import in_parallel

# Trials of each tuning.
TRIALS = 60


def errors(name: str | None, parameters: Parameters, tracks: Tracks) -> FloatArray:
    """`Tracks.errors` of a contender; None takes the measurements as positions, and 0 as
    velocity.
    """
    if name is None:
        return tracks.errors(tracks.measurements, np.zeros_like(tracks.velocities))
    filtered = filter_tracks(CONTENDERS[name], parameters, tracks)
    return tracks.errors(filtered.positions, filtered.velocities)


def training_error(name: str, parameters: Parameters, tracks: Tracks) -> float:
    """Mean position RMSE of flights [m], section 2.3.3."""
    return float(errors(name, parameters, tracks)[:, 0].mean())


def tune(
    name: str,
    noise: Noise | None,
    training: dict[Noise, Tracks],
    trials: int,
    seed: int,
    folder: Path,
    plain: Parameters | None = None,
    reference: float = np.nan,
) -> dict[str, Any]:
    """Best parameters by the tree-structured Parzen estimator of Bergstra et al. 2011, from a first
    trial at the start of the contender.

    The cost of a robust filter is its error with Levy noise, raised by its loss with Gaussian noise
    above 0.75 % of the error of the plain CV filter.

    Args:
        name: of the contender.
        noise: of the flights; None for a robust filter, which gets one set of parameters for both.
        training: the flights.
        trials, seed: number of trials, and seed of the tuning.
        folder: for the finished trials, which are continued if code and data are the same; it is
            created.
        plain: of the plain CV filter with Gaussian noise, for robust filters.
        reference: its training error [m].
    """
    contender = CONTENDERS[name]
    known = dict(plain or {})
    flights = training if noise is None else {noise: training[noise]}

    def cost(parameters: Parameters) -> float:
        chosen = {**known, **parameters}
        error = {law: training_error(name, chosen, tracks) for law, tracks in flights.items()}
        if noise is not None:
            return error[noise]
        loss = error["gaussian"] / reference - 1.0
        return error["levy"] * (1.0 + 100.0 * max(loss - 0.0075, 0.0))

    sources = [path.read_text() for path in sorted(Path(__file__).parent.glob("*.py"))]
    tracks = {law: vars(of_law) for law, of_law in flights.items()}
    settings = repr(
        (
            name,
            contender.space,
            contender.start,
            seed,
            known,
            reference,
        )
    )
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name.replace(' ', '_')}-{noise or 'both'}.journal"
    study = optuna.create_study(
        storage=JournalStorage(JournalFileBackend(str(file))),
        study_name=joblib.hash((settings, tracks, sources)),
        load_if_exists=True,
    )
    finished = len(study.get_trials(states=(optuna.trial.TrialState.COMPLETE,)))
    if not finished:
        study.enqueue_trial(dict(contender.start))
    for number in range(finished, min(trials, contender.trials or trials)):
        study.sampler = optuna.samplers.TPESampler(seed=(seed * 100_003 + number) % 2**32)
        trial = study.ask(dict(contender.space))
        study.tell(trial, cost(trial.params))
    return known | study.best_params


def tune_filters(
    training: dict[Noise, Tracks],
    seed: int,
    folder: Path,
    trials: int = TRIALS,
    jobs: int = 1,
    robust: Sequence[str] = tuple(ROBUST),
) -> dict[Noise, dict[str, dict[str, Any]]]:
    """Parameters of all filters by noise and name, tuned on the training flights, the robust ones
    after the plain CV filter, with which they are compared; arguments as of `thesis.reproduce`.
    """
    names = (*SOUND, *THESIS)
    tuned = partial(
        joblib.delayed(tune), training=training, trials=trials, seed=seed, folder=folder
    )
    calls: dict[Any, Any] = {
        (noise, name): tuned(name, noise) for name in names for noise in NOISES
    }
    by_filter = dict(zip(calls, in_parallel([*calls.values()], jobs, "tuning"), strict=True))
    plain = by_filter["gaussian", "CV"]
    reference = training_error("CV", plain, training["gaussian"])
    robustly = [tuned(name, None, plain=plain, reference=reference) for name in robust]
    results = in_parallel(robustly, jobs, "tuning of robust filters")
    both = dict(zip(robust, results, strict=True))
    imm = by_filter["gaussian", "IMM (CV, CA)"]
    student = both["CV, Student-t"]
    both[COMBINED] = imm | {key: student[key] for key in ("degrees of freedom", "scale")}
    return {noise: {name: by_filter[noise, name] for name in names} | both for noise in NOISES}
