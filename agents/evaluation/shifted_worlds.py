"""Deciders under distribution shift: evaluation in environments other than the nominal one."""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich import box
from rich.table import Table
from rich.text import Text

from agents.evaluation.deciders import ALPHAS, FEW_ALPHAS, DeciderFamily, decider_family
from agents.evaluation.evaluate import Decisions, confidence_interval, evaluate
from agents.evaluation.operating_curve import sweep
from agents.interface.parallel import Workers
from baselines.rules import seeds
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.scheme import RandomScheme

FloatArray = NDArray[np.float64]
NOMINAL = "nominal"
MOST_THRESHOLDS = 13
"""Thresholds tried in each environment, spread over those of the decider; all posteriors use `FEW_ALPHAS`."""


def shifted_worlds(world: WorldOptions) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments around the nominal one, the nominal one first."""
    R, Q = np.asarray(world.measurement_variance), world.process_variance
    position, velocity = world.initial_error if isinstance(world.initial_error, tuple) else (0.0, 0.0)
    mean = float(np.exp(np.log(R).mean()))
    shifts: dict[str, dict[str, Any]] = {
        NOMINAL: {},
        "R / 100": {"measurement_variance": _plain(R / 100)},
        "R / 10": {"measurement_variance": _plain(R / 10)},
        "R x 10": {"measurement_variance": _plain(R * 10)},
        "R of y is 16 R of x": {"measurement_variance": (mean / 4, mean * 4)},
        "Q / 10": {"process_variance": Q / 10},
        "Q x 10": {"process_variance": 10 * Q},
        "2 % outliers": {"noise": "outliers 0.02"},
        "5 % outliers": {"noise": "outliers 0.05"},
        "Student's t noise": {"noise": "student_t 3"},
        "Lévy noise": {"noise": "levy 1.5 1 44"},
        "half the speed": {"speed": world.speed / 2},
        "twice the speed": {"speed": world.speed * 2},
        "4 times the speed": {"speed": world.speed * 4},
        "half the tick": {"tau": world.tau / 2},
        "twice the tick": {"tau": world.tau * 2},
        "exact first estimate": {"initial_error": 0},
        "first estimate 3 times as wrong": {"initial_error": (9 * position, 9 * velocity)},
        "all filters followed": {"follow": "bank"},
    }
    if isinstance(world.scheme, RandomScheme) and world.scheme.radii is None:
        segments, (short, long) = world.scheme.segments, world.scheme.lengths
        for name, factor in (("half the radii", 0.5), ("twice the radii", 2.0), ("2.4 times the radii", 2.4)):
            shifts[name] = {"radii": tuple(radius * factor for radius in world.radii)}
        two = tuple(sorted({factor * radius for radius in world.radii for factor in (0.8, 1.8)}))
        shifts["two radii for each"] = {"radii": two}
        for name, factor in (("half the length", 0.5), ("twice the length", 2.0)):
            lengths = max(1, round(short * factor)), max(1, round(long * factor))
            shifts[name] = {"scheme": f"random {segments}x{lengths[0]}-{lengths[1]}"}
    return shifts


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else tuple(np.asarray(value).tolist())


@dataclass(frozen=True)
class ShiftResult:
    """Metrics of one decider in one environment.

    Attributes:
        world: name of the environment, as in `shifted_worlds`.
        decider: name of the decider.
        threshold: selected in this environment, on other episodes.
        reward: mean per segment at this threshold.
        low, high: bounds of the 95 % confidence interval of the reward.
        accuracy: proportion of correct decisions.
        ticks: mean decision time.
        nominal_threshold: selected in the nominal environment.
        nominal_reward: mean per segment at the threshold of the nominal environment.
        nominal_low, nominal_high: bounds of its 95 % confidence interval.
        episodes: (E,) mean reward of each episode.
        nominal_episodes: (E,) the same at the threshold of the nominal environment.
    """

    world: str
    decider: str
    threshold: float
    reward: float
    low: float
    high: float
    accuracy: float
    ticks: float
    nominal_threshold: float
    nominal_reward: float
    nominal_low: float
    nominal_high: float
    episodes: FloatArray
    nominal_episodes: FloatArray

    def as_json(self) -> dict[str, Any]:
        """Return the metrics without the episodes."""
        return {name: value for name, value in vars(self).items() if not name.endswith("episodes")}


@dataclass(frozen=True)
class ShiftDifference:
    """Reward of one decider minus that of the best of the others in one environment, on the same episodes.

    Attributes:
        world: name of the environment.
        decider, other: names of the deciders; the other is the best at the thresholds of this environment.
        difference, low, high: mean per segment with the bounds of the 95 % confidence interval.
        nominal_difference: the decider at the threshold of the nominal environment, the other as before.
    """

    world: str
    decider: str
    other: str
    difference: float
    low: float
    high: float
    nominal_difference: float


def evaluate_shifts(
    names: Sequence[str],
    env_id: str,
    worlds: Mapping[str, dict[str, Any]],
    options: dict[str, Any],
    episodes: int,
    seed: int,
    workers: Workers,
    on_progress: Callable[[str], None],
) -> list[ShiftResult]:
    """Evaluate every decider in every environment.

    Each decider uses the threshold with the best reward, selected on other episodes, once of the same
    environment and once of the nominal environment. Rules that are fitted to an environment are fitted to
    each of them.

    Args:
        names: of deciders, see `deciders.decider_family`.
        env_id: registered id of the nominal environment.
        worlds: name and changed options of the environments, the nominal one first.
        options: of the nominal environment that differ from those of the id.
        episodes: number of evaluation episodes.
        seed: of the first episode.
        workers: where the evaluations run.
        on_progress: called with the name of the decider and environment that were evaluated.
    """
    alone = functools.partial(_evaluate_shift, env_id=env_id, episodes=episodes, seed=seed)
    nominal = options | worlds.get(NOMINAL, {})
    calls = {
        f"{name}: {NOMINAL}": functools.partial(alone, name, NOMINAL, nominal, float("nan")) for name in names
    }
    found = dict(workers.results(calls, on_progress))  # their thresholds are those of the other environments
    thresholds = {name: found[f"{name}: {NOMINAL}"].threshold for name in names}
    others = {
        f"{name}: {shift}": functools.partial(alone, name, shift, options | change, thresholds[name])
        for name in names
        for shift, change in worlds.items()
        if shift != NOMINAL
    }
    found |= workers.results(others, on_progress)
    return [found[f"{name}: {shift}"] for name in names for shift in worlds]


def _evaluate_shift(
    name: str,
    shift: str,
    options: dict[str, Any],
    nominal_threshold: float,
    env_id: str,
    episodes: int,
    seed: int,
) -> ShiftResult:
    """Evaluate a decider in one environment; a nominal threshold of NaN is that of this environment."""
    family = decider_family(name, make_vector_env(env_id, 1, **options).options)
    threshold = _best_threshold(family, env_id, options, min(episodes, seeds.SELECTION_EPISODES))
    if math.isnan(nominal_threshold):
        nominal_threshold = threshold
    decisions = {
        value: evaluate(family.make(value), env_id, episodes, seed, **options | family.options)
        for value in {threshold, nominal_threshold}
    }
    own, nominal = ((value, decisions[value]) for value in (threshold, nominal_threshold))
    return _result(shift, family.name, own, nominal)


def _best_threshold(family: DeciderFamily, env_id: str, options: dict[str, Any], episodes: int) -> float:
    """Return the threshold with the best reward on a number of selection episodes."""
    thresholds = FEW_ALPHAS if family.thresholds == ALPHAS else family.thresholds
    thresholds = thresholds[:: -(-len(thresholds) // MOST_THRESHOLDS)]
    curve = sweep(family, env_id, episodes, seeds.SELECTION, thresholds=thresholds, **options)
    return thresholds[curve.best_index()]


def _result(
    world: str, decider: str, own: tuple[float, Decisions], nominal: tuple[float, Decisions]
) -> ShiftResult:
    decisions = own[1]
    intervals = [confidence_interval(one.reward.mean(1)) for _, one in (own, nominal)]
    return ShiftResult(
        world, decider, own[0], float(decisions.reward.mean()), *intervals[0],
        float(decisions.correct.mean()), float(decisions.ticks.mean()),
        nominal[0], float(nominal[1].reward.mean()), *intervals[1],
        decisions.reward.mean(1), nominal[1].reward.mean(1),
    )  # fmt: skip


def differences(results: Sequence[ShiftResult]) -> list[ShiftDifference]:
    """Return the differences between the first decider and the best of the others, one per environment."""
    first, found = results[0].decider, []
    for world in dict.fromkeys(result.world for result in results):
        mine, *others = (result for result in results if result.world == world)
        best = max(others, key=lambda one: one.reward)
        gain = mine.episodes - best.episodes
        nominal_gain = float((mine.nominal_episodes - best.episodes).mean())
        found.append(
            ShiftDifference(
                world, first, best.decider, float(gain.mean()), *confidence_interval(gain), nominal_gain
            )
        )
    return found


def shift_table(results: Sequence[ShiftResult], title: str) -> Table:
    """Return a table with environments in rows and deciders in columns."""
    deciders = list(dict.fromkeys(result.decider for result in results))
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=0, show_edge=False, min_width=len(title))
    table.caption = (
        "Reward per segment and half-width of its 95 % confidence interval, at the threshold selected in "
        "this environment; in the last line of a row the reward at the threshold selected in the nominal "
        "environment."
    )
    table.add_column("environment", min_width=14)
    for name in deciders:
        table.add_column(Text(name.replace(" ", "\n")), justify="right", no_wrap=True)
    gains = {}
    if len(deciders) > 1:
        table.add_column(Text(f"{deciders[0]} -\nbest\nother"), justify="right", no_wrap=True)
        gains = {one.world: one for one in differences(results)}
        table.caption += " The last column compares the same episodes."
    for world in dict.fromkeys(result.world for result in results):
        row = {result.decider: result for result in results if result.world == world}
        found = (row[name] for name in deciders)
        cells = [_cell(world, one.reward, one.low, one.high, one.nominal_reward) for one in found]
        if world in gains:
            gain = gains[world]
            cells.append(_cell(world, gain.difference, gain.low, gain.high, gain.nominal_difference))
        table.add_row(world, *cells)
    return table


def _cell(world: str, value: float, low: float, high: float, nominal: float) -> str:
    """Return three short lines, so that six deciders fit into 80 columns."""
    lines = [f"{value:+.3f}", f"±{(high - low) / 2:.3f}"]
    return "\n".join(lines if world == NOMINAL else [*lines, f"[bright_black]{nominal:+.3f}[/]"])
