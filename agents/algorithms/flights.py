"""The agent for recorded flights, trained on simulated ones.

The labels are those of recorded flights, and positions that they do not score have no reward. Steps
are counted as if all flights had the number of positions in the recipe.
"""

import functools
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray

from agents.evaluation.task import Wording
from agents.interface.world_arguments import DEFAULT_ENV
from agents.learned.flight_decider import FlightAgent, log_probabilities
from agents.training.checkpoint import restore_generator
from agents.training.expected_reward import (
    Batch,
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
)
from agents.training.learning_curve import LearningCurve
from agents.training.settings import LARGEST_COUNT, LARGEST_FACTOR
from baselines.estimation.turns import run_turn_imm
from baselines.recordings.flights.flight import TIERS, Flight, stack_flights
from baselines.recordings.flights.labels import Labels, label_flights
from baselines.recordings.flights.simulated import DRAWN, WIDE, draw_world, simulate_flights
from baselines.rules.decider import DeciderFamily
from baselines.rules.threshold import ThresholdDecider
from hybrid_env.checks import check_integer, ranged, reject

# Positions of a round.
LARGEST_FLIGHTS = 2**20
# Of the flights, plus the seed of the run.
FIRST_SEED = 10**6
# Of the flights of the learning curve.
CURVE_SEED = 10**5
# Time between two positions [s], about.
ROWS = {
    "A": 1.2,
    "B": 1.2,
    "C": 5.2,
    "D": 8.3,
}
PROBABILITIES = 0.0, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95
WORDING = Wording(
    "threshold",
    "IMM threshold",
    "threshold rule",
    "position",
    ("right",),
    "right {right:.1%} of the time",
)

Simulated = tuple[list[Flight], list[Labels], list[float]]


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


class Flights(ExpectedRewardAlgorithm):
    """A training run on simulated flights. It refuses an environment, and options of one."""

    name = "flights"
    Settings = FlightSettings
    decider: ClassVar[type[FlightAgent]] = FlightAgent
    settings: FlightSettings
    next_command = "hybridtrack compare --flights --deciders imm"
    smallest_factor: ClassVar[float] = 0.05
    simulation: ClassVar[dict[str, Any]] = asdict(WIDE) | DRAWN
    early: ClassVar[float] = 0.0
    """Time before a change of the label in which a change of the statement costs nothing [s]."""
    curve_flights: ClassVar[tuple[int, ...]] = 12, 16, 20, 8
    """Of the learning curve, of each group."""

    @classmethod
    def run_name(cls, env_id: str, recipe: str) -> str:
        """See `Algorithm.run_name`; there is no environment."""
        return recipe

    def prepare(self) -> None:
        for name, given in (
            ("env", self.env_id != DEFAULT_ENV and self.env_id),
            ("options", self.options),
        ):
            if given:
                raise reject(
                    name,
                    given,
                    "no environment and none of its options, for simulated flights",
                )
        self.round_steps = self.settings.passes * sum(self.settings.flights) * self.settings.rows
        self._generator = np.random.default_rng(FIRST_SEED + self.seed)

    def make_curve(self) -> LearningCurve:
        """See `Algorithm.make_curve`; the episodes are simulated flights, the rule is the threshold
        on the IMM.
        """

        @functools.cache
        def flights() -> Batch:
            return self.simulate(self.curve_flights, np.random.default_rng(CURVE_SEED))

        def measure(family: DeciderFamily) -> dict[str, float]:
            batch = flights()
            agent = family.make(family.default)
            stated = []
            state = None
            for row in agent.utilities(batch.inputs.numpy(), batch.log_probability.numpy()):
                actions, state = agent.predict(row, state)
                stated.append(actions)
            return mean_reward(batch, np.array(stated))

        def measure_rule() -> float:
            batch = flights()
            logs = batch.log_probability.numpy().astype(np.float64)
            return max(
                mean_reward(batch, ThresholdDecider(one).statements(logs))["reward"]
                for one in PROBABILITIES
            )

        return LearningCurve(WORDING, f"{sum(self.curve_flights)} flights", measure, measure_rule)

    def remaining(self) -> float:
        """See `NetworkAlgorithm.remaining`; of the updates, as if all flights were of full
        length.
        """
        rounds = -(-self.steps // self.round_steps)
        updates = rounds * self.settings.passes * -(-self.settings.rows // self.settings.n_steps)
        return 1.0 - self.updates / updates

    def batches(self) -> Iterator[Batch]:
        """Simulate the flights of a round once for all passes."""
        batch = self.simulate(self.settings.flights, self._generator)
        for _ in range(self.settings.passes):
            yield batch

    def values(self) -> dict[str, Any]:
        return {"updates": self.updates, "generator": self._generator.bit_generator.state}

    def restore_values(self, values: dict[str, Any]) -> None:
        super().restore_values(values)
        self.updates = check_integer("updates", values["updates"], minimum=0)
        restore_generator(self._generator, values["generator"])

    def save_agent(self, folder: Path, card: dict[str, Any]) -> None:
        """See `Algorithm.save_agent`; the card also tells how flights were simulated, and the
        filter.
        """
        simulation = {"world": self.simulation, "filter": asdict(self.decider.model)}
        super().save_agent(folder, card | {"environment": self.decider.task} | simulation)

    def draw(self, counts: tuple[int, ...], generator: np.random.Generator) -> Simulated:
        """Return simulated flights of each tier, with settings of their own, their labels, and
        usual steps [s].
        """
        flights = []
        steps = []
        for (name, step), count in zip(ROWS.items(), counts, strict=True):
            for _ in range(count):
                world = draw_world(generator)
                flights += simulate_flights(
                    TIERS[name],
                    1,
                    step * self.settings.rows,
                    generator,
                    world,
                )[0]
                steps.append(step)
        return flights, label_flights(flights), steps

    def simulate(self, counts: tuple[int, ...], generator: np.random.Generator) -> Batch:
        """Return what the network is trained on, from simulated flights of each group.

        Weights of the reward are the times that are scored, and costs those of a wrong change, both
        in steps.
        """
        flights, labels, steps = self.draw(counts, generator)
        batch = stack_flights(flights)
        kind = self.decider
        estimates = run_turn_imm(batch, kind.model)
        modes = np.zeros(batch.times.shape, np.int64)
        weights, costs = np.zeros((2, *batch.times.shape), np.float32)
        for column, (k, first, end) in enumerate(batch.pieces):
            rows = slice(end - first)
            modes[rows, column] = labels[k].modes[first:end]
            weights[rows, column] = labels[k].weights[first:end] / steps[k]
            costs[:, column] = self.settings.change_cost / steps[k]
        for ahead in range(1, round(self.early / min(steps)) + 1):
            costs[:-ahead][modes[:-ahead] != modes[ahead:]] = 0.0
        # Of all flights together; D has some far shorter ones, which are left out.
        shortest = int(np.quantile(batch.present.sum(0), 0.1))
        kept = batch.present[shortest - 1]
        arrays = (
            kind.inputs_of(batch, estimates),
            log_probabilities(estimates),
            modes,
            costs,
            weights,
        )
        return Batch(*(torch.from_numpy(one[:shortest, kept]) for one in arrays))


def mean_reward(batch: Batch, stated: NDArray[np.int64]) -> dict[str, float]:
    """Return the mean reward of a position and the share of right statements, from statements
    (T, N).
    """
    modes, costs, weights = (
        part.numpy() for part in (batch.true_modes, batch.change_cost, batch.weight)
    )
    right = stated == modes
    wrong = np.diff(stated, axis=0, prepend=stated[:1]).astype(np.bool_) & ~right
    total = weights.sum()
    return {
        "reward": float((weights * (right - costs * wrong)).sum() / total),
        "right": float((weights * right).sum() / total),
    }
