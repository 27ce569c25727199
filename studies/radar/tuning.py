"""Tuning of the filters with Optuna, which can be killed and resumed: trial n depends on nothing
but the seed and the trials before it, which are kept in a file.
"""

from pathlib import Path
from typing import Any

import joblib
import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend

from studies.radar.filters import CONTENDERS, Parameters, filter_tracks
from studies.radar.radars import Noise, Tracks, flight_errors

# Trials of each tuning.
TRIALS = 60


def training_error(name: str, parameters: Parameters, tracks: Tracks) -> float:
    """Mean position RMSE of flights [m], section 2.3.3."""
    filtered = filter_tracks(CONTENDERS[name], parameters, tracks)
    return float(flight_errors(filtered.positions, tracks.positions)[:, 0].mean())


def tune(
    name: str,
    noise: Noise | None,
    training: dict[Noise, Tracks],
    trials: int,
    seed: int,
    folder: Path,
    plain: Parameters | None = None,
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
    """
    contender = CONTENDERS[name]
    known = dict(plain or {})
    flights = training if noise is None else {noise: training[noise]}
    reference = training_error("CV", known, training["gaussian"]) if known else np.nan

    def cost(parameters: Parameters) -> float:
        error = [
            training_error(name, {**known, **parameters}, tracks) for tracks in flights.values()
        ]
        if noise is not None:
            return error[0]
        gaussian, levy = error
        return levy * (1.0 + 100.0 * max(gaussian / reference - 1.0 - 0.0075, 0.0))

    sources = [path.read_text() for path in sorted(Path(__file__).parent.glob("*.py"))]
    tracks = [vars(of_law) for of_law in flights.values()]
    settings = repr((name, seed, known))
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
        study.enqueue_trial({key: start for key, (_, start) in contender.space.items()})
    for number in range(finished, trials):
        study.sampler = optuna.samplers.TPESampler(seed=(seed * 100_003 + number) % 2**32)
        trial = study.ask({key: law for key, (law, _) in contender.space.items()})
        study.tell(trial, cost(trial.params))
    return known | study.best_params
