"""The statement network as a decider for unknown switch moments."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.policy_file import load_network
from agents.learned.statement_inputs import count_ages, statement_inputs
from agents.learned.statement_net import StatementNet
from baselines.rules.decider import UNKNOWN, Actions, Decider, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import check_number, reject
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions


@dataclass
class StatementState:
    """What a `StatementDecider` remembers of N tracks.

    Attributes:
        memory: (1, N (M - 1), hidden) of the recurrent network.
        best: (N,) most probable mode of the last tick.
        age: (N,) ticks for which it has been the most probable one.
    """

    memory: Tensor
    best: NDArray[np.int64]
    age: NDArray[np.int64]


class StatementDecider(Decider):
    """States the mode with the largest utility, where keeping the statement has a utility of its own.

    Args:
        net: trained network.
        world: options of the environment.
        margin: added to the utility of keeping the statement. With a larger one the statement changes later,
            and less often to a wrong mode.

    Raises:
        ArgumentError: the margin is not a finite number.
    """

    task = UNKNOWN

    def __init__(self, net: StatementNet, world: QuickestOptions, margin: float = 0.0):
        self.net, self.world = net, world
        self.margin = check_number("margin", margin)
        self.layout = QuickestLayout(world.hypotheses)

    @torch.no_grad()
    def predict(
        self,
        observation: Observations,
        state: StatementState | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, StatementState]:
        """See `Decider.predict`; action i states mode i.

        Args:
            observation: (N, 6 M + 2) rows of `hybrid_env.HybridTrackQuickestEnv`.
            state: returned by the previous call; None begins anew.
            episode_start: (N,) True where an episode begins.
            deterministic: not used.
        """
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        tracks, turns = len(rows), self.layout.hypotheses - 1
        if state is None:
            hidden = self.net.recurrent.hidden_size
            nothing = np.full(tracks, -1), np.zeros(tracks, np.int64)
            state = StatementState(torch.zeros(1, tracks * turns, hidden), *nothing)
        elif episode_start is not None and episode_start.any():
            going_on = torch.from_numpy(np.repeat(~episode_start, turns)).float()
            state = StatementState(
                state.memory * going_on[None, :, None], np.where(episode_start, -1, state.best), state.age
            )
        log_probability = self.layout.read(rows, "log_probability")
        best = log_probability.argmax(-1)
        age = count_ages(best, state.best, state.age)
        inputs = torch.from_numpy(statement_inputs(self.world, rows, age)[None])
        outputs = self.net(inputs, torch.from_numpy(log_probability[None]).float(), state.memory)
        stated, started = read_statement(rows)
        utility = outputs.utility[0].double().numpy()
        kept = np.where(started, outputs.stay[0].double().numpy() + self.margin, 0.0)
        utility[np.arange(tracks), stated] += kept
        return utility.argmax(-1), StatementState(outputs.memory, best, age)


def load_statements(folder: Path, weights: dict[str, Tensor], card: dict[str, Any]) -> StatementNet:
    """Return the network for the weights and card that `policy_file.load_policy` read from a folder.

    Raises:
        ArgumentError: weights and card do not match.
    """
    return load_network(folder, weights, card, StatementNet)
