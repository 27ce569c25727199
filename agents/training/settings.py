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
from hybrid_env.checks import check_between, check_flag, check_integer, check_number, check_share, ranged, reject
from hybrid_env.durations import parse_durations
from hybrid_env.limits import MAX_RADII, check_ticks, two_values
from hybrid_env.options import WorldOptions

LARGEST_UNROLLING = 2**22  # ticks x hypotheses of an update of the anchor agent
LARGEST_ROUND = 2**12  # tracks of a round of simulated tracks
LARGEST_FLIGHTS = 2**20  # positions of a round of simulated flights
MOST_WORLDS = 100
MOST_DRAWN = 1000
MOST_LAWS = 100
LARGEST_FACTOR = 1000.0  # of the variances and radii of simulated tracks
LARGEST_ALPHA = 0.3  # largest error probability at which a training track of the anchor agent declares


@dataclass(frozen=True, kw_only=True)
class TrainingWorld:
    """One environment that an agent is trained in, and its number of tracks."""

    n_envs: int  # parallel tracks
    env: str | None = None  # registered id; None uses that of the run
    options: Mapping[str, Any] = field(default_factory=dict)  # override those of the id and of the run

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

    radii: int  # number of radii of each bank
    worlds: int  # number of environments at the same time
    n_envs: int  # parallel tracks in each

    def __post_init__(self) -> None:
        for name, largest in {"radii": MAX_RADII, "worlds": MOST_DRAWN, "n_envs": LARGEST_COUNT}.items():
            check_integer(name, getattr(self, name), maximum=largest)


@dataclass(frozen=True, kw_only=True)
class NetworkSettings:
    """Hyper-parameters of all agents whose networks are of this package; base class."""

    hidden: int  # units of each hidden layer
    learning_rate: str | float  # constant, or "lin_" and the initial value for linear decay

    largest: ClassVar[dict[str, int]] = {"hidden": LARGEST_HIDDEN}
    """Upper bounds of positive integers."""

    def __post_init__(self) -> None:
        for name, largest in self.largest.items():
            check_integer(name, getattr(self, name), maximum=largest)
        learning_rate_schedule(self.learning_rate)


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained in several environments at the same time; base class."""

    worlds: tuple[TrainingWorld, ...]
    drawn_worlds: tuple[DrawnWorlds, ...] = ()  # random environments besides

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= len(self.worlds) <= MOST_WORLDS:
            raise reject("worlds", self.worlds, f"one to {MOST_WORLDS} environments")
        if len(self.drawn_worlds) > MOST_WORLDS:
            raise reject("drawn_worlds", self.drawn_worlds, f"at most {MOST_WORLDS} entries")


@dataclass(frozen=True, kw_only=True)
class AnchorSettings(WorldsSettings):
    """Hyper-parameters of the anchor agent.

    The threshold of a track on the error probability is drawn log-uniformly from `smallest_alpha` to 0.3 after each
    declaration. Anchors after a wrong decision are rare under a good policy; without random declarations, decisions
    from them take three times as long.
    """

    n_steps: int  # ticks between updates
    smallest_alpha: float
    last_tick: int  # at which every track declares; later ticks contribute little to learning
    random_declarations: float  # probability that a declaration is replaced by a random hypothesis
    updates_per_world: int = 32  # after which the random environments are drawn anew
    buffer_size: int = 50_000  # last anchors, and last declarations, that samples are drawn from
    batches: int = 8  # steps of the optimizer per update
    batch_size: int = 1024  # samples of a step

    largest = NetworkSettings.largest | {
        "n_steps": 10_000, "last_tick": 10**6, "updates_per_world": 10**6, "buffer_size": 10**6, "batches": 1000,
        "batch_size": 10**5,
    }  # fmt: skip

    def __post_init__(self) -> None:
        super().__post_init__()
        tracks = 3 * sum(world.n_envs for world in self.worlds)
        tracks += sum(drawn.worlds * drawn.n_envs * (2 * drawn.radii + 1) for drawn in self.drawn_worlds)
        if self.n_steps * tracks > LARGEST_UNROLLING:
            allowed = f"n_steps x hypotheses of all tracks of at most {LARGEST_UNROLLING:,}"
            raise reject("n_steps", self.n_steps, allowed)
        check_between("smallest_alpha", self.smallest_alpha, 0.0, LARGEST_ALPHA)
        check_share("random_declarations", self.random_declarations)


@dataclass(frozen=True, kw_only=True)
class SegmentSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on whole segments, such as MSPRT-TANDEM."""

    n_envs: int  # tracks of a round, one episode each
    batch_size: int  # segments of an update

    largest = NetworkSettings.largest | {"n_envs": LARGEST_COUNT, "batch_size": LARGEST_COUNT}


@dataclass(frozen=True, kw_only=True)
class RewardSettings(SegmentSettings):
    """Hyper-parameters of the agent that learns from rewards alone."""

    every_row: bool = True  # the reward of a declaration teaches all rows of its segment, and not only the last one

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("every_row", self.every_row)


@dataclass(frozen=True, kw_only=True)
class ExpectedRewardSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained on its expected reward; base class."""

    n_steps: int  # ticks of an update; gradients do not reach back beyond its first tick
    belief_weight: float  # of the cross-entropy of the present mode, in addition to the reward

    largest = NetworkSettings.largest | {"n_steps": 10_000}

    def __post_init__(self) -> None:
        super().__post_init__()
        ranged(0.0, LARGEST_WEIGHT)("belief_weight", self.belief_weight)


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every round."""

    durations: tuple[str, ...]  # laws of segments, one environment of every round for each, also repeated
    n_envs: int  # tracks of each environment
    batch_size: int  # tracks of an update
    # smallest and largest factor of the measurement variance of the environment
    variances: tuple[float, float] = (1.0, 1.0)
    radii: tuple[float, float] = (1.0, 1.0)  # likewise of its radii
    ticks: int | None = None  # length of the tracks; None is that of the environment
    inexact: int = 0  # further environments of every round, in which objects move otherwise than told

    largest = ExpectedRewardSettings.largest | {"n_envs": LARGEST_ROUND, "batch_size": LARGEST_ROUND}

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("inexact", self.inexact, minimum=0, maximum=MOST_LAWS)
        fewest = 0 if self.inexact else 1
        if not isinstance(self.durations, (list, tuple)) or not fewest <= len(self.durations) <= MOST_LAWS:
            raise reject("durations", self.durations, f"a list of {fewest} to {MOST_LAWS} laws")
        object.__setattr__(self, "durations", tuple(str(parse_durations(law)) for law in self.durations))
        check_ticks("ticks", 1 if self.ticks is None else self.ticks)
        if self.n_envs * (len(self.durations) + self.inexact) > LARGEST_ROUND:
            raise reject("n_envs", self.n_envs, f"n_envs x environments of at most {LARGEST_ROUND:,}")
        for name in ("variances", "radii"):
            object.__setattr__(self, name, _factors(name, getattr(self, name)))


def _factors(name: str, value: Any) -> tuple[float, float]:
    allowed = "two factors, the smaller one first"
    low, high = (check_number(name, one, allowed) for one in two_values(name, value, allowed))
    if not 1.0 / LARGEST_FACTOR <= low <= high <= LARGEST_FACTOR:
        raise reject(name, value, f"{allowed}, each from {1 / LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}")
    return low, high


@dataclass(frozen=True, kw_only=True)
class StoppingSettings(WorldsSettings):
    """Hyper-parameters of the learned stop, trained on one episode of each track in every round."""

    batch_size: int  # segments of an update
    passes: int  # times that the segments of a round are used
    # smallest and largest delay cost; half of the environments have one drawn between them
    delay_costs: tuple[float, float] = (0.003, 0.05)
    agent: str = "shipped-threshold"  # or the run folder of an anchor agent, with as many hidden units

    largest = NetworkSettings.largest | {"batch_size": LARGEST_COUNT, "passes": 1000}

    def __post_init__(self) -> None:
        super().__post_init__()
        tracks = sum(world.n_envs for world in self.worlds) + sum(one.worlds * one.n_envs for one in self.drawn_worlds)
        if tracks > LARGEST_ROUND:
            raise reject("worlds", self.worlds, f"at most {LARGEST_ROUND:,} tracks, drawn_worlds included")
        object.__setattr__(self, "delay_costs", _factors("delay_costs", self.delay_costs))
        if not isinstance(self.agent, str):
            raise reject("agent", self.agent, "'shipped-threshold' or a run folder")


@dataclass(frozen=True, kw_only=True)
class FlightSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for recorded flights, trained on simulated ones, new ones in every round."""

    flights: tuple[int, ...]  # of each group in a round; short ones are left out, about half of those of D
    rows: int  # approximate number of positions of a flight
    passes: int  # times that the flights of a round are used
    # of a change to a wrong mode: as much as a wrong statement for this time [s], times the scored time of the
    # position over its mean
    change_cost: float

    groups: ClassVar[tuple[str, ...]] = ("A", "B", "C", "D")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.flights, (list, tuple)) or len(self.flights) != len(self.groups):
            raise reject("flights", self.flights, f"a list of the numbers of flights of {', '.join(self.groups)}")
        counts = tuple(check_integer("flights", count, maximum=LARGEST_COUNT) for count in self.flights)
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
    "ppo": PPOSettings, "recurrent_ppo": PPOSettings, "a2c": A2CSettings, "dqn": QSettings, "qrdqn": QSettings,
    "anchor": AnchorSettings, "reward": RewardSettings, "tandem": SegmentSettings, "statements": StatementSettings,
    "rhythm": StatementSettings, "flights": FlightSettings, "gliders": GliderSettings, "kalman": SegmentSettings,
    "distilled": SegmentSettings, "transformer": SegmentSettings, "jump_markov": StatementSettings,
    "stopping": StoppingSettings,
}  # fmt: skip
