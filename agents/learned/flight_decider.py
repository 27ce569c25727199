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
from baselines.estimation.turn_imm import TurnEstimates
from baselines.recordings.flights.batch import Batch
from baselines.recordings.flights.labels import STRAIGHT
from hybrid_env.checks import check_integer, check_number

SHIPPED = Path(__file__).parent / "shipped_flights"
BLOCK = 500  # positions that the network processes at once


class FlightAgent:
    """States the mode with the largest utility, where keeping the statement has a utility of its own.

    Args:
        net: trained network.
        margin: added to the utility of keeping the statement.
    """

    def __init__(self, net: StatementNet, margin: float = 0.0):
        self.net, self.margin = net, check_number("margin", margin)

    @torch.no_grad()
    def state_modes(self, batch: Batch, estimates: TurnEstimates) -> NDArray[np.int64]:
        """See `baselines.rules.flight_rules.FlightDecider`."""
        total, tracks = batch.times.shape
        inputs, logs = flight_inputs(batch, estimates), log_probabilities(estimates)
        which = np.arange(tracks)
        stated = np.full(tracks, STRAIGHT)
        output = np.empty((total, tracks), np.int64)
        memory = None
        for first in range(0, total, BLOCK):
            rows = slice(first, min(first + BLOCK, total))
            outputs = self.net(torch.from_numpy(inputs[rows]), torch.from_numpy(logs[rows]), memory)
            memory = outputs.memory
            utilities, stays = outputs.utility.double().numpy(), outputs.stay.double().numpy() + self.margin
            for row, utility, stay in zip(range(rows.start, rows.stop), utilities, stays, strict=True):
                utility[which, stated] += stay
                stated = utility.argmax(-1)
                output[row] = stated
        return output


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
