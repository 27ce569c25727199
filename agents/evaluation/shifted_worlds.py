"""Deciders in worlds other than the one that they were made for: who degrades, and how."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from agents.evaluation import seeds
from agents.evaluation.deciders import DeciderFamily
from agents.evaluation.evaluate import evaluate, interval
from agents.evaluation.operating_curve import sweep
from hybrid_env.options import WorldOptions
from hybrid_env.scheme import RandomScheme

HOME = "as it is"


def shifted_worlds(world: WorldOptions) -> dict[str, dict[str, Any]]:
    """Name and changed options of the worlds around a world, itself first."""
    R, Q = np.asarray(world.measurement_variance), world.process_variance
    shifts: dict[str, dict[str, Any]] = {
        HOME: {},
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
class Shifted:
    """Figures of one decider in one world: mean reward with its 95 % interval, accuracy and ticks."""

    world: str
    decider: str
    threshold: float
    reward: float
    low: float
    high: float
    accuracy: float
    ticks: float


def measure_shifts(
    families: Sequence[DeciderFamily],
    env_id: str,
    world: WorldOptions,
    options: dict[str, Any],
    episodes: int,
    seed: int,
    on_progress: Callable[[str], None],
) -> list[Shifted]:
    """Every family in every world, at the threshold of the best reward at home (on other episodes).

    Args:
        options: of the world at home, over those of the id.
        on_progress: called with the name of the next decider and world.
    """
    found = []
    for family in families:
        on_progress(f"{family.name}: threshold")
        home = sweep(family, env_id, seeds.SELECTION_EPISODES, seeds.SELECTION, **options)
        threshold = family.thresholds[home.best_index()]
        for name, change in shifted_worlds(world).items():
            on_progress(f"{family.name}: {name}")
            decisions = evaluate(family.make(threshold), env_id, episodes, seed, **options | change)
            low, high = interval(decisions.reward.mean(1))
            found.append(
                Shifted(
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
    return found


def shift_table(found: Sequence[Shifted], title: str) -> Table:
    """A row a world, a column a decider: the reward, and below it accuracy and ticks."""
    deciders = list(dict.fromkeys(one.decider for one in found))
    table = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    table.caption = "Reward a segment ± half of the 95 % interval; right at tick. Thresholds as at home."
    table.add_column("world")
    for name in deciders:
        table.add_column(name, justify="right", no_wrap=True)
    for world in dict.fromkeys(one.world for one in found):
        row = {one.decider: one for one in found if one.world == world}
        table.add_row(world, *(_cell(row[name]) for name in deciders))
    return table


def _cell(one: Shifted) -> str:
    half = (one.high - one.low) / 2
    return f"{one.reward:+.3f} ±{half:.3f}\n[bright_black]{one.accuracy:.1%} at {one.ticks:.1f}[/]"
