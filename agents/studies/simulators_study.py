"""The agent on simulators of others beside rules that are tuned in each world: `compare
--simulators`.
"""

from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import norm

from agents.evaluation import simulators
from agents.evaluation.simulators import SimulatorTask
from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import FURTHER_STYLES
from agents.interface.parallel import Workers
from agents.studies.seal import current_digests, unbroken_seal
from agents.studies.shifts import Shift, differences, differences_json, evaluate_shifts, shift_table
from baselines.recordings.simulators import aircraft, airliners, cars, paths, process_noise, tracks
from baselines.recordings.simulators.tracks import VEHICLES, simulated_tracks
from baselines.rules import beam, seeds, threshold
from baselines.rules.decider import UNKNOWN
from baselines.scoring.estimates import Estimate
from hybrid_env.checks import reject
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions

# Paths of a quarter of an hour: 10 h a world.
EPISODES = 40
# For the mismatch.
PATHS = 8
LEVEL = 0.05
ALLOWED = 0.01
"""Reward by which the agent may be below the best rule and still not lose."""

SEAL = Path(__file__).with_name("sealed_simulators.json")
"""Digests of what is fixed before the paths from `seeds.SEALED` on are opened."""

FROZEN = (aircraft, airliners, cars, paths, process_noise, tracks, simulators, beam, threshold)
LEARNED = ("statement_decider", "statement_net")
PROGRAMS = ("jsbsim", "bluesky-simulator", "openap", "eclipse-sumo")


# Results, and the mismatch of each world.
Found = tuple[list[Shift], dict[str, float]]


def compare_on_simulators(
    names: Sequence[str],
    worlds: Mapping[str, SimulatorTask],
    episodes: int,
    seed: int,
    workers: Workers,
    note: Callable[[str], None],
) -> Found:
    """Evaluate deciders in worlds, see `evaluate_shifts`: all but the first are tuned in each of
    them.
    """
    results = evaluate_shifts(names, worlds, episodes, seed, workers, note, names[:1])
    mismatches = {}
    for world, task in worlds.items():
        note(f"mismatch: {world}")
        mismatches[world] = mismatch(task, seed)
    return results, mismatches


def first_seed(seed: int, episodes: int, sealed: bool) -> int:
    """Return the seed of the first path; refuse seeds that are not open, and sealed ones if the
    seal is broken.
    """
    if not sealed:
        if not 0 <= seed <= seeds.SELECTION - episodes:
            raise reject(
                "seed",
                seed,
                f"a number from 0 to {seeds.SELECTION} minus the number of episodes",
            )
        return seed
    if seed:
        raise reject("seed", seed, "no value with --sealed")
    unbroken_seal(SEAL, current_seal(), "paths")
    return seeds.SEALED


def current_seal() -> dict[str, dict[str, str]]:
    """Return the digests of the code of worlds, rules and agent, of its weights, and versions of
    the simulators.
    """
    code = {file.stem: file for file in (Path(str(one.__file__)) for one in FROZEN)}
    found = current_digests(code, UNKNOWN, {name: name for name in LEARNED}, simulators.COMPARED[0])
    found["programs"] = {
        name: next((one.version for one in distributions(name=name)), "missing")
        for name in PROGRAMS
    }
    return found


def tables(found: Found) -> list[Any]:
    """Return the table of all worlds, and with several deciders the counts as a sentence."""
    results, _ = found
    title = f"Simulators of others: {results[0].task.size(results[0].own.episodes)} a world"
    tables: list[Any] = [shift_table(results, title)]
    if len({one.decider for one in results}) > 1:
        first = results[0].decider
        number = counts(results)
        tables.append(
            f"{first} at its default threshold, with the likeliest process noise, beside the best"
            f" other decider, which is tuned in each world: at most {ALLOWED:g} below in"
            f" {number['kept']} of {number['worlds']} worlds; above in {number['above']} and below"
            f" in {number['below']} by Holm's correction."
        )
    return tables


def files(found: Found) -> dict[str, Any]:
    """Return the files: all figures, counts, the mismatch of each world, what `SEAL` holds once
    sealed; a picture.
    """
    results, mismatches = found
    content: dict[str, Any] = {
        "results": results,
        "mismatches": mismatches,
        "seal": current_seal(),
    }
    if len({one.decider for one in results}) == 1:
        return {"simulators.json": content}
    content |= {"differences": differences_json(results)} | counts(results)
    return {"simulators.json": content, "simulators.png": mismatch_figure(results, mismatches)}


def mismatch(task: SimulatorTask, seed: int) -> float:
    """Return the mean squared whitened innovation of a coordinate, 1 where the model of the bank
    is true.

    It is weighted by the posterior of the hypotheses, which the bank computes with the nominal
    process noise.
    """
    options = task.options_with({})
    assert isinstance(options, QuickestOptions)
    env = simulated_tracks(task.kind, options, PATHS, (1.0,))
    layout = QuickestLayout(options.hypotheses)
    rows, _ = env.reset(seed=seed)
    squares = []
    for _ in range(options.ticks - 1):
        rows, *_ = env.step(np.zeros(PATHS, np.int64))
        each = sum(layout.read(rows, f"innovation_{axis}") ** 2 for axis in ("along", "across"))
        squares.append(0.5 * (np.exp(layout.read(rows, "log_probability")) * each).sum(-1))
    return float(np.mean(squares))


def mismatch_figure(results: Sequence[Shift], mismatches: Mapping[str, float]) -> Figure:
    """Draw the gain of the first decider over the best tuned other one against the mismatch of
    the world.
    """
    gains = differences(results)
    curves: dict[str, list[Curve]] = {}
    for kind, one in VEHICLES.items():
        worlds = sorted(
            (world for world in gains if world.startswith(f"{kind},")),
            key=lambda world: mismatches[world],
        )
        if not worlds:
            continue
        places = [mismatches[world] for world in worlds]
        found = [gains[world][1] for world in worlds]
        curve = Curve(
            kind,
            FURTHER_STYLES[sum(map(len, curves.values()))],
            places,
            found,
            dashes=":",
            filled=True,
        )
        curves.setdefault(one.simulator, []).append(curve)
    x = Axis("mean squared whitened innovation", levels=(1.0,))
    y = Axis("reward less that of the best tuned rule", levels=(0.0, -ALLOWED))
    panels = [Panel(simulator, x, y, some) for simulator, some in curves.items()]
    return curve_figure(
        [panels],
        (4.5 * len(panels) + 1.0, 4.5),
        f"{results[0].decider} in simulators of others",
    )


def counts(results: Sequence[Shift]) -> dict[str, int]:
    """Return in how many worlds the first decider, untuned, keeps up with the best tuned other one.

    kept: at most .01 below; above, below: the difference is not 0 by Holm's correction over all
    worlds.
    """
    gains = [gain for _, gain, _ in differences(results).values()]
    sure = holm([p_value(gain) for gain in gains])
    return {
        "worlds": len(gains),
        "kept": sum(gain.value >= -ALLOWED for gain in gains),
        "above": sum(one and gain.value > 0.0 for one, gain in zip(sure, gains, strict=True)),
        "below": sum(one and gain.value < 0.0 for one, gain in zip(sure, gains, strict=True)),
    }


def p_value(gain: Estimate) -> float:
    """Return the two-sided p-value of a difference, from its interval as one of a normal
    distribution.
    """
    deviation = (gain.high - gain.low) / (2.0 * norm.ppf(1.0 - LEVEL / 2.0))
    return float(2.0 * norm.sf(abs(gain.value) / deviation)) if deviation > 0.0 else 1.0


def holm(values: Sequence[float]) -> list[bool]:
    """Return which of some p-values are significant at 5 % together. Holm 1979."""
    order = np.argsort(values)
    passed = np.sort(values) * np.arange(len(values), 0, -1) <= LEVEL
    found = np.zeros(len(values), np.bool_)
    found[order[: int(np.logical_and.accumulate(passed).sum())]] = True
    return [bool(one) for one in found]
