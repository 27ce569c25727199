"""The statement network as a decider."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from agents.learned.statement_net import INPUTS, StatementNet, statement_inputs
from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.decider import UNKNOWN, Actions, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import BoolArray, Float32Array, FloatArray, IntArray, reject
from hybrid_env.observation import QuickestLayout
from hybrid_env.quickest_options import QuickestOptions


class UtilityDecider(NetworkDecider):
    """States the mode with the largest utility, where keeping the statement has a utility of its
    own.

    Base class; the subclasses give the inputs of the network.

    Args:
        net: trained network.
        margin: added to the utility of keeping the statement. With a larger one the statement
            changes later, and less often to a wrong mode.

    Raises:
        ArgumentError: the margin is not a finite number.
    """

    symbol = "log-odds"
    thresholds = (
        *(-4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0),
        *(13.0, 16.0, 20.0),
    )
    inputs: ClassVar[int]
    """Number of inputs of the network for each turn hypothesis."""

    net: Any

    def __init__(self, net: Any, margin: float = 0.0):
        super().__init__(margin)
        self.net = net

    @classmethod
    def network(cls, hidden: int) -> Any:
        """Return an untrained network with a number of hidden units, `StatementNet` or one with
        the same outputs.
        """
        return StatementNet(hidden, cls.inputs)

    def largest(
        self,
        utility: FloatArray,
        stay: FloatArray,
        stated: Actions,
        started: BoolArray,
    ) -> Actions:
        """Return the statements of N tracks, (N,).

        Args:
            utility: (N, M) of the modes; that of the stated one is changed.
            stay: (N,) utility of keeping the statement.
            stated: (N,) last statements.
            started: (N,) whether there has been a statement.
        """
        utility[np.arange(len(utility)), stated] += np.where(started, stay + self.threshold, 0.0)
        return utility.argmax(-1)


@dataclass
class StatementState:
    """What a `StatementDecider` remembers of N tracks.

    Attributes:
        memory: (1, N (M - 1), hidden) of the recurrent network.
        best: (N,) most probable mode of the last tick.
        age: (N,) ticks for which it has been the most probable one.
        filters: state of filters of the decider's own.
    """

    memory: Tensor
    best: IntArray
    age: IntArray
    filters: Any = None


class StatementDecider(UtilityDecider):
    """The network on rows of an environment with unknown switch moments.

    Args:
        net: trained network.
        world: options of the environment.
        margin: see `UtilityDecider`.

    Raises:
        ArgumentError: the margin is not a finite number.
    """

    task = UNKNOWN
    inputs = INPUTS

    def __init__(self, net: StatementNet, world: QuickestOptions, margin: float = 0.0):
        super().__init__(net, margin)
        self.world = world
        self.layout = QuickestLayout(world.hypotheses)

    @torch.no_grad()
    def decide(
        self,
        observation: Observations,
        state: StatementState | None,
        episode_start: Any,
    ) -> tuple[Actions, StatementState]:
        """See `Decider.decide`; action i states mode i, from rows of
        `hybrid_env.HybridTrackQuickestEnv`.
        """
        rows, seen = self.divide(observation)
        tracks = len(rows)
        turns = self.layout.hypotheses - 1
        if state is None:
            hidden = self.net.recurrent.hidden_size
            nothing = np.full(tracks, -1), np.zeros(tracks, np.int64)
            state = StatementState(torch.zeros(1, tracks * turns, hidden), *nothing)
        elif episode_start is not None and episode_start.any():
            going_on = torch.from_numpy(np.repeat(~episode_start, turns)).float()
            state = replace(
                state,
                memory=state.memory * going_on[None, :, None],
                best=np.where(episode_start, -1, state.best),
            )
        bank = self.layout.read(rows, "log_probability")
        best = bank.argmax(-1)
        age = np.where(best == state.best, state.age + 1, 1)
        log_probability, more, filters = self.filtered(bank, seen, state.filters, episode_start)
        inputs = torch.from_numpy(statement_inputs(self.world, rows, age, more)[None])
        outputs = self.net(inputs, torch.from_numpy(log_probability[None]).float(), state.memory)
        stated, started = read_statement(rows)
        utility, stay = (part[0].double().numpy() for part in (outputs.utility, outputs.stay))
        return self.largest(utility, stay, stated, started), StatementState(
            outputs.memory,
            best,
            age,
            filters,
        )

    def divide(self, observation: Observations) -> tuple[Float32Array, NDArray[Any] | None]:
        """Return the rows (N, width) of an observation, and what else it contains."""
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        return rows, None

    def filtered(
        self,
        bank: FloatArray,
        seen: NDArray[Any] | None,
        filters: Any,
        episode_start: Any,
    ) -> tuple[FloatArray, Float32Array | None, Any]:
        """Return log-probabilities (N, M) to correct, further inputs (N, M, k), and the state of
        own filters.

        Args:
            bank: (N, M) log-probabilities of the bank, which this class corrects.
            seen: from `divide`.
            filters: state after the last tick.
            episode_start: as in `decide`.
        """
        return bank, None, filters
