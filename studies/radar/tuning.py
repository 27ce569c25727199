"""Tuning of the filters with Optuna, which can be killed and resumed: trial n depends on nothing
but the seed and the trials before it, which are read back from a file. So a resumed tuning ends
with the same parameters, bit for bit, and two processes may work on the same file.
"""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count, takewhile
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from numpy.typing import NDArray

from studies.radar.filters import CONTENDERS, Contender, Parameters, run_contender
from studies.radar.radars import Noise, Tracks

FloatArray = NDArray[np.float64]

# Loss of the robust filters with Gaussian noise, as a share of the error of CV, that is not
# penalised.
LARGEST_LOSS = 0.0075
# Relative growth of the cost per loss above `LARGEST_LOSS`.
PENALTY = 100.0


def errors(
    name: str | None,
    parameters: Parameters,
    tracks: Tracks,
) -> FloatArray:
    """`Tracks.errors` of a contender; None takes the measurements as positions, and 0 as
    velocity.
    """
    if name is None:
        return tracks.errors(tracks.measurements, np.zeros_like(tracks.velocities))
    return tracks.errors(*run_contender(CONTENDERS[name], parameters, tracks))


@dataclass(frozen=True)
class Tuning:
    """One filter to tune, with its files in an existing folder."""

    name: str
    # Of the flights; a robust filter gets one set of parameters for both noises.
    noise: Noise | None
    training: dict[Noise, Tracks]
    trials: int
    seed: int
    folder: Path
    # Of the plain CV filter with Gaussian noise, for robust filters.
    plain: Parameters = field(default_factory=dict)
    # Its training error [m].
    reference: float = np.nan

    @property
    def fingerprint(self) -> str:
        """Digest of everything that the cost depends on, also of the source code here."""
        contender = CONTENDERS[self.name]
        settings = (
            self.name,
            contender.space,
            contender.start,
            self.seed,
            self.plain,
            self.reference,
        )
        digest = hashlib.sha256(repr(settings).encode())
        for tracks in self._flights.values():
            for array in (tracks.times, tracks.measurements, tracks.positions):
                digest.update(array.tobytes())
        for source in sorted(Path(__file__).parent.glob("*.py")):
            digest.update(source.read_bytes())
        return digest.hexdigest()[:16]

    def cost(self, parameters: Parameters) -> float:
        """Mean position RMSE of the training flights [m] (section 2.3.3); for a robust filter that
        with Levy noise, raised if the loss with Gaussian noise exceeds `LARGEST_LOSS`.
        """
        chosen = {**self.plain, **parameters}
        error = {
            noise: float(errors(self.name, chosen, of)[:, 0].mean())
            for noise, of in self._flights.items()
        }
        if self.noise is not None:
            return error[self.noise]
        loss = error["gaussian"] / self.reference - 1.0
        return error["levy"] * (1.0 + PENALTY * max(loss - LARGEST_LOSS, 0.0))

    @property
    def _flights(self) -> dict[Noise, Tracks]:
        return self.training if self.noise is None else {self.noise: self.training[self.noise]}

    def run(self) -> dict[str, Any]:
        """The best parameters; finished trials are read from the file."""
        contender = CONTENDERS[self.name]
        trials = min(self.trials, contender.trials or self.trials)
        file = self.folder / f"{self.name.replace(' ', '_')}-{self.noise or 'both'}.jsonl"
        return {
            **self.plain,
            **tune(contender, self.cost, trials, self.seed, file, self.fingerprint),
        }


def tune(
    contender: Contender,
    cost: Callable[[Parameters], float],
    trials: int,
    seed: int,
    file: Path,
    fingerprint: str,
) -> dict[str, Any]:
    """Best parameters by the tree-structured Parzen estimator of Bergstra et al. 2011, from a first
    trial at the start. Finished trials are appended to the file; its lines with another
    fingerprint, see `Tuning.fingerprint`, are ignored.
    """
    verbosity = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        study = optuna.create_study()
        finished = finished_trials(file, fingerprint)[:trials]
        for number in range(trials):
            known = finished[number] if number < len(finished) else None
            if known is not None or number == 0:
                study.enqueue_trial(dict(contender.start) if known is None else known[0])
            study.sampler = optuna.samplers.TPESampler(seed=(seed * 100_003 + number) % 2**32)
            trial = study.ask(dict(contender.space))
            value = float(cost(trial.params)) if known is None else known[1]
            if known is None:
                entry = {
                    "fingerprint": fingerprint,
                    "trial": number,
                    "parameters": trial.params,
                    "value": value,
                }
                _append(file, entry)
            study.tell(trial, value)
        return dict(study.best_params)
    finally:
        optuna.logging.set_verbosity(verbosity)


def finished_trials(file: Path, fingerprint: str) -> list[tuple[dict[str, Any], float]]:
    """Parameters and values of the finished trials 0, 1, 2 ... of a file with this fingerprint."""
    text = file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""
    found: dict[int, tuple[dict[str, Any], float]] = {}
    for line in text.splitlines():
        try:
            entry = json.loads(line)
            if entry["fingerprint"] == fingerprint:
                found.setdefault(
                    int(entry["trial"]),
                    (dict(entry["parameters"]), float(entry["value"])),
                )
        except (ValueError, KeyError, TypeError):
            # The line that a killed process was writing.
            continue
    return [found[number] for number in takewhile(found.__contains__, count())]


def _append(file: Path, entry: dict[str, Any]) -> None:
    """Append a trial as one line, in one write."""
    # Begins with a line break, as the last line may be cut off.
    line = f"\n{json.dumps(entry)}\n".encode()
    with file.open("ab", buffering=0) as stored:
        stored.write(line)
