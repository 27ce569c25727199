"""The agent on simulators of others beside rules that are tuned in each world: `compare --simulators`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import norm

from agents.evaluation.simulators import SimulatorTask, simulator_worlds
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import FURTHER_STYLES
from agents.interface.parallel import Workers
from agents.studies.shifts import Shift, differences, differences_json, evaluate_shifts
from baselines.recordings.simulators.aircraft import AIRCRAFT
from baselines.recordings.simulators.tracks import SimulatedTracks
from baselines.scoring.estimates import Estimate
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

EPISODES = 40  # flights of a quarter of an hour: 10 h a world
FLIGHTS = 8  # for the mismatch
LEVEL = 0.05
ALLOWED = 0.01
"""Reward by which the agent may be below the best rule and still not lose."""


def compare_on_simulators(
    names: Sequence[str], episodes: int, seed: int, workers: Workers, on_progress: Callable[[str], None]
) -> list[Shift]:
    """Evaluate deciders in all worlds, see `evaluate_shifts`: all but the first are tuned in each of them."""
    return evaluate_shifts(names, simulator_worlds(), episodes, seed, workers, on_progress, names[:1])


def simulators_json(results: Sequence[Shift], mismatches: Mapping[str, float]) -> dict[str, Any]:
    """Return all figures, what `summary` counts, and the mismatch of each world."""
    found: dict[str, Any] = {"results": [one.as_json() for one in results], "mismatches": dict(mismatches)}
    if len({one.decider for one in results}) > 1:
        found |= {"differences": differences_json(results)} | counts(results)
    return found


def mismatch(task: SimulatorTask, seed: int) -> float:
    """Return the mean squared whitened innovation of a coordinate, 1 where the model of the bank is true.

    It is weighted by the posterior of the hypotheses, which the bank computes with the nominal process noise.
    """
    options = task.options_with({})
    assert isinstance(options, QuickestOptions)
    tracks, layout = SimulatedTracks(task.kind, options, FLIGHTS), QuickestLayout(options.hypotheses)
    rows, _ = tracks.reset(seed=seed)
    squares = []
    for _ in range(options.ticks - 1):
        rows, *_ = tracks.step(np.zeros(FLIGHTS, np.int64))
        each = sum(layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across"))
        squares.append(0.5 * (np.exp(layout.read(rows, "log_probability")) * each).sum(-1))
    return float(np.mean(squares))


def mismatch_figure(results: Sequence[Shift], mismatches: Mapping[str, float]) -> Figure:
    """Draw the gain of the first decider over the best tuned other one against the mismatch of the world."""
    gains = differences(results)
    curves = []
    for (kind, craft), style in zip(AIRCRAFT.items(), FURTHER_STYLES, strict=False):
        worlds = sorted((world for world in gains if world.startswith(kind)), key=lambda world: mismatches[world])
        if not worlds:
            continue
        nominal = [gains[world][2] for world in worlds]
        bars = np.array([[one.value - one.low, one.high - one.value] for one in nominal]).T
        points = [mismatches[world] for world in worlds], [one.value for one in nominal]
        curves.append(Curve(f"{kind} ({craft.name})", style, *points, bars=bars, dashes=":", filled=True))
    x = Axis("mean squared whitened innovation of a coordinate (1: the model is true)", levels=(1.0,))
    y = Axis("reward less that of the best tuned rule", levels=(0.0, -ALLOWED))
    title = f"{results[0].decider} on aircraft of JSBSim"
    return curve_figure([[Panel("", x, y, curves)]], (8.0, 5.0), title)


def counts(results: Sequence[Shift]) -> dict[str, int]:
    """Return in how many worlds the first decider, untuned, keeps up with the best tuned other one.

    Returns:
        worlds; kept: at most .01 below; above: the difference above 0, and below: below 0, by Holm's
        correction over all worlds.
    """
    gains = [nominal for _, _, nominal in differences(results).values()]
    sure = holm([p_value(gain) for gain in gains])
    return {
        "worlds": len(gains),
        "kept": sum(gain.value >= -ALLOWED for gain in gains),
        "above": sum(one and gain.value > 0.0 for one, gain in zip(sure, gains, strict=True)),
        "below": sum(one and gain.value < 0.0 for one, gain in zip(sure, gains, strict=True)),
    }


def p_value(gain: Estimate) -> float:
    """Return the two-sided p-value of a difference, from its interval as one of a normal distribution."""
    deviation = (gain.high - gain.low) / (2.0 * norm.ppf(1.0 - LEVEL / 2.0))
    return float(2.0 * norm.sf(abs(gain.value) / deviation)) if deviation > 0.0 else 1.0


def holm(values: Sequence[float]) -> list[bool]:
    """Return which of some p-values are significant at 5 % together. Holm 1979."""
    order = np.argsort(values)
    passed = np.sort(values) * np.arange(len(values), 0, -1) <= LEVEL
    found = np.zeros(len(values), np.bool_)
    found[order[: int(np.logical_and.accumulate(passed).sum())]] = True
    return [bool(one) for one in found]


def summary(results: Sequence[Shift]) -> str:
    """Return the counts as a sentence."""
    first = results[0].decider
    found = counts(results)
    return (
        f"{first} at its default threshold beside the best other decider, whose threshold and process noise "
        f"are tuned in each world: at most {ALLOWED:g} below in {found['kept']} of {found['worlds']} worlds; "
        f"above in {found['above']} and below in {found['below']} by Holm's correction."
    )
