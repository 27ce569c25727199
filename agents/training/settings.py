"""Hyper-parameters of the training algorithms, and their limits."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agents.learned.policy_file import LARGEST_HIDDEN
from agents.training.learning_rate import learning_rate_schedule
from agents.training.stable_baselines_settings import LARGEST_COUNT, LARGEST_WEIGHT, A2CSettings, PPOSettings, QSettings
from hybrid_env.checks import check_flag, check_integer, check_number, check_positive, reject
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
    """One environment that the anchor agent is trained in, and its number of tracks.

    Attributes:
        n_envs: number of parallel tracks.
        env: registered id; None uses the id of the run.
        options: environment options that override those of the id and of the run.
    """

    n_envs: int
    env: str | None = None
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
    """Random environments that the anchor agent is trained in, see `agents.evaluation.worlds`.

    Attributes:
        radii: number of radii of each bank.
        worlds: number of environments at the same time.
        n_envs: number of parallel tracks in each.
    """

    radii: int
    worlds: int
    n_envs: int

    def __post_init__(self) -> None:
        check_integer("radii", self.radii, maximum=MAX_RADII)
        check_integer("worlds", self.worlds, maximum=MOST_DRAWN)
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)


@dataclass(frozen=True, kw_only=True)
class AnchorSettings:
    """Hyper-parameters of the anchor agent.

    Attributes:
        worlds: environments that it is trained in at the same time.
        n_steps: ticks between updates.
        hidden: units of each hidden layer.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
        smallest_alpha: smallest error probability at which a track declares. The threshold of a track is
            drawn log-uniformly between this value and 0.3 after each declaration.
        last_tick: tick at which every track declares; later ticks contribute little to learning.
        random_declarations: probability that a declaration is replaced by a random hypothesis. Anchors after
            a wrong decision are rare under a good policy; without such training, decisions from them take
            three times as long.
        drawn_worlds: random environments besides `worlds`.
        updates_per_world: updates after which the random environments are drawn anew.
        buffer_size: number of the last anchors, and of the last declarations, that samples are drawn from.
        batches: steps of the optimizer per update.
        batch_size: samples of a step.
    """

    worlds: tuple[TrainingWorld, ...]
    n_steps: int
    hidden: int
    learning_rate: str | float
    smallest_alpha: float
    last_tick: int
    random_declarations: float
    drawn_worlds: tuple[DrawnWorlds, ...] = ()
    updates_per_world: int = 32
    buffer_size: int = 50_000
    batches: int = 8
    batch_size: int = 1024

    def __post_init__(self) -> None:
        limits = {
            "n_steps": 10_000, "hidden": LARGEST_HIDDEN, "last_tick": 10**6, "updates_per_world": 10**6,
            "buffer_size": 10**6, "batches": 1000, "batch_size": 10**5,
        }  # fmt: skip
        for name, largest in limits.items():
            check_integer(name, getattr(self, name), maximum=largest)
        check_worlds(self.worlds, self.drawn_worlds)
        tracks = 3 * sum(world.n_envs for world in self.worlds)
        tracks += sum(drawn.worlds * drawn.n_envs * (2 * drawn.radii + 1) for drawn in self.drawn_worlds)
        if self.n_steps * tracks > LARGEST_UNROLLING:
            allowed = f"n_steps x hypotheses of all tracks of at most {LARGEST_UNROLLING:,}"
            raise reject("n_steps", self.n_steps, allowed)
        learning_rate_schedule(self.learning_rate)
        if not 0.0 < check_number("smallest_alpha", self.smallest_alpha) < LARGEST_ALPHA:
            raise reject("smallest_alpha", self.smallest_alpha, f"a number between 0 and {LARGEST_ALPHA}")
        if not 0.0 <= check_number("random_declarations", self.random_declarations) < 1.0:
            raise reject("random_declarations", self.random_declarations, "a number >= 0 and < 1")


@dataclass(frozen=True, kw_only=True)
class SegmentSettings:
    """Hyper-parameters of an agent that is trained on whole segments, such as MSPRT-TANDEM.

    Attributes:
        n_envs: tracks of a round, one episode each.
        batch_size: segments of an update.
        hidden: units of each layer.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
    """

    n_envs: int
    batch_size: int
    hidden: int
    learning_rate: str | float

    def __post_init__(self) -> None:
        for name, largest in {"n_envs": LARGEST_COUNT, "batch_size": LARGEST_COUNT, "hidden": LARGEST_HIDDEN}.items():
            check_integer(name, getattr(self, name), maximum=largest)
        learning_rate_schedule(self.learning_rate)


@dataclass(frozen=True, kw_only=True)
class RewardSettings(SegmentSettings):
    """Hyper-parameters of the agent that learns from rewards alone.

    Attributes:
        every_row: the reward of a declaration teaches all rows of its segment, and not only the last one.
    """

    every_row: bool = True

    def __post_init__(self) -> None:
        super().__post_init__()
        check_flag("every_row", self.every_row)


@dataclass(frozen=True, kw_only=True)
class ExpectedRewardSettings:
    """Hyper-parameters of an agent that is trained on its expected reward; base class.

    Attributes:
        n_steps: ticks of an update. Gradients do not reach back beyond its first tick.
        hidden: units of the recurrent layer.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
        belief_weight: weight of the cross-entropy of the present mode, in addition to the reward.
    """

    n_steps: int
    hidden: int
    learning_rate: str | float
    belief_weight: float

    def __post_init__(self) -> None:
        check_integer("n_steps", self.n_steps, maximum=10_000)
        check_integer("hidden", self.hidden, maximum=LARGEST_HIDDEN)
        learning_rate_schedule(self.learning_rate)
        if not 0.0 <= check_number("belief_weight", self.belief_weight) <= LARGEST_WEIGHT:
            raise reject("belief_weight", self.belief_weight, f"a number from 0 to {LARGEST_WEIGHT:g}")


@dataclass(frozen=True, kw_only=True)
class StatementSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for unknown switch moments, trained on new tracks in every round.

    Attributes:
        durations: laws of the durations of segments, one environment of every round for each, also repeated.
        n_envs: tracks of each environment.
        variances: smallest and largest factor of the measurement variance of the environment.
        radii: smallest and largest factor of its radii.
        batch_size: tracks of an update.
        ticks: length of the tracks; None is that of the environment.
    """

    durations: tuple[str, ...]
    n_envs: int
    variances: tuple[float, float]
    radii: tuple[float, float]
    batch_size: int
    ticks: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.durations, (list, tuple)) or not 1 <= len(self.durations) <= MOST_LAWS:
            raise reject("durations", self.durations, f"a list of 1 to {MOST_LAWS} laws")
        object.__setattr__(self, "durations", tuple(str(parse_durations(law)) for law in self.durations))
        for name in ("n_envs", "batch_size"):
            check_integer(name, getattr(self, name), maximum=LARGEST_ROUND)
        check_ticks("ticks", 1 if self.ticks is None else self.ticks)
        if self.n_envs * len(self.durations) > LARGEST_ROUND:
            raise reject("n_envs", self.n_envs, f"n_envs x laws of at most {LARGEST_ROUND:,}")
        for name in ("variances", "radii"):
            object.__setattr__(self, name, _factors(name, getattr(self, name)))


def _factors(name: str, value: Any) -> tuple[float, float]:
    allowed = "two factors, the smaller one first"
    low, high = (check_number(name, one, allowed) for one in two_values(name, value, allowed))
    if not 1.0 / LARGEST_FACTOR <= low <= high <= LARGEST_FACTOR:
        raise reject(name, value, f"{allowed}, each from {1 / LARGEST_FACTOR:g} to {LARGEST_FACTOR:g}")
    return low, high


@dataclass(frozen=True, kw_only=True)
class StoppingSettings:
    """Hyper-parameters of the learned stop.

    Attributes:
        worlds: environments of every round, one episode of each track.
        drawn_worlds: random environments besides, new ones in every round.
        delay_costs: smallest and largest delay cost; half of the environments have one drawn between them.
        hidden: units of each layer, as many as those of the anchor agent.
        learning_rate: constant, or "lin_" and the initial value for linear decay.
        batch_size: segments of an update.
        passes: times that the segments of a round are used.
        agent: "shipped", or the run folder of an anchor agent.
    """

    worlds: tuple[TrainingWorld, ...]
    hidden: int
    learning_rate: str | float
    batch_size: int
    passes: int
    drawn_worlds: tuple[DrawnWorlds, ...] = ()
    delay_costs: tuple[float, float] = (0.003, 0.05)
    agent: str = "shipped"

    def __post_init__(self) -> None:
        for name, largest in {"hidden": LARGEST_HIDDEN, "batch_size": LARGEST_COUNT, "passes": 1000}.items():
            check_integer(name, getattr(self, name), maximum=largest)
        learning_rate_schedule(self.learning_rate)
        check_worlds(self.worlds, self.drawn_worlds)
        tracks = sum(world.n_envs for world in self.worlds) + sum(one.worlds * one.n_envs for one in self.drawn_worlds)
        if tracks > LARGEST_ROUND:
            raise reject("worlds", self.worlds, f"at most {LARGEST_ROUND:,} tracks, drawn_worlds included")
        object.__setattr__(self, "delay_costs", _factors("delay_costs", self.delay_costs))
        if not isinstance(self.agent, str):
            raise reject("agent", self.agent, "'shipped' or a run folder")


def check_worlds(worlds: Sequence[TrainingWorld], drawn_worlds: Sequence[DrawnWorlds]) -> None:
    """Raise `ArgumentError` without an environment, or with too many."""
    if not 1 <= len(worlds) <= MOST_WORLDS:
        raise reject("worlds", worlds, f"one to {MOST_WORLDS} environments")
    if len(drawn_worlds) > MOST_WORLDS:
        raise reject("drawn_worlds", drawn_worlds, f"at most {MOST_WORLDS} entries")


@dataclass(frozen=True, kw_only=True)
class FlightSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for recorded flights, trained on simulated ones, new ones in every round.

    Attributes:
        flights: of the tiers A to D in a round. Short ones are left out, about half of those of D.
        rows: approximate number of positions of a flight.
        passes: times that the flights of a round are used.
        change_cost: of a change to a wrong mode: as much as a wrong statement for this time [s], times the
            scored time of the position over its mean.
    """

    flights: tuple[int, ...]
    rows: int
    passes: int
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
        if check_positive("change_cost", self.change_cost, allow_zero=True) > LARGEST_FACTOR:
            raise reject("change_cost", self.change_cost, f"a number from 0 to {LARGEST_FACTOR:g}")


@dataclass(frozen=True, kw_only=True)
class GliderSettings(FlightSettings):
    """Those of the agent for gliders, with one number of flights of a round."""

    groups = ("gliders",)


Settings = (
    PPOSettings
    | A2CSettings
    | QSettings
    | AnchorSettings
    | SegmentSettings
    | StatementSettings
    | FlightSettings
    | StoppingSettings
)
ALGORITHMS: dict[str, type[Settings]] = {
    "ppo": PPOSettings, "recurrent_ppo": PPOSettings, "a2c": A2CSettings, "dqn": QSettings, "qrdqn": QSettings,
    "anchor": AnchorSettings, "reward": RewardSettings, "tandem": SegmentSettings, "statements": StatementSettings,
    "rhythm": StatementSettings, "flights": FlightSettings, "gliders": GliderSettings, "kalman": SegmentSettings,
    "distilled": SegmentSettings, "transformer": SegmentSettings, "jump_markov": StatementSettings,
    "stopping": StoppingSettings,
}  # fmt: skip
