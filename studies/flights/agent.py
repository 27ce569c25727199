"""The agent for flights: a recurrent network on the output of the filter, trained in simulation
only.

As in `statement_net`, the network sees a flight once from the side of each turn, with lateral
values mirrored to it. No input depends on the unit of length; times are in seconds, as in the
settings of the filter.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file

from agents import UtilityDecider
from hybrid_env import ArgumentError
from studies.flights.rules import Settings, TurnRule
from studies.flights.turns import STRAIGHT, Batch, FloatArray, IntArray, TurnEstimates, TurnModel

Inputs = NDArray[np.float32]


def log_probabilities(estimates: TurnEstimates) -> Inputs:
    """Return the logarithms (T, B, 3) of the probabilities of the modes, at least -15."""
    logs = np.log(np.maximum(estimates.probabilities, 1e-30))
    return np.maximum(logs, -15.0).astype(np.float32)


class FlightAgent(UtilityDecider):
    """The network on recorded flights.

    A setting is added to the utility of keeping a statement: of straight flight, and of a turn.
    With larger ones the statement changes later, and less often to a wrong mode.
    """

    task = "flights"
    inputs = 16
    model: ClassVar[TurnModel] = TurnModel()
    """Settings of the filter."""
    shipped: ClassVar[Path] = Path(__file__).with_name("shipped")
    """Folder of its weights."""
    unit: ClassVar[float] = 2.0
    """Turn rate of the input 1 [deg/s]."""
    grid: ClassVar[Settings] = ((0.0, 0.0),)
    """See `TurnRule`."""

    @classmethod
    def rule(cls, name: str, rules: Iterable[str]) -> TurnRule:
        """Return the shipped agent, or that of a folder.

        Raises:
            ArgumentError: it is no folder, where names of rules are possible too, or has no weights
                of such an agent.
        """
        folder = cls.shipped if name == "agent" else Path(name)
        try:
            weights = load_file(folder / "policy.safetensors")
            net = cls.network(weights["recurrent.weight_hh_l0"].shape[1])
            net.load_state_dict(weights)
        except (OSError, KeyError, RuntimeError, SafetensorError) as error:
            expected = ", ".join((*rules, "agent"))
            raise ArgumentError(
                f"deciders={name!r}: expected {expected}, or the folder of an agent for these"
                f" flights ({str(error).splitlines()[0]})"
            ) from None
        return TurnRule(state=cls(net).state, grid=cls.grid, models=(cls.model,))

    def state(self, batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
        """Return the statements (T, B, K) at K settings. Before the first position motion is
        straight.
        """
        logs = log_probabilities(estimates)
        return self.choose(self.utilities(self.inputs_of(batch, estimates), logs), settings)

    @classmethod
    def inputs_of(cls, batch: Batch, estimates: TurnEstimates) -> Inputs:
        """Return the inputs (T, B, 2, inputs) of the network, from the side of a left and of a
        right turn.
        """
        logs = log_probabilities(estimates)
        likelihoods = estimates.log_likelihoods
        ratios = np.maximum(likelihoods - likelihoods.max(-1, keepdims=True), -10.0)
        along, across = np.moveaxis(np.clip(estimates.innovations, -6.0, 6.0), -1, 0)
        steps = np.where(batch.steps > 0.0, batch.steps, 1.0)
        best = logs.argmax(-1)
        changed = np.diff(best, axis=0, prepend=best[:1]) != 0
        began = np.where(changed, batch.times, batch.times[:1])
        # For which the most probable mode has been the same [s].
        ages = batch.times - np.maximum.accumulate(began, axis=0)
        sway = estimates.speeds * batch.timing / batch.across
        each = []
        for side, order in ((1.0, [0, 1, 2]), (-1.0, [0, 2, 1])):
            columns = [
                *(2.0 * np.exp(logs[..., mode]) - 1.0 for mode in order),
                *(logs[..., mode] / 5.0 for mode in order),
                *(ratios[..., mode] / 3.0 for mode in order),
                side * np.degrees(estimates.rates) / cls.unit,
                0.5 * along,
                0.5 * side * across,
                np.log(np.clip(steps, 0.1, 100.0)),
                0.5 * np.log(np.clip(sway, 0.01, 1000.0)),
                np.minimum(ages / 100.0, 2.0),
                np.log(1.0 + ages) / 5.0,
            ]
            each.append(np.stack(columns, axis=-1).astype(np.float32))
        return np.stack(each, axis=-2)

    @torch.no_grad()
    def utilities(self, inputs: Inputs, logs: Inputs, block: int = 500) -> FloatArray:
        """Return the utilities of the modes and that of keeping the statement, together (T, B, 4);
        the network reads positions up to each only.

        Args:
            inputs: (T, B, 2, inputs), see `inputs_of`.
            logs: (T, B, 3), see `log_probabilities`.
            block: number of positions that the network processes at once.
        """
        parts = []
        memory = None
        tensors = (torch.from_numpy(part).split(block) for part in (inputs, logs))
        for blocks in zip(*tensors, strict=True):
            outputs = self.net(*blocks, memory)
            memory = outputs.memory
            parts.append(torch.cat([outputs.utility, outputs.stay[..., None]], -1))
        return torch.cat(parts).double().numpy()

    def choose(self, utilities: FloatArray, settings: Settings = ((0.0, 0.0),)) -> IntArray:
        """Return the statements (T, B, K) with the largest utilities (T, B, 4)."""
        straight, turn = np.array(settings).T
        stated = np.full((*utilities.shape[:2], len(turn)), STRAIGHT, "int8")
        for tick, values in enumerate(utilities):
            before = stated[tick - 1]
            keep = values[:, 3, None] + np.where(before == STRAIGHT, straight, turn)
            kept = before[..., None] == np.arange(3)
            stated[tick] = (values[:, None, :3] + kept * keep[..., None]).argmax(-1)
        return stated
