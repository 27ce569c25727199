"""What limits a statement of the present mode: rules with more and more information on the same tracks."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.operating_curve import Estimate
from agents.evaluation.statement_curve import (
    FULL_DELAY,
    REWARD,
    RIGHT,
    WRONG_CHANGES,
    StatementCurve,
    TrackMetrics,
    joined_tracks,
    mean_of,
    sweep_statements,
    track_metrics,
)
from agents.evaluation.statement_deciders import beam_family, geometric_beam_family, threshold_family
from agents.interface.parallel import Call
from agents.limits.study import NOISE_LEVELS
from baselines.estimation.beam_smoother import BeamSmoother
from baselines.rules import seeds
from baselines.rules.statements import Statements, record_statements
from baselines.rules.threshold import ThresholdDecider
from hybrid_env.quickest_options import QuickestOptions

FloatArray = NDArray[np.float64]
LAWS = ("25 + geometric 50", "uniform 50-100")
LAGS = (5, 10, 20, 40)  # ticks
SMOOTHED_TRACKS = 500  # in a batch, which needs about 100 MB
IMM, THRESHOLD = "IMM, the most probable mode", "IMM, tuned threshold"
GEOMETRIC, BEAM = "beam, geometric law of durations", "beam, true law of durations"
LATER = {lag: f"with the measurements of {lag} later ticks (off line)" for lag in LAGS}
STEPS = (IMM, THRESHOLD, GEOMETRIC, BEAM, *LATER.values())
"""The steps in the order of their information."""


@dataclass(frozen=True)
class StatementStep:
    """Figures of one step for one law of the durations at one noise level.

    Attributes:
        law: of the durations.
        noise: variance R of a measured coordinate [m^2].
        step: one of `STEPS`.
        threshold: on the probability of the mode to which the statement changes, selected on other tracks.
        reward: mean reward of a tick.
        gain: difference to the step before on the same tracks, None for the first.
        delay: mean delay of a switch; one that is not detected counts until the end of its segment [ticks].
        wrong_changes: changes of the statement to a wrong mode per 1,000 ticks.
        most_probable_right: share of ticks at which the most probable mode is the true one, without a
            threshold.
    """

    law: str
    noise: float
    step: str
    threshold: float
    reward: Estimate
    gain: Estimate | None
    delay: Estimate
    wrong_changes: Estimate
    most_probable_right: Estimate

    def as_json(self) -> dict[str, Any]:
        """Return plain values."""
        values = vars(self).items()
        return {name: one.as_json() if isinstance(one, Estimate) else one for name, one in values}


def statement_calls(tracks: int, seed: int) -> dict[str, Call]:
    """Return the calls of `evaluate_statement_steps` for every law and noise level, by what they evaluate.

    Args:
        tracks: number of tracks. A third as many others (at least 50) serve to select thresholds.
        seed: of the first track.
    """
    return {
        f"{law}, R = {noise:g}": functools.partial(evaluate_statement_steps, law, noise, tracks, seed)
        for law in LAWS
        for noise in NOISE_LEVELS
    }


def evaluate_statement_steps(law: str, noise: float, tracks: int, seed: int) -> list[StatementStep]:
    """Evaluate every step for a law and a noise level on the same tracks; see `statement_calls`."""
    options = QuickestOptions(durations=law, measurement_variance=noise)
    selection = _curves(options, max(tracks // 3, 50), seeds.SELECTION)
    found = []
    before: StatementCurve | None = None
    for step, curve in _curves(options, tracks, seed).items():
        index = selection[step].best_index()
        chosen = curve.at(index)
        found.append(
            StatementStep(
                law, noise, step,
                threshold=curve.family.thresholds[index],
                reward=chosen.estimate(mean_of(REWARD)),
                gain=None if before is None else chosen.difference(before, mean_of(REWARD)),
                delay=chosen.estimate(FULL_DELAY),
                wrong_changes=chosen.estimate(mean_of(WRONG_CHANGES)),
                most_probable_right=curve.at(0).estimate(mean_of(RIGHT)),  # at threshold 0
            )
        )  # fmt: skip
        before = chosen
    return found


def _curves(options: QuickestOptions, tracks: int, seed: int) -> dict[str, StatementCurve]:
    """Return the curves of all steps; the first threshold of each is 0."""
    imm = sweep_statements(threshold_family(options), options, tracks, seed)
    geometric = sweep_statements(geometric_beam_family(options), options, tracks, seed)
    family = beam_family(options)
    smoothed = smoothed_curves(family, options, tracks, seed, (0, *LAGS))
    curves = {IMM: imm.at(0), THRESHOLD: imm, GEOMETRIC: geometric, BEAM: smoothed[0]}
    return curves | {LATER[lag]: smoothed[lag] for lag in LAGS}


def smoothed_curves(
    family: DeciderFamily, options: QuickestOptions, tracks: int, seed: int, lags: Sequence[int]
) -> dict[int, StatementCurve]:
    """Return the curve of the threshold rule on the posterior given measurements of later ticks, by lag.

    Args:
        family: of beams; all thresholds have the same posterior.
        options: of the environment.
        tracks: number of tracks.
        seed: of the first track.
        lags: numbers of later ticks; 0 is the beam itself.
    """
    batches: dict[int, list[list[TrackMetrics]]] = {lag: [] for lag in lags}
    for first in range(0, tracks, SMOOTHED_TRACKS):
        smoother: Any = BeamSmoother(family.make(family.default), lags)  # type: ignore[arg-type]
        count = min(SMOOTHED_TRACKS, tracks - first)
        true_modes, _ = record_statements(smoother, count, seed + first, **vars(options))
        for lag in lags:
            with np.errstate(divide="ignore"):
                log_probability = np.log(smoother.posterior(lag))
            batches[lag].append(
                [
                    track_metrics(
                        Statements(true_modes, statements_of(threshold, log_probability)), options.change_cost
                    )
                    for threshold in family.thresholds
                ]
            )
    names = {lag: f"{family.name}, {lag} ticks later" if lag else family.name for lag in lags}
    return {lag: joined_tracks(replace(family, name=names[lag]), batches[lag]) for lag in lags}


def statements_of(threshold: float, log_probability: FloatArray) -> NDArray[np.int64]:
    """Return the statements of the threshold rule, (T, N), from log probabilities (T, N, M)."""
    rule = ThresholdDecider(threshold)
    stated = np.zeros(log_probability.shape[:2], np.int64)
    for tick, values in enumerate(log_probability):
        stated[tick] = rule.choose(values, stated[tick - 1], np.full(len(values), tick > 0))
    return stated
