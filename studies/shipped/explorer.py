"""What the algorithms of the anchor agent share: the environments of the recipe and random ones,
and an agent in training that explores them.
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from annotated_types import Ge, Interval, MinLen
from numpy.typing import NDArray

from agents import AnchorDecider, NetworkAlgorithm, NetworkSettings, task_of
from baselines import Decider, rollout
from hybrid_env import ArgumentError, HybridTrackVectorEnv, WorldOptions
from studies.arrays import BoolArray, FloatArray
from studies.shipped.random_worlds import draw_world

Count = Annotated[int, Ge(1)]


@dataclass(frozen=True, kw_only=True)
class TrainingWorld:
    """One environment that an agent is trained in, and its number of tracks."""

    # Parallel tracks.
    n_envs: Count
    # Registered id; None uses that of the run.
    env: str | None = None
    # Override those of the id and of the run.
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class DrawnWorlds:
    """Random environments that an agent is trained in, see `random_worlds`."""

    # Number of radii of each bank.
    radii: Count
    # Number of environments at the same time.
    worlds: Count
    # Parallel tracks in each.
    n_envs: Count


@dataclass(frozen=True, kw_only=True)
class WorldsSettings(NetworkSettings):
    """Hyper-parameters of an agent that is trained in several environments; base class."""

    # One episode of each track in every round.
    worlds: Annotated[tuple[TrainingWorld, ...], MinLen(1)]
    # Random environments besides, new ones in every round.
    drawn_worlds: tuple[DrawnWorlds, ...] = ()
    # Probability that a declaration is replaced by a random hypothesis. Anchors after a wrong
    # decision are rare under a good policy; without random declarations, decisions from them take
    # three times as long.
    random_declarations: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0


class WorldsAlgorithm(NetworkAlgorithm):
    """Trains the anchor agent; base class of the two stages.

    A round is determined by its number: a checkpoint between two rounds needs no tracks.
    """

    smallest_factor: ClassVar[float] = 0.02
    decider = AnchorDecider
    settings: Any
    world: WorldOptions

    def prepare(self) -> None:
        """Set the options of the environments; refuse those in which hypotheses are not
        declared.
        """
        self.world = task_of(self.env_id, self.options).options
        self._fixed: list[tuple[WorldOptions, int]] = []
        for world in self.settings.worlds:
            task = task_of(world.env or self.env_id, self.options | dict(world.options))
            if not task.waits or task.options.actions != "all":
                raise ArgumentError(f"env={world.env}: expected one in which modes are declared")
            self._fixed.append((task.options, world.n_envs))

    @property
    def first_seed(self) -> int:
        """Seed of the present round."""
        return 10**12 + self.seed * 10**9 + self.rounds * 10**4

    def explorers(self, generator: np.random.Generator) -> Iterator["Explorer"]:
        """Return an agent that explores one episode of every track, for each environment of a
        round: those of the recipe, and new random ones.
        """
        worlds = list(self._fixed)
        for drawn in self.settings.drawn_worlds:
            worlds += [
                (WorldOptions(**draw_world(generator, drawn.radii)), drawn.n_envs)
                for _ in range(drawn.worlds)
            ]
        worlds = [(self.changed_world(world, generator), tracks) for world, tracks in worlds]
        seed = self.first_seed
        for world, tracks in worlds:
            yield Explorer(self, world, tracks, seed, generator)
            seed += tracks

    def changed_world(self, world: WorldOptions, generator: np.random.Generator) -> WorldOptions:
        """Return the options of an environment in this round."""
        return world

    @abstractmethod
    def draw_margins(self, generator: np.random.Generator, tracks: int) -> FloatArray:
        """Return the thresholds (N,) of a segment on the log-odds of declaring."""


class Seen(NamedTuple):
    """What an agent has seen of N tracks at a tick, and what it has done."""

    # See `AnchorState`.
    inputs: Any
    # (N, width) rows of the environment.
    rows: Any
    # See `AnchorState`.
    best: Any
    # (N,) threshold of the segment.
    margin: FloatArray
    # (N,) whether a declaration counts at this tick.
    counts: BoolArray
    # (N,) that declare.
    stops: BoolArray
    # See `AnchorState`.
    anchors: Any
    # (N, 4) true states.
    truth: FloatArray


class Explorer(Decider):
    """The agent in training on one episode of each track of an environment; it remembers what it
    has seen.
    """

    def __init__(
        self,
        algorithm: WorldsAlgorithm,
        world: WorldOptions,
        tracks: int,
        seed: int,
        generator: np.random.Generator,
    ):
        self.algorithm, self.world, self.seed = algorithm, world, seed
        self.agent = AnchorDecider(algorithm.network, world)
        self.observes = self.agent.observes
        self.observe = self.agent.observe  # type: ignore[method-assign]
        self.generator = generator
        # The trace holds a segment that is decided at once, and the first tick of the next one.
        asked = {**vars(world), "decide_every": 1}
        self.env = HybridTrackVectorEnv(tracks, trace_rows=world.longest_step, **asked)
        self.seen: list[Seen] = []

    def decide(
        self, observation: NDArray[Any], state: Any, episode_start: Any
    ) -> tuple[NDArray[np.int64], Any]:
        """See `Decider.decide`. The state is that of the agent, and the thresholds (N,)."""
        inner, margin = state or (None, np.zeros(len(observation)))
        inner = self.agent.advance(observation, inner, episode_start)
        ratios = inner.ratios
        drawn = self.algorithm.draw_margins(self.generator, len(margin))
        margin = np.where(ratios.read("ticks") < 1.5, drawn, margin)
        ticks, length, truth = (self.env.world.field(name) for name in ("tick", "length", "truth"))
        counts = (ticks % self.world.decide_every == 0) | (ticks == length)
        stops = counts & ((inner.logits > margin) | (ratios.read("ticks_left") < 0.5))
        self.seen.append(
            Seen(inner.inputs, ratios.rows, inner.best, margin, counts, stops, inner.anchors, truth)
        )
        actions = self.agent.declarations(inner, stops)
        if share := self.algorithm.settings.random_declarations:
            replaced = stops & (self.generator.random(len(stops)) < share)
            modes = self.generator.integers(self.world.hypotheses, size=len(stops))
            actions = np.where(replaced, modes + 1, actions)
        return actions, (inner, margin)

    def ticks(self) -> Iterator[tuple[Any, Seen, BoolArray]]:
        """Run the episodes; yield every step, what was seen before it, and the tracks (N,) whose
        episode still went on.
        """
        going = np.ones(self.env.num_envs, np.bool_)
        for now in rollout(self.env, self, self.seed):
            if now.step:
                yield now, self.seen[-1], going
                going = going & ~now.terminated
            if not going.any():
                return
