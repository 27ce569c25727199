"""Hyper-parameters of the training algorithms, and their limits."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agents.learned.policy_file import LARGEST_HIDDEN
from agents.training.stable_baselines_settings import (
    LARGEST_COUNT,
    LARGEST_WEIGHT,
    A2CSettings,
    LibrarySettings,
    PPOSettings,
    QSettings,
    learning_rate_schedule,
)
from hybrid_env.checks import (
    check_between,
    check_flag,
    check_integer,
    check_number,
    check_share,
    ranged,
    reject,
)
from hybrid_env.durations import parse_durations
from hybrid_env.limits import MAX_RADII, check_ticks, two_values
from hybrid_env.options import WorldOptions

# Ticks x hypotheses of an update of the anchor agent.
LARGEST_UNROLLING = 2**22
# Tracks of a round of simulated tracks.
LARGEST_ROUND = 2**12
# Positions of a round of simulated flights.
LARGEST_FLIGHTS = 2**20
MOST_WORLDS = 100
MOST_DRAWN = 1000
MOST_LAWS = 100
# Of the variances and radii of simulated tracks.
LARGEST_FACTOR = 1000.0
# Largest error probability at which a training track of the anchor agent declares.
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
        if not 1 <= len(self.worlds) <= MOST_WORLDS:
            raise reject("worlds", self.worlds, f"one to {MOST_WORLDS} environments")
        if len(self.drawn_worlds) > MOST_WORLDS:
            raise reject("drawn_worlds", self.drawn_worlds, f"at most {MOST_WORLDS} entries")


@dataclass(frozen=True, kw_only=True)
class AnchorSettings(WorldsSettings):
    """Hyper-parameters of the anchor agent.

    The threshold of a track on the error probability is drawn log-uniformly from `smallest_alpha`
    to 0.3 after each declaration. Anchors after a wrong decision are rare under a good policy;
    without random declarations, decisions from them take three times as long.
    """

    # Ticks between updates.
    n_steps: int
    smallest_alpha: float
    # At which every track declares; later ticks contribute little to learning.
    last_tick: int
    # Probability that a declaration is replaced by a random hypothesis.
    random_declarations: float
    # After which the random environments are drawn anew.
    updates_per_world: int = 32
    # Last anchors, and last declarations, that samples are drawn from.
    buffer_size: int = 50_000
    # Steps of the optimizer per update.
    batches: int = 8
    # Samples of a step.
    batch_size: int = 1024

    largest = NetworkSettings.largest | {
        "n_steps": 10_000,
        "last_tick": 10**6,
        "updates_per_world": 10**6,
        "buffer_size": 10**6,
        "batches": 1000,
        "batch_size": 10**5,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        tracks = 3 * sum(world.n_envs for world in self.worlds)
        tracks += sum(
            drawn.worlds * drawn.n_envs * (2 * drawn.radii + 1) for drawn in self.drawn_worlds
        )
        if self.n_steps * tracks > LARGEST_UNROLLING:
            allowed = f"n_steps x hypotheses of all tracks of at most {LARGEST_UNROLLING:,}"
            raise reject("n_steps", self.n_steps, allowed)
        check_between("smallest_alpha", self.smallest_alpha, 0.0, LARGEST_ALPHA)
        check_share("random_declarations", self.random_declarations)


@dataclass(frozen=True, kw_only=True)
class SegmentSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on whole segments, such as MSPRT-TANDEM."""

    # Tracks of a round, one episode each.
    n_envs: int
    # Segments of an update.
    batch_size: int

    largest = NetworkSettings.largest | {"n_envs": LARGEST_COUNT, "batch_size": LARGEST_COUNT}


@dataclass(frozen=True, kw_only=True)
class RewardSettings(SegmentSettings):
    """Hyper-parameters of the agent that learns from rewards alone."""

    # The reward of a declaration teaches all rows of its segment, and not only the last one.
    every_row: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("every_row", self.every_row)


@dataclass(frozen=True, kw_only=True)
class ExpectedRewardSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on its expected reward; base class."""

    # Ticks of an update; gradients do not reach back beyond its first tick.
    n_steps: int
    # Of the cross-entropy of the present mode, in addition to the reward.
    belief_weight: float

    largest = NetworkSettings.largest | {"n_steps": 10_000}

    def __post_init__(self) -> None:
        super().__post_init__()
        ranged(0.0, LARGEST_WEIGHT)("belief_weight", self.belief_weight)


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every
    round.
    """

    # Laws of segments, one environment of every round for each, also repeated.
    durations: tuple[str, ...]
    # Tracks of each environment.
    n_envs: int
    # Tracks of an update.
    batch_size: int
    # Smallest and largest factor of the measurement variance of the environment.
    variances: tuple[float, float] = (1.0, 1.0)
    # Likewise of its radii.
    radii: tuple[float, float] = (1.0, 1.0)
    # Length of the tracks; None is that of the environment.
    ticks: int | None = None
    # Further environments of every round, in which objects move otherwise than told.
    inexact: int = 0

    largest = ExpectedRewardSettings.largest | {
        "n_envs": LARGEST_ROUND,
        "batch_size": LARGEST_ROUND,
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("inexact", self.inexact, minimum=0, maximum=MOST_LAWS)
        fewest = 0 if self.inexact else 1
        if (
            not isinstance(self.durations, (list, tuple))
            or not fewest <= len(self.durations) <= MOST_LAWS
        ):
            raise reject("durations", self.durations, f"a list of {fewest} to {MOST_LAWS} laws")
        object.__setattr__(
            self,
            "durations",
            tuple(str(parse_durations(law)) for law in self.durations),
        )
        check_ticks("ticks", 1 if self.ticks is None else self.ticks)
        if self.n_envs * (len(self.durations) + self.inexact) > LARGEST_ROUND:
            raise reject(
                "n_envs",
                self.n_envs,
                f"n_envs x environments of at most {LARGEST_ROUND:,}",
            )
        for name in ("variances", "radii"):
            object.__setattr__(self, name, _factors(name, getattr(self, name)))


def _factors(name: str, value: Any) -> tuple[float, float]:
    allowed = "two factors, the smaller one first"
    low, high = (check_number(name, one, allowed) for one in two_values(name, value, allowed))
    if not 1.0 / LARGEST_FACTOR <= low <= high <= LARGEST_FACTOR:
        raise reject(
            name,
            value,
            f"{allowed}, each from {1 / LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}",
        )
    return low, high


@dataclass(frozen=True, kw_only=True)
class StoppingSettings(WorldsSettings):
    """Hyper-parameters of the learned stop, trained on one episode of each track in every round."""

    # Segments of an update.
    batch_size: int
    # Times that the segments of a round are used.
    passes: int
    # Smallest and largest delay cost; half of the environments have one drawn between them.
    delay_costs: tuple[float, float] = (0.003, 0.05)
    # Or the run folder of an anchor agent, with as many hidden units.
    agent: str = "shipped-threshold"

    largest = NetworkSettings.largest | {"batch_size": LARGEST_COUNT, "passes": 1000}

    def __post_init__(self) -> None:
        super().__post_init__()
        tracks = sum(world.n_envs for world in self.worlds) + sum(
            one.worlds * one.n_envs for one in self.drawn_worlds
        )
        if tracks > LARGEST_ROUND:
            raise reject(
                "worlds",
                self.worlds,
                f"at most {LARGEST_ROUND:,} tracks, drawn_worlds included",
            )
        object.__setattr__(self, "delay_costs", _factors("delay_costs", self.delay_costs))
        if not isinstance(self.agent, str):
            raise reject("agent", self.agent, "'shipped-threshold' or a run folder")


@dataclass(frozen=True, kw_only=True)
class FlightSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for recorded flights, trained on simulated ones, new ones in
    every round.
    """

    # Of each group in a round; short ones are left out, about half of those of D.
    flights: tuple[int, ...]
    # Approximate number of positions of a flight.
    rows: int
    # Times that the flights of a round are used.
    passes: int
    # Of a change to a wrong mode: as much as a wrong statement for this time [s], times the scored
    # time of the position over its mean.
    change_cost: float

    groups: ClassVar[tuple[str, ...]] = ("A", "B", "C", "D")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.flights, (list, tuple)) or len(self.flights) != len(self.groups):
            raise reject(
                "flights",
                self.flights,
                f"a list of the numbers of flights of {', '.join(self.groups)}",
            )
        counts = tuple(
            check_integer("flights", count, maximum=LARGEST_COUNT) for count in self.flights
        )
        object.__setattr__(self, "flights", counts)
        check_integer("rows", self.rows, minimum=100, maximum=LARGEST_COUNT)
        check_integer("passes", self.passes, maximum=LARGEST_COUNT)
        if sum(self.flights) * self.rows > LARGEST_FLIGHTS:
            raise reject("flights", self.flights, f"rows x flights of at most {LARGEST_FLIGHTS:,}")
        ranged(0.0, LARGEST_FACTOR)("change_cost", self.change_cost)


@dataclass(frozen=True, kw_only=True)
class GliderSettings(FlightSettings):
    """Those of the agent for gliders, with one number of flights of a round."""

    groups = ("gliders",)


Settings = LibrarySettings | NetworkSettings
ALGORITHMS: dict[str, type[Settings]] = {
    "ppo": PPOSettings,
    "recurrent_ppo": PPOSettings,
    "a2c": A2CSettings,
    "dqn": QSettings,
    "qrdqn": QSettings,
    "anchor": AnchorSettings,
    "reward": RewardSettings,
    "tandem": SegmentSettings,
    "statements": StatementSettings,
    "rhythm": StatementSettings,
    "flights": FlightSettings,
    "gliders": GliderSettings,
    "kalman": SegmentSettings,
    "distilled": SegmentSettings,
    "transformer": SegmentSettings,
    "jump_markov": StatementSettings,
    "stopping": StoppingSettings,
}
