"""Hyper-parameters of the agent that states a mode at every tick."""

from dataclasses import dataclass
from typing import Any

from agents.learned.network_settings import LARGEST_HIDDEN
from agents.training.learning_rate import learning_rate_schedule
from hybrid_env.checks import check_integer, check_number, reject
from hybrid_env.durations import parse_durations
from hybrid_env.limits import two_values

LARGEST_ROUND = 2**12  # tracks
LARGEST_FACTOR = 1000.0
MOST_LAWS = 100
LARGEST_BELIEF_WEIGHT = 100.0


@dataclass(frozen=True, kw_only=True)
class StatementSettings:
    """Hyper-parameters of the agent that is trained on its expected reward.

    Every round simulates new tracks in environments with random measurement variances and radii.

    Attributes:
        durations: laws of the durations of segments, one environment of every round for each; a law may be
            repeated.
        n_envs: tracks of each environment.
        variances: smallest and largest factor of the measurement variance of the environment.
        radii: smallest and largest factor of its radii.
        batch_size: tracks of an update.
        n_steps: ticks of an update. Gradients do not reach back beyond its first tick.
        hidden: units of the recurrent layer.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
        belief_weight: weight of the cross-entropy of the present mode, in addition to the reward.
    """

    durations: tuple[str, ...]
    n_envs: int
    variances: tuple[float, float]
    radii: tuple[float, float]
    batch_size: int
    n_steps: int
    hidden: int
    learning_rate: str | float
    belief_weight: float

    def __post_init__(self) -> None:
        if not isinstance(self.durations, (list, tuple)) or not 1 <= len(self.durations) <= MOST_LAWS:
            raise reject("durations", self.durations, f"a list of 1 to {MOST_LAWS} laws")
        object.__setattr__(self, "durations", tuple(str(parse_durations(law)) for law in self.durations))
        for name, largest in (("n_envs", LARGEST_ROUND), ("batch_size", LARGEST_ROUND), ("n_steps", 10_000)):
            check_integer(name, getattr(self, name), maximum=largest)
        learning_rate_schedule(self.learning_rate)
        check_integer("hidden", self.hidden, maximum=LARGEST_HIDDEN)
        if self.n_envs * len(self.durations) > LARGEST_ROUND:
            raise reject("n_envs", self.n_envs, f"n_envs x laws of at most {LARGEST_ROUND:,}")
        for name in ("variances", "radii"):
            object.__setattr__(self, name, _factors(name, getattr(self, name)))
        if not 0.0 <= check_number("belief_weight", self.belief_weight) <= LARGEST_BELIEF_WEIGHT:
            raise reject("belief_weight", self.belief_weight, f"a number from 0 to {LARGEST_BELIEF_WEIGHT:g}")


def _factors(name: str, value: Any) -> tuple[float, float]:
    allowed = "two factors, the smaller one first"
    low, high = (check_number(name, one, allowed) for one in two_values(name, value, allowed))
    if not 1.0 / LARGEST_FACTOR <= low <= high <= LARGEST_FACTOR:
        raise reject(name, value, f"{allowed}, each from {1 / LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}")
    return low, high
