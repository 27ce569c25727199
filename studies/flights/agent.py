"""The agent for flights: a recurrent network on the output of the filter, trained in simulation
only.

As in `statement_net`, the network sees a flight once from the side of each turn, with lateral
values mirrored to it. No input depends on the unit of length; times are in seconds, as in the
settings of the filter.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file

from agents import UtilityDecider
from hybrid_env import ArgumentError
from studies.flights.tracks import FlightTracks
from studies.flights.turns import STRAIGHT, Batch, TurnEstimates, TurnModel

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
    ratios = np.maximum(
        likelihoods - likelihoods.max(-1, keepdims=True),
        LOWEST_RATIO,
    )
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
    since = np.maximum.accumulate(
        np.where(changed, rows, 0),
        axis=0,
    )
    return times - np.take_along_axis(times, since, axis=0)


class FlightAgent(UtilityDecider):
    """The network on recorded flights, at K settings. Before the first position motion is straight.

    Args:
        net: trained network.
        settings: K pairs, added to the utility of keeping a statement: of straight flight, and of a
            turn; or one number for both. With larger ones the statement changes later, and less
            often to a wrong mode.
    """

    task = "flights"
    inputs = INPUTS
    model: ClassVar[TurnModel] = TurnModel()
    """Settings of the filter."""

    def __init__(self, net: Any, *settings: tuple[float, float] | float):
        super().__init__(net)
        pairs = [np.broadcast_to(setting, 2) for setting in settings or (0.0,)]
        # (K,)
        self.straight, self.turn = np.array(pairs, np.float64).T

    @classmethod
    def read(cls, folder: Path) -> Callable[..., "FlightAgent"]:
        """Return the agent of a folder as a function of its settings.

        Raises:
            ArgumentError: the folder has no weights of such an agent.
        """
        try:
            weights = load_file(folder / "policy.safetensors")
            net = cls.network(weights["recurrent.weight_hh_l0"].shape[1])
            net.load_state_dict(weights)
        except (OSError, KeyError, RuntimeError, SafetensorError) as error:
            raise ArgumentError(
                f"decider={str(folder)!r}: expected the folder of an agent for these flights"
                f" ({str(error).splitlines()[0]})"
            ) from None
        return lambda *settings: cls(net, *settings)

    @classmethod
    def inputs_of(cls, batch: Batch, estimates: TurnEstimates) -> NDArray[np.float32]:
        """Return the inputs (T, B, 2, inputs) of the network."""
        return flight_inputs(batch, estimates)

    @torch.no_grad()
    def utilities(
        self,
        inputs: NDArray[np.float32],
        logs: NDArray[np.float32],
    ) -> NDArray[np.float64]:
        """Return the utilities of the modes and that of keeping the statement, together (T, B, 4);
        the network reads positions up to each only.

        Args:
            inputs: (T, B, 2, inputs), see `inputs_of`.
            logs: (T, B, 3), see `log_probabilities`.
        """
        utilities = np.empty((*logs.shape[:2], 4))
        memory = None
        for first in range(0, len(utilities), BLOCK):
            rows = slice(first, first + BLOCK)
            outputs = self.net(
                torch.from_numpy(inputs[rows]),
                torch.from_numpy(logs[rows]),
                memory,
            )
            memory = outputs.memory
            utilities[rows, :, :3] = outputs.utility.double()
            utilities[rows, :, 3] = outputs.stay.double()
        return utilities

    def choose(self, utilities: NDArray[np.float64]) -> NDArray[np.int8]:
        """Return the statements (T, B, K) with the largest utilities (T, B, 4)."""
        total, pieces = utilities.shape[:2]
        stated = np.full(
            (total + 1, pieces, len(self.turn)),
            STRAIGHT,
            np.int8,
        )
        for tick, values in enumerate(utilities):
            before = stated[tick]
            keep = values[:, 3, None] + np.where(before == STRAIGHT, self.straight, self.turn)
            kept = before[..., None] == np.arange(3)
            with_keep = values[:, None, :3] + np.where(kept, keep[..., None], 0.0)
            stated[tick + 1] = with_keep.argmax(-1)
        return stated[1:]

    def statements(self, tracks: FlightTracks) -> NDArray[np.int8]:
        """Return the statements (T, B, K) on tracks."""
        inputs = self.inputs_of(tracks.batch, tracks.estimates)
        return self.choose(self.utilities(inputs, log_probabilities(tracks.estimates)))
