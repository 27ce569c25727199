"""The agent for flights: a recurrent network on the output of the filter, trained in simulation
only.

As in `statement_net`, the network sees a flight once from the side of each turn, with lateral
values mirrored to it. No input depends on the unit of length; times are in seconds, as in the
settings of the filter.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from agents.learned.statement_decider import UtilityDecider
from agents.learned.statement_net import StatementNet
from baselines.estimation.turns import STRAIGHT, Batch, TurnEstimates, TurnModel
from baselines.recordings.flights.tracks import FlightTracks
from baselines.rules.decider import FLIGHTS, Actions

INPUTS = 16
LOWEST_LOG, LOWEST_RATIO, LARGEST_INNOVATION = -15.0, -10.0, 6.0
# Of a left and of a right turn.
SIDES = (1.0, -1.0)
# Positions that the network processes at once.
BLOCK = 500


def log_probabilities(estimates: TurnEstimates) -> NDArray[np.float32]:
    """Return the logarithms (T, B, 3) of the probabilities of the modes, at least -15."""
    return np.maximum(np.log(np.maximum(estimates.probabilities, 1e-30)), LOWEST_LOG).astype(
        np.float32
    )


def flight_inputs(batch: Batch, estimates: TurnEstimates, unit: float = 2.0) -> NDArray[np.float32]:
    """Return the inputs (T, B, 2, 16) from the side of a left and of a right turn; turn rates in
    units [deg/s].
    """
    logs = log_probabilities(estimates)
    likelihoods = estimates.log_likelihoods
    ratios = np.maximum(likelihoods - likelihoods.max(-1, keepdims=True), LOWEST_RATIO)
    innovations = np.clip(estimates.innovations, -LARGEST_INNOVATION, LARGEST_INNOVATION)
    steps = np.where(batch.steps > 0.0, batch.steps, 1.0)
    ages = _ages(logs.argmax(-1), batch.times)
    sway = estimates.speeds * batch.timing / batch.across
    each = []
    for turn, (side, other) in enumerate(zip((1, 2), (2, 1), strict=True)):
        order = [0, side, other]
        columns = [
            *(2.0 * np.exp(logs[..., mode]) - 1.0 for mode in order),
            *(logs[..., mode] / 5.0 for mode in order),
            *(ratios[..., mode] / 3.0 for mode in order),
            SIDES[turn] * np.degrees(estimates.rates) / unit,
            0.5 * innovations[..., 0],
            0.5 * SIDES[turn] * innovations[..., 1],
            np.log(np.clip(steps, 0.1, 100.0)),
            0.5 * np.log(np.clip(sway, 0.01, 1000.0)),
            np.minimum(ages / 100.0, 2.0),
            np.log(1.0 + ages) / 5.0,
        ]
        each.append(np.stack(columns, axis=-1).astype(np.float32))
    return np.stack(each, axis=-2)


def _ages(best: NDArray[np.int64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the time for which the most probable mode has been the same, (T, B) [s]."""
    rows = np.arange(len(best))[:, None]
    changed = np.diff(best, axis=0, prepend=best[:1]) != 0
    since = np.maximum.accumulate(np.where(changed, rows, 0), axis=0)
    return times - np.take_along_axis(times, since, axis=0)


class FlightAgent(UtilityDecider):
    """The network on recorded flights; see `UtilityDecider`. Before the first position motion is
    straight.
    """

    task = FLIGHTS
    observes = "tracks"
    inputs = INPUTS
    model = TurnModel()
    """Settings of the filter."""

    def __init__(self, net: StatementNet, margin: float = 0.0):
        super().__init__(net, margin)
        self._tracks: FlightTracks | None = None
        self._outputs = np.empty(0)

    @staticmethod
    def inputs_of(batch: Batch, estimates: TurnEstimates) -> NDArray[np.float32]:
        """Return the inputs (T, B, 2, inputs) of the network."""
        return flight_inputs(batch, estimates)

    def observe(self, tracks: FlightTracks) -> NDArray[np.float64]:
        """Return the utilities (B, 3) of the modes and that of keeping the statement, together
        (B, 4).
        """
        if self._tracks is not tracks:
            inputs = self.inputs_of(tracks.batch, tracks.estimates)
            logs = log_probabilities(tracks.estimates)
            self._tracks, self._outputs = tracks, self.utilities(inputs, logs)
        return self._outputs[tracks.tick]

    @torch.no_grad()
    def utilities(
        self,
        inputs: NDArray[np.float32],
        logs: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Return `observe` at every position, (T, B, 4); the network reads positions up to each
        only.

        Args:
            inputs: (T, B, 2, inputs), see `inputs_of`.
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

    def decide(self, observation: Any, state: Any, episode_start: Any) -> tuple[Actions, Actions]:
        """See `Decider.decide`; the state is the last statement, straight motion at first."""
        stated = np.full(len(observation), STRAIGHT) if state is None else state
        started = np.ones(len(observation), np.bool_)
        actions = self.largest(observation[:, :3].copy(), observation[:, 3], stated, started)
        return actions, actions
