"""The agent for flights: a recurrent network on the output of the filter, trained in simulation only."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from agents.learned.flight_inputs import INPUTS, flight_inputs, log_probabilities
from agents.learned.statement_decider import UtilityDecider
from agents.learned.statement_net import StatementNet
from baselines.estimation.turns import STRAIGHT
from baselines.recordings.flights.tracks import FlightTracks
from baselines.rules.decider import FLIGHTS, Actions

BLOCK = 500  # positions that the network processes at once


class FlightAgent(UtilityDecider):
    """The network on recorded flights; see `UtilityDecider`. Before the first position motion is straight."""

    task = FLIGHTS
    observes = "tracks"
    inputs = INPUTS

    def __init__(self, net: StatementNet, margin: float = 0.0):
        super().__init__(net, margin)
        self._tracks: FlightTracks | None = None
        self._outputs = np.empty(0)

    def observe(self, tracks: FlightTracks) -> NDArray[np.float64]:
        """Return the utilities (B, 3) of the modes and that of keeping the statement, together (B, 4)."""
        if self._tracks is not tracks:
            inputs, logs = flight_inputs(tracks.batch, tracks.estimates), log_probabilities(tracks.estimates)
            self._tracks, self._outputs = tracks, self.utilities(inputs, logs)
        return self._outputs[tracks.tick]

    @torch.no_grad()
    def utilities(self, inputs: NDArray[np.float32], logs: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return `observe` at every position, (T, B, 4); the network reads positions up to each only.

        Args:
            inputs: (T, B, 2, 16), see `flight_inputs`.
            logs: (T, B, 3), see `flight_inputs.log_probabilities`.
        """
        found = np.empty((*logs.shape[:2], 4))
        memory = None
        for first in range(0, len(found), BLOCK):
            rows = slice(first, first + BLOCK)
            outputs = self.net(torch.from_numpy(inputs[rows]), torch.from_numpy(logs[rows]), memory)
            memory = outputs.memory
            found[rows, :, :3], found[rows, :, 3] = outputs.utility.double(), outputs.stay.double()
        return found

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[Actions, Actions]:
        """See `Decider.predict`; the state is the last statement, straight motion at first."""
        stated = np.full(len(observation), STRAIGHT) if state is None else state
        started = np.ones(len(observation), np.bool_)
        actions = self.largest(observation[:, :3].copy(), observation[:, 3], stated, started)
        return actions, actions
