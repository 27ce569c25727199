"""Training of the agent for recorded flights, on simulated ones: `hybridtrack train --recipe
studies/flights/flights.yml`.

The labels are those of recorded flights, and positions that they do not score have no reward. Steps
are counted as if all flights had the number of positions in the recipe.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from annotated_types import Ge, Interval, MinLen
from numpy.random import Generator
from numpy.typing import NDArray

from baselines import ThresholdDecider
from hybrid_env import ArgumentError
from studies.flights.agent import FlightAgent, log_probabilities
from studies.flights.flight import TIERS, Flight, stack_flights
from studies.flights.labels import Labels, label_flights
from studies.flights.simulated import draw_world, simulate_flight
from studies.flights.turns import run_turn_imm
from studies.shipped.expected_reward import (
    ExpectedRewardAlgorithm,
    ExpectedRewardSettings,
    StatementBatch,
)

Simulated = tuple[list[Flight], list[Labels], list[float]]
"""Flights, their labels, and usual steps [s]."""


@dataclass(frozen=True, kw_only=True)
class FlightSettings(ExpectedRewardSettings):
    """Hyper-parameters of the agent for recorded flights, trained on simulated ones, new ones in
    every round.
    """

    # Flights of each group in a round; short ones are left out, about half of those of D.
    flights: Annotated[tuple[Annotated[int, Interval(ge=1, le=1000)], ...], MinLen(1)]
    # Approximate number of positions of a flight.
    rows: Annotated[int, Ge(1)]
    # Times that the flights of a round are used.
    passes: Annotated[int, Ge(1)]
    # Cost of a change to a wrong mode: as much as a wrong statement for this time [s], times the
    # scored time of the position over its mean.
    change_cost: float


class Flights(ExpectedRewardAlgorithm):
    """A training run on simulated flights; it takes no environment."""

    Settings = FlightSettings
    decider: ClassVar[type[FlightAgent]] = FlightAgent
    settings: FlightSettings
    next_command = "python -m studies.flights --deciders imm"
    smallest_factor: ClassVar[float] = 0.05
    early: ClassVar[float] = 0.0
    """Time before a change of the label in which a change of the statement costs nothing [s]."""
    curve_flights: ClassVar[tuple[int, ...]] = (12, 16, 20, 8)
    """Of the learning curve, of each group."""

    @classmethod
    def run_name(cls, env_id: str, recipe: str) -> str:
        """See `Algorithm.run_name`; there is no environment."""
        return recipe

    def prepare(self) -> None:
        """See `ExpectedRewardAlgorithm.prepare`."""
        if self.options or not self.env_id.endswith("HybridTrack-v0"):
            raise ArgumentError(f"env={self.env_id}: expected no environment and no option of one")
        self.round_steps = self.settings.passes * sum(self.settings.flights) * self.settings.rows
        self._generator = np.random.default_rng(1_000_000 + self.seed)

    def make_curve(self) -> Any:
        """See `Algorithm.make_curve`; the episodes are simulated flights, the rule is the threshold
        on the IMM.
        """

        @functools.cache
        def flights() -> StatementBatch:
            return self.simulate(self.curve_flights, np.random.default_rng(100_000))

        def measure(agent: Any) -> dict[str, float]:
            inputs, logs, *_ = (part.numpy() for part in flights())
            stated = agent.choose(agent.utilities(inputs, logs))
            return mean_reward(flights(), stated[..., 0])

        def measure_references() -> dict[str, float]:
            logs = flights().log_probability.double().numpy()
            stated = ThresholdDecider(0.6).statements(logs)
            return {"IMM threshold": mean_reward(flights(), stated)["reward"]}

        return replace(
            super().make_curve(),
            unit="position",
            sample=f"{sum(self.curve_flights)} flights",
            measure=measure,
            measure_references=measure_references,
        )

    def remaining(self) -> float:
        """See `NetworkAlgorithm.remaining`; of the updates, as if all flights were of full
        length.
        """
        rounds = -(-self.steps // self.round_steps)
        updates = rounds * self.settings.passes * -(-self.settings.rows // self.settings.n_steps)
        return 1.0 - self.updates / updates

    def batches(self) -> Iterator[StatementBatch]:
        """Simulate the flights of a round once for all passes."""
        batch = self.simulate(self.settings.flights, self._generator)
        for _ in range(self.settings.passes):
            yield batch

    def values(self) -> dict[str, Any]:
        """See `Algorithm.values`."""
        generator = self._generator.bit_generator.state
        return super().values() | {"updates": self.updates, "generator": generator}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Algorithm.restore_values`."""
        super().restore_values(values)
        self.updates = int(values["updates"])
        self._generator.bit_generator.state = values["generator"]

    def draw(self, counts: tuple[int, ...], generator: Generator) -> Simulated:
        """Return simulated flights of each tier, with settings of their own."""
        # Time between two positions [s], about.
        steps = np.repeat((1.2, 1.2, 5.2, 8.3), counts).tolist()
        flights = [
            simulate_flight(
                TIERS[name], step * self.settings.rows, generator, draw_world(generator)
            )
            for name, step in zip(np.repeat(list("ABCD"), counts), steps, strict=True)
        ]
        labelled = [flight for flight, _ in flights]
        return labelled, label_flights(labelled), steps

    def simulate(self, counts: tuple[int, ...], generator: Generator) -> StatementBatch:
        """Return what the network is trained on, from simulated flights of each group.

        Weights of the reward are the times that are scored, and costs those of a wrong change, both
        in steps.
        """
        flights, labels, steps = self.draw(counts, generator)
        batch = stack_flights(flights)
        estimates = run_turn_imm(batch, self.decider.model)
        # Time step of each position among those of all flights.
        times = np.repeat(steps, np.diff(batch.offsets))[batch.rows]
        modes, weights = (
            np.concatenate([getattr(each, name) for each in labels])[batch.rows] * batch.present
            for name in ("modes", "weights")
        )
        costs = self.settings.change_cost / times
        for ahead in range(1, round(self.early / min(steps)) + 1):
            costs[:-ahead][modes[:-ahead] != modes[ahead:]] = 0.0
        arrays = (
            self.decider.inputs_of(batch, estimates),
            log_probabilities(estimates),
            modes,
            costs.astype(np.float32),
            (weights / times).astype(np.float32),
        )
        # Nearly the shortest of all flights; D has some far shorter ones, which are left out.
        shortest = int(np.quantile(batch.present.sum(0), 0.1))
        kept = batch.present[shortest - 1]
        return StatementBatch(*(torch.from_numpy(array[:shortest, kept]) for array in arrays))


def mean_reward(batch: StatementBatch, stated: NDArray[Any]) -> dict[str, float]:
    """Return the mean reward of a position and the share of right statements, from statements
    (T, N).
    """
    _, _, modes, costs, weights = (part.numpy() for part in batch)
    right = stated == modes
    wrong = (np.diff(stated, axis=0, prepend=stated[:1]) != 0) & ~right
    return {
        "reward": float((weights * (right - costs * wrong)).sum() / weights.sum()),
        "right": float((weights * right).sum() / weights.sum()),
    }
