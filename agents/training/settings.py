"""Declared types of hyper-parameters, and those that several training algorithms have."""

import dataclasses
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeAlias

from annotated_types import Interval, MinLen

from agents.learned.policy_file import LARGEST_HIDDEN
from hybrid_env.checks import Checked, Count, Positive, checked, reject
from hybrid_env.options import WorldOptions

# Largest error probability at which a training track declares.
LARGEST_ALPHA = 0.3


def learning_rate_schedule(value: Any, name: str = "learning_rate") -> tuple[float, bool]:
    """Return the initial learning rate, in (0, 1], and whether it decays linearly, with "lin_"
    before it.
    """
    decays = isinstance(value, str) and value.startswith("lin_")
    rate = value
    if isinstance(value, str):
        with suppress(ValueError):
            rate = float(value.removeprefix("lin_"))
    with suppress(ValueError):
        return checked(name, rate, Annotated[float, Interval(gt=0.0, le=1.0)]), decays
    raise reject(name, value, "a number > 0 and <= 1, or lin_ and such a number")


def check_rate(value: Any, name: str) -> str | float:
    """Return a learning rate as it is given; see `learning_rate_schedule`."""
    learning_rate_schedule(value, name)
    return value


def two_factors(value: Any, name: str) -> tuple[float, float]:
    """Return two factors, the smaller one first; refuse others."""
    low, high = checked(name, value, tuple[Positive, Positive])
    if low > high:
        raise reject(name, value, "two factors, the smaller one first")
    return low, high


LearningRate: TypeAlias = Annotated[str | float, check_rate]
Factors: TypeAlias = Annotated[tuple[float, float], two_factors]
Factor: TypeAlias = Annotated[float, Interval(gt=0.0, le=1.0)]


@dataclass(frozen=True, kw_only=True)
class TrainingWorld(Checked):
    """One environment that an agent is trained in, and its number of tracks."""

    # Parallel tracks.
    n_envs: Count
    # Registered id; None uses that of the run.
    env: str | None = None
    # Override those of the id and of the run.
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        known = {option.name for option in dataclasses.fields(WorldOptions)}
        for name in self.options:
            if name not in known:
                raise reject("option", name, "an option of the environment")


@dataclass(frozen=True, kw_only=True)
class DrawnWorlds(Checked):
    """Random environments that an agent is trained in, see `agents.evaluation.worlds`."""

    # Number of radii of each bank.
    radii: Count
    # Number of environments at the same time.
    worlds: Count
    # Parallel tracks in each.
    n_envs: Count


@dataclass(frozen=True, kw_only=True)
class NetworkSettings(Checked):
    """Hyper-parameters of all agents whose networks are of this package; base class."""

    # Units of each hidden layer.
    hidden: Annotated[int, Interval(ge=1, le=LARGEST_HIDDEN)]
    # Constant, or "lin_" and the initial value for linear decay.
    learning_rate: LearningRate


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained in several environments at the same time;
    base class.
    """

    worlds: Annotated[tuple[TrainingWorld, ...], MinLen(1)]
    # Random environments besides.
    drawn_worlds: tuple[DrawnWorlds, ...] = ()
