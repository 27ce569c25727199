"""Hyper-parameters that several training algorithms have, and their limits."""

import dataclasses
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agents.learned.policy_file import LARGEST_HIDDEN
from hybrid_env.checks import check_integer, check_number, reject
from hybrid_env.limits import MAX_RADII, two_values
from hybrid_env.options import WorldOptions

# Tracks, steps or passes.
LARGEST_COUNT = 100_000
# Of a part of the loss, and of the initial bias.
LARGEST_WEIGHT = 100.0
# Tracks of a round of simulated tracks.
LARGEST_ROUND = 2**12
MOST_WORLDS = 100
MOST_DRAWN = 1000
# Of the variances and radii of simulated tracks.
LARGEST_FACTOR = 1000.0
# Largest error probability at which a training track declares.
LARGEST_ALPHA = 0.3


@dataclass(frozen=True, kw_only=True)
class TrainingWorld:
    """One environment that an agent is trained in, and its number of tracks."""

    # Parallel tracks.
    n_envs: int
    # Registered id; None uses that of the run.
    env: str | None = None
    # Override those of the id and of the run.
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)
        if self.env is not None and not isinstance(self.env, str):
            raise reject("env", self.env, "a registered id")
        if not isinstance(self.options, Mapping):
            raise reject("options", self.options, "a mapping")
        for name in self.options:
            if name not in {one.name for one in dataclasses.fields(WorldOptions)}:
                raise reject("option", name, "an option of the environment")


@dataclass(frozen=True, kw_only=True)
class DrawnWorlds:
    """Random environments that an agent is trained in, see `agents.evaluation.worlds`."""

    # Number of radii of each bank.
    radii: int
    # Number of environments at the same time.
    worlds: int
    # Parallel tracks in each.
    n_envs: int

    def __post_init__(self) -> None:
        for name, largest in {
            "radii": MAX_RADII,
            "worlds": MOST_DRAWN,
            "n_envs": LARGEST_COUNT,
        }.items():
            check_integer(name, getattr(self, name), maximum=largest)


@dataclass(frozen=True, kw_only=True)
class NetworkSettings:
    """Hyper-parameters of all agents whose networks are of this package; base class."""

    # Units of each hidden layer.
    hidden: int
    # Constant, or "lin_" and the initial value for linear decay.
    learning_rate: str | float

    largest: ClassVar[dict[str, int]] = {"hidden": LARGEST_HIDDEN}
    """Upper bounds of positive integers."""

    def __post_init__(self) -> None:
        for name, largest in self.largest.items():
            check_integer(name, getattr(self, name), maximum=largest)
        learning_rate_schedule(self.learning_rate)


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained in several environments at the same time;
    base class.
    """

    worlds: tuple[TrainingWorld, ...]
    # Random environments besides.
    drawn_worlds: tuple[DrawnWorlds, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, kind in (("worlds", TrainingWorld), ("drawn_worlds", DrawnWorlds)):
            object.__setattr__(self, name, _worlds(name, kind, getattr(self, name)))
        if not 1 <= len(self.worlds) <= MOST_WORLDS:
            raise reject("worlds", self.worlds, f"one to {MOST_WORLDS} environments")
        if len(self.drawn_worlds) > MOST_WORLDS:
            raise reject("drawn_worlds", self.drawn_worlds, f"at most {MOST_WORLDS} entries")


def _worlds(name: str, kind: type[Any], value: Any) -> tuple[Any, ...]:
    """Return worlds from mappings of their values, as in a recipe."""
    try:
        return tuple(world if isinstance(world, kind) else kind(**world) for world in value)
    except TypeError:
        names = ", ".join(field.name for field in dataclasses.fields(kind))
        raise reject(name, value, f"a list of mappings with some of {names}") from None


def learning_rate_schedule(rate: str | float) -> tuple[float, bool]:
    """Return the initial learning rate, in (0, 1], and whether it decays linearly, with "lin_"
    before it.
    """
    decays = isinstance(rate, str) and rate.startswith("lin_")
    value = math.nan
    if isinstance(rate, (str, int, float)):
        with suppress(ValueError, OverflowError):
            value = float(rate.removeprefix("lin_") if isinstance(rate, str) else rate)
    if isinstance(rate, bool) or not 0.0 < value <= 1.0:
        raise reject(
            "learning_rate",
            rate,
            "a number above 0, at most 1, or lin_ and such a number",
        )
    return value, decays


def two_factors(name: str, value: Any) -> tuple[float, float]:
    """Return two factors, the smaller one first; refuse others."""
    allowed = "two factors, the smaller one first"
    low, high = (check_number(name, one, allowed) for one in two_values(name, value, allowed))
    if not 1.0 / LARGEST_FACTOR <= low <= high <= LARGEST_FACTOR:
        raise reject(
            name,
            value,
            f"{allowed}, each from {1 / LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}",
        )
    return low, high
