"""Training of the agent for flights, in simulation only: `python -m agents.training.flights --out FOLDER`.

Every round simulates new flights of all tiers, each with settings of its own, and makes one step of the
optimizer for every piece of them, on the expected reward of its statements. The labels are those of the
smoother, as for recorded flights, and positions that they do not score have no reward.
"""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import tyro
from torch import Tensor, nn

from agents.interface.output_files import output_folder
from agents.learned.flight_decider import save_flight_agent
from agents.learned.flight_inputs import INPUTS, flight_inputs, log_probabilities
from agents.learned.policy_file import package_versions
from agents.learned.statement_net import StatementNet
from agents.training.statement_reward import expected_reward
from baselines.estimation.turn_imm import run_turn_imm
from baselines.estimation.turns import TurnModel
from baselines.recordings.flights.flight import stack_flights
from baselines.recordings.flights.labels import label_flights
from baselines.recordings.flights.simulated import DRAWN, WIDE, draw_world, simulate_flights
from baselines.recordings.flights.tiers import TIERS

LARGEST_GRADIENT = 0.5  # norm
MIN_LEARNING_RATE_FACTOR = 0.05
ROWS = {"A": 1.2, "B": 1.2, "C": 5.2, "D": 8.3}  # time between two positions [s], about


@dataclass(kw_only=True)
class FlightTraining:
    """Train the agent for flights in simulation."""

    out: Path = Path("runs/flights")
    """Folder for the weights and their card; they are written after every round."""
    rounds: int = 250
    """Number of rounds."""
    passes: int = 2
    """Times that the flights of a round are used."""
    flights: tuple[int, int, int, int] = (24, 32, 40, 16)
    """Flights of the tiers A to D in a round. Short ones are left out, about half of those of D."""
    rows: int = 1200
    """Positions of a flight, about."""
    n_steps: int = 150
    """Positions of an update. Gradients do not reach back beyond its first one."""
    hidden: int = 64
    """Units of the recurrent layer."""
    learning_rate: float = 4e-3
    """At the beginning; it decays linearly."""
    change_cost: float = 3.0
    """Cost of a change to a wrong mode where steps are average: as much as a wrong statement for this
    time [s]. It is in proportion to the scored time of the position."""
    belief_weight: float = 0.3
    """Weight of the cross-entropy of the present mode, in addition to the reward."""
    seed: int = 0
    """Seed of the flights and of the network."""

    def run(self, note: Callable[[str], None] = print) -> StatementNet:
        """Train, and write the weights."""
        folder = output_folder("out", self.out)
        torch.manual_seed(self.seed)
        generator = np.random.default_rng(10**6 + self.seed)
        net = StatementNet(self.hidden, INPUTS)
        optimizer = torch.optim.Adam(net.parameters(), lr=self.learning_rate)
        begun, updates = time.monotonic(), 0
        total = self.rounds * self.passes * -(-self.rows // self.n_steps)
        for number in range(self.rounds):
            batch = self._simulate(generator)
            rewards = []
            for _ in range(self.passes):
                memory = last = None
                for piece in zip(*(part.split(self.n_steps) for part in batch), strict=True):
                    factor = max(1.0 - updates / total, MIN_LEARNING_RATE_FACTOR)
                    optimizer.param_groups[0]["lr"] = self.learning_rate * factor
                    reward, memory, last = self._step(net, optimizer, piece, memory, last)
                    rewards.append(reward)
                    updates += 1
            text = f"round {number + 1} of {self.rounds}: expected reward {np.mean(rewards):.4f}"
            note(f"{text}, {time.monotonic() - begun:.0f} s")
            card = {"settings": self._settings(), "rounds": number + 1, "versions": package_versions()}
            save_flight_agent(folder, net, card)
        return net

    def _settings(self) -> dict[str, Any]:
        settings = {name: value for name, value in asdict(self).items() if name != "out"}
        return settings | {"world": asdict(WIDE) | DRAWN, "filter": asdict(TurnModel())}

    def _simulate(self, generator: np.random.Generator) -> tuple[Tensor, ...]:
        """Return inputs (T, N, 2, 16), log-probabilities (T, N, 3), labels, weights and costs (T, N).

        Weights are the times that are scored, and costs those of a wrong change, both in steps.
        """
        flights = []
        for (name, step), count in zip(ROWS.items(), self.flights, strict=True):
            for _ in range(count):
                world = draw_world(generator)
                flights += simulate_flights(TIERS[name], 1, step * self.rows, generator, world)[0]
        batch = stack_flights(flights)
        estimates, labels = run_turn_imm(batch), label_flights(flights)
        modes = np.zeros(batch.times.shape, np.int64)
        weights, costs = np.zeros((2, *batch.times.shape), np.float32)
        for column, (k, first, end) in enumerate(batch.pieces):
            rows, step = slice(end - first), ROWS[flights[k].tier.name]
            modes[rows, column] = labels[k].modes[first:end]
            weights[rows, column] = labels[k].weights[first:end] / step
            costs[:, column] = self.change_cost / step
        # of all tiers together; D has some far shorter flights, which are left out
        shortest = int(np.quantile(batch.present.sum(0), 0.1))
        kept = batch.present[shortest - 1]
        arrays = flight_inputs(batch, estimates), log_probabilities(estimates), modes, weights, costs
        return tuple(torch.from_numpy(one[:shortest, kept]) for one in arrays)

    def _step(
        self, net: StatementNet, optimizer: torch.optim.Optimizer, piece: tuple[Tensor, ...],
        memory: Tensor | None, last: Tensor | None,
    ) -> tuple[float, Tensor, Tensor]:  # fmt: skip
        inputs, logs, modes, weights, costs = piece
        outputs = net(inputs, logs, memory)
        rewards, last = expected_reward(outputs.utility, outputs.stay, modes, costs, last, weights)
        beliefs = outputs.belief.flatten(0, 1)
        entropies = nn.functional.cross_entropy(beliefs, modes.flatten(), reduction="none")
        entropy = (weights.flatten() * entropies).mean()
        optimizer.zero_grad()
        (self.belief_weight * entropy - rewards.mean()).backward()
        nn.utils.clip_grad_norm_(net.parameters(), LARGEST_GRADIENT)
        optimizer.step()
        return float(rewards.mean().detach()), outputs.memory.detach(), last.detach()


if __name__ == "__main__":
    torch.set_num_threads(1)
    tyro.cli(FlightTraining).run()
