"""Tuning with Optuna that can be killed and resumed.

Each tuning has a file of its own with one line per finished trial. It is read back into an Optuna study
at the start. Trial n depends on nothing but the seed and the trials before it, so that a resumed tuning
ends with the same parameters, bit for bit, and two processes that do the same work at once do no harm.
"""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import optuna
from optuna.distributions import BaseDistribution

from hybrid_env.checks import ArgumentError


def tune(
    space: Mapping[str, BaseDistribution],
    start: Mapping[str, Any],
    cost: Callable[[Mapping[str, Any]], float],
    trials: int,
    seed: int,
    file: Path,
    fingerprint: str,
) -> dict[str, Any]:
    """Minimise a cost by the tree-structured Parzen estimator of Bergstra et al. 2011.

    Args:
        space: distribution of each parameter.
        start: parameters of the first trial.
        cost: function of the parameters.
        trials: number of trials.
        seed: of the sampler.
        file: finished trials are appended to it; its folder exists.
        fingerprint: of everything that the cost depends on; lines with another one are ignored.

    Returns:
        The best parameters.

    Raises:
        ArgumentError: the file cannot be read or written.
    """
    verbosity = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        study = optuna.create_study()
        finished = finished_trials(file, fingerprint)
        for number in range(trials):
            if number < len(finished):
                parameters, value = finished[number]
            else:
                if number == 0:
                    parameters = dict(start)
                else:
                    study.sampler = optuna.samplers.TPESampler(seed=(seed * 100_003 + number) % 2**32)
                    trial = study.ask(dict(space))
                    parameters = trial.params
                value = float(cost(parameters))
                _append(file, fingerprint, number, parameters, value)
                if number:
                    study.tell(trial, value)
                    continue
            study.add_trial(
                optuna.trial.create_trial(params=parameters, distributions=dict(space), value=value)
            )
        return dict(study.best_params)
    finally:
        optuna.logging.set_verbosity(verbosity)


def finished_trials(file: Path, fingerprint: str) -> list[tuple[dict[str, Any], float]]:
    """Parameters and values of the finished trials 0, 1, 2 ... of a file, none if it has another fingerprint.

    Raises:
        ArgumentError: the file cannot be read.
    """
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines() if file.exists() else []
    except OSError as error:
        raise ArgumentError(f"{file} cannot be read: {error}") from None
    found: dict[int, tuple[dict[str, Any], float]] = {}
    for line in lines:
        try:
            entry = json.loads(line)
            if entry["fingerprint"] == fingerprint:
                found.setdefault(int(entry["trial"]), (dict(entry["parameters"]), float(entry["value"])))
        except (ValueError, KeyError, TypeError):  # the line that a killed process was writing
            continue
    finished: list[tuple[dict[str, Any], float]] = []
    while len(finished) in found:
        finished.append(found[len(finished)])
    return finished


def _append(file: Path, fingerprint: str, number: int, parameters: Mapping[str, Any], value: float) -> None:
    """Append a trial as one line, in one write."""
    entry = {"fingerprint": fingerprint, "trial": number, "parameters": dict(parameters), "value": value}
    line = f"\n{json.dumps(entry)}\n".encode()  # begins with a line break, as the last line may be cut off
    try:
        descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            os.write(descriptor, line)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise ArgumentError(f"{file} cannot be written: {error}") from None
