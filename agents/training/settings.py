"""Declared types of hyper-parameters, and those that several training algorithms have."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from annotated_types import Interval

from agents.learned.torch_defaults import Units
from hybrid_env.checks import Checked, checked, reject

Factor: TypeAlias = Annotated[float, Interval(gt=0.0, le=1.0)]


def learning_rate_schedule(value: Any, name: str = "learning_rate") -> tuple[float, bool]:
    """Return the initial learning rate, in (0, 1], and whether it decays linearly, with "lin_"
    before it.
    """
    decays = isinstance(value, str) and value.startswith("lin_")
    with suppress(ValueError):
        rate = float(value.removeprefix("lin_")) if isinstance(value, str) else value
        return checked(name, rate, Factor), decays
    raise reject(name, value, "a number > 0 and <= 1, or lin_ and such a number")


def check_rate(value: Any, name: str) -> str | float:
    """Return a learning rate as it is given; see `learning_rate_schedule`."""
    learning_rate_schedule(value, name)
    return value


@dataclass(frozen=True, kw_only=True)
class NetworkSettings(Checked):
    """Hyper-parameters of all agents whose networks are of this package; base class."""

    # Units of each hidden layer.
    hidden: Units
    # Constant, or "lin_" and the initial value for linear decay.
    learning_rate: Annotated[str | float, check_rate]
