"""Deciders under distribution shift: evaluation in environments other than the nominal one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.evaluate import confidence_interval, evaluate
from agents.evaluation.operating_curve import sweep
from hybrid_env.options import WorldOptions
from hybrid_env.scheme import RandomScheme

NOMINAL = "nominal"


def shifted_worlds(world: WorldOptions) -> dict[str, dict[str, Any]]:
    """Return name and changed options of the environments around the nominal one, the nominal one first."""
    R, Q = np.asarray(world.measurement_variance), world.process_variance
    shifts: dict[str, dict[str, Any]] = {
        NOMINAL: {},
        "R / 10": {"measurement_variance": _plain(R / 10)},
        "R x 10": {"measurement_variance": _plain(R * 10)},
        "Q x 10": {"process_variance": 10 * Q},
        "5 % outliers": {"outliers": 0.05},
        "half the speed": {"speed": world.speed / 2},
        "twice the speed": {"speed": world.speed * 2},
    }
    if isinstance(world.scheme, RandomScheme) and world.scheme.radii is None:
        short, long = world.scheme.lengths
        shifts["half the radii"] = {"radii": tuple(radius / 2 for radius in world.radii)}
        shifts["twice the radii"] = {"radii": tuple(radius * 2 for radius in world.radii)}
        shifts["half the length"] = {
            "scheme": f"random {world.scheme.segments}x{max(1, short // 2)}-{max(1, long // 2)}"
        }
    return shifts


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else tuple(np.asarray(value).tolist())


@dataclass(frozen=True)
class ShiftResult:
    """Metrics of one decider in one environment.

    Attributes:
        world: name of the environment, as in `shifted_worlds`.
        decider: name of the decider.
        threshold: selected in the nominal environment.
        reward: mean per segment.
        low, high: bounds of the 95 % confidence interval of the reward.
        accuracy: proportion of correct decisions.
        ticks: mean decision time.
    """

    world: str
    decider: str
    threshold: float
    reward: float
    low: float
    high: float
    accuracy: float
    ticks: float


def evaluate_shifts(
    families: Sequence[DeciderFamily],
    env_id: str,
    world: WorldOptions,
    options: dict[str, Any],
    episodes: int,
    seed: int,
    on_progress: Callable[[str], None],
) -> list[ShiftResult]:
    """Evaluate every decider in every environment.

    Each decider uses the threshold with the best reward in the nominal environment, selected on other
    episodes.

    Args:
        families: of deciders.
        env_id: registered id of the nominal environment.
        world: all options of the nominal environment.
        options: of the nominal environment that differ from those of the id.
        episodes: number of evaluation episodes.
        seed: of the first episode.
        on_progress: called with the name of the next decider and environment.
    """
    results = []
    for family in families:
        on_progress(f"{family.name}: threshold")
        nominal = sweep(family, env_id, seeds.SELECTION_EPISODES, seeds.SELECTION, **options)
        threshold = family.thresholds[nominal.best_index()]
        for name, change in shifted_worlds(world).items():
            on_progress(f"{family.name}: {name}")
            decisions = evaluate(family.make(threshold), env_id, episodes, seed, **options | change)
            low, high = confidence_interval(decisions.reward.mean(1))
            results.append(
                ShiftResult(
                    name,
                    family.name,
                    threshold,
                    float(decisions.reward.mean()),
                    low,
                    high,
                    float(decisions.correct.mean()),
                    float(decisions.ticks.mean()),
                )
            )
    return results


def shift_table(results: Sequence[ShiftResult], title: str) -> Table:
    """Return a table with environments in rows and deciders in columns."""
    deciders = list(dict.fromkeys(result.decider for result in results))
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.caption = (
        "Reward per segment ± half-width of the 95 % confidence interval; accuracy and mean decision tick.\n"
        "Thresholds selected in the nominal environment."
    )
    table.add_column("environment")
    for name in deciders:
        table.add_column(Text(name), justify="right", no_wrap=True)
    for world in dict.fromkeys(result.world for result in results):
        row = {result.decider: result for result in results if result.world == world}
        table.add_row(world, *(_cell(row[name]) for name in deciders))
    return table


def _cell(result: ShiftResult) -> str:
    half_width = (result.high - result.low) / 2
    first = f"{result.reward:+.3f} ±{half_width:.3f}"
    return f"{first}\n[bright_black]{result.accuracy:.1%} at {result.ticks:.1f}[/]"
