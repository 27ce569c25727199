"""The agent for flights: a recurrent network on the output of the filter, trained in simulation only."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import save_file

from agents.interface.input_files import read_json
from agents.interface.output_files import atomic_file, write_json
from agents.interface.world_arguments import CARD
from agents.learned.flight_inputs import INPUTS, flight_inputs, log_probabilities
from agents.learned.network_settings import LARGEST_HIDDEN
from agents.learned.policy_file import WEIGHTS, load_weights, read_tensors, unreadable_policy
from agents.learned.statement_net import StatementNet
from baselines.recordings.flights.labels import STRAIGHT
from baselines.recordings.flights.tracks import FlightTracks
from baselines.rules.decider import FLIGHTS, Actions, Decider
from hybrid_env.checks import check_integer, check_number

SHIPPED = Path(__file__).parent / "shipped_flights"
BLOCK = 500  # positions that the network processes at once


class FlightAgent(Decider):
    """States the mode with the largest utility, where keeping the statement has a utility of its own.

    Args:
        net: trained network.
        margin: added to the utility of keeping the statement.
    """

    task = FLIGHTS
    observes = "tracks"

    def __init__(self, net: StatementNet, margin: float = 0.0):
        self.net, self.margin = net, check_number("margin", margin)
        self._tracks: FlightTracks | None = None
        self._outputs = np.empty(0)

    def observe(self, tracks: FlightTracks) -> NDArray[np.float64]:
        """Return the utilities (B, 3) of the modes and that of keeping the statement, together (B, 4)."""
        if self._tracks is not tracks:
            self._tracks, self._outputs = tracks, self._utilities(tracks)
        return self._outputs[tracks.tick]

    @torch.no_grad()
    def _utilities(self, tracks: FlightTracks) -> NDArray[np.float64]:
        """Return `observe` at every position, (T, B, 4); the network reads positions up to each only."""
        inputs, logs = flight_inputs(tracks.batch, tracks.estimates), log_probabilities(tracks.estimates)
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
        which = np.arange(len(observation))
        stated = np.full(len(observation), STRAIGHT) if state is None else state
        utility = observation[:, :3].copy()
        utility[which, stated] += observation[:, 3] + self.margin
        stated = utility.argmax(-1)
        return stated, stated


def save_flight_agent(folder: Path, net: StatementNet, card: dict[str, Any]) -> None:
    """Write the weights and their card."""
    with atomic_file(folder / WEIGHTS) as part:
        save_file({name: one.detach().contiguous() for name, one in net.state_dict().items()}, part)
    write_json(folder / CARD, card)


def load_flight_agent(folder: Path) -> StatementNet:
    """Return the network of a folder.

    Raises:
        ArgumentError: the files are missing or damaged.
    """
    try:
        card = read_json(folder / CARD)
        hidden = check_integer("hidden", card["settings"]["hidden"], maximum=LARGEST_HIDDEN)
        weights, _ = read_tensors(folder / WEIGHTS)
        with torch.device("meta"):
            net = StatementNet(hidden, INPUTS)
        load_weights(net, weights)
    except (OSError, KeyError, TypeError, ValueError, RuntimeError, SafetensorError) as error:
        raise unreadable_policy(folder, error) from None
    return net.eval()


def shipped_flight_decider(margin: float = 0.0) -> FlightAgent:
    """Return the agent whose weights are part of the package.

    Args:
        margin: see `FlightAgent`; a larger one gives fewer false changes and longer delays.
    """
    return FlightAgent(load_flight_agent(SHIPPED), margin)
