"""The networks that predict which declaration is rewarded, their inputs without units, and their
deciders.

As `statement_net` it sees a row once for each turn hypothesis, from the side of this turn. Its
memory is a sum over the rows of the segment, as in Deep Sets (Zaheer et al. 2017): the tick is
among the inputs, so that the order of the rows is not lost, and a whole segment is processed at
once in training.
"""

from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.posterior_decider import PosteriorDecider
from agents.learned.statement_net import GAIN, LARGEST_INNOVATION, LOWEST_LOG, sides, turn_views
from baselines.rules.decider import Observations
from baselines.rules.msprt import posterior_of
from hybrid_env.checks import BoolArray, FloatArray, IntArray, reject
from hybrid_env.observation import Layout

HYPOTHESIS_INPUTS = 8
TRACK_INPUTS = 9
# Inputs of a hypothesis that change their sign in a mirrored trajectory.
ODD = 4, 7
ODD_OF_TRACK = 2, 4
INPUTS = 3 * HYPOTHESIS_INPUTS + TRACK_INPUTS
# Inputs are clipped to +-5.
LIMIT = 5.0
# Of the features of a row in the memory.
SHARE = 0.2
SMALLEST = 1e-30
INNOVATIONS = "innovation_along", "innovation_across"


def reward_inputs(
    rows: NDArray[np.float32],
    tau: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the inputs of each turn hypothesis (N, M - 1, 33), and the logarithm of the bank's
    posterior (N, M).

    The rows are (N, width), and a tick has the length tau [s].
    """
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name).astype(np.float32) for name in layout.slices}
    ratio = read["log_ratio"]
    speed = np.maximum(read["speed"], SMALLEST)
    ticks = read["ticks"]
    posterior = np.exp(ratio)
    posterior /= posterior.sum(-1, keepdims=True)
    logs = np.log(np.maximum(posterior, np.exp(np.float32(-30.0))))
    innovations = [
        0.5 * read[name].clip(-LARGEST_INNOVATION, LARGEST_INNOVATION) for name in INNOVATIONS
    ]
    turn = 10.0 * read["curvature"] * (speed * np.float32(tau))[:, None]
    each: list[Any] = [
        2.0 * posterior - 1.0,
        np.maximum(logs, LOWEST_LOG) / 5.0,
        np.maximum(ratio, -6.0) / 2.0,
        *innovations,
        read["log_variance"],
        read["previous"],
        turn,
    ]
    out = turn_views(np.stack(each, -1), logs, ODD, TRACK_INPUTS)
    across = 0.1 * read["displacement_across"]
    of_track = [
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        3.0 * np.tanh(across / 3.0),
        0.05 * read["displacement_along"],
        np.clip(across / (ticks / 5.0 + 0.1), -3.0, 3.0),
        0.5 * _log(read["anchor_xx"]),
        0.5 * _log(read["anchor_vv"] * np.float32(tau * tau)) + 2.0,
        read["anchor_xv"] * np.float32(tau),
        0.5 * (_log(speed * np.float32(tau)) - 0.5 * read["log_noise"]),
    ]
    out[..., -TRACK_INPUTS:] = np.stack(of_track, -1)[:, None]
    for column in ODD_OF_TRACK:
        out[..., column - TRACK_INPUTS] *= sides(layout.hypotheses)[1:]
    return np.clip(out, -LIMIT, LIMIT), logs


def _log(values: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.log(np.maximum(values, np.float32(SMALLEST)))


def zero_layer(inputs: int, outputs: int) -> nn.Linear:
    """Return a linear layer whose outputs are zero until it is trained."""
    layer = nn.Linear(inputs, outputs)
    for parameter in layer.parameters():
        nn.init.zeros_(parameter)
    return layer


def hidden_layers(inputs: int, hidden: int) -> nn.Sequential:
    """Return two layers of hidden units."""
    return nn.Sequential(nn.Linear(inputs, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU())


def with_straight(outputs: Tensor) -> Tensor:
    """Return a number of each hypothesis (..., M) from two of each turn (..., M - 1, 2).

    A turn has its first one, straight motion the mean of the second ones.
    """
    return torch.cat([outputs[..., 1].mean(-1, keepdim=True), outputs[..., 0]], -1)


class RewardNet(nn.Module):
    """Corrects the posterior of the bank, from the present row and a memory of the segment;
    `hidden` units a layer.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.row = nn.Sequential(
            nn.Linear(INPUTS, hidden),
            nn.SiLU(),
            nn.Linear(hidden, hidden),
            nn.Tanh(),
        )
        self.layers = hidden_layers(INPUTS + hidden, hidden)
        self.output = zero_layer(hidden, 2)
        self.scale = nn.Parameter(torch.ones(1))

    def features(self, inputs: Tensor) -> Tensor:
        """Return features (N, M - 1, hidden) of rows; the memory is their sum from the first row
        of the segment.
        """
        return SHARE * self.row(inputs)

    def forward(self, inputs: Tensor, memory: Tensor, logs: Tensor) -> Tensor:
        """Return the log-probability that the reward of declaring a hypothesis is positive, (N, M).

        Inputs and logarithms are of `reward_inputs`, the memory (N, M - 1, hidden) is the sum of
        `features` so far.
        """
        outputs = GAIN * self.output(self.layers(torch.cat([inputs, memory], -1)))
        return torch.log_softmax(self.scale * logs + with_straight(outputs), -1)


class RewardDecider(PosteriorDecider):
    """Declares the likeliest hypothesis once the probability of a negative reward is at most alpha.

    The state is the memory of the network (N, M - 1, hidden), which begins anew at every switch.
    """

    default = 0.03
    network: ClassVar[Any] = RewardNet
    label = "learned from rewards"

    @torch.no_grad()
    def posterior(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[FloatArray, Any]:
        rows = np.asarray(observation, np.float32)
        if rows.ndim != 2 or rows.shape[1] != self.layout.width:
            raise reject("observation shape", rows.shape, f"(N, {self.layout.width})")
        ticks = self.layout.read(rows, "ticks").round().astype(np.int64)
        found, state = self.advance(rows, torch.from_numpy(ticks).clamp(min=1), state)
        return found.numpy(), state

    def advance(self, rows: Observations, ticks: Tensor, state: Any) -> tuple[Tensor, Any]:
        """Return the posterior (N, M) in float64 and the state, after rows (N, width) at ticks
        (N,) from 1.
        """
        inputs, logs = map(torch.from_numpy, reward_inputs(rows, self.world.tau))
        memory = self.net.features(inputs)
        if state is not None:
            memory = memory + torch.where((ticks > 1)[:, None, None], state, 0.0)
        return self.net(inputs, memory, logs).double().exp(), memory

    def errors(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: Any,
    ) -> tuple[FloatArray, IntArray]:
        values = posterior_of(posterior, self.by_type)
        largest = values.max(-1, keepdims=True)
        return 1.0 - largest[:, 0], np.where(values == largest, posterior, -1.0).argmax(-1)

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """See `Decider.select_tracks`; the state is one tensor (N, ...) or a named tuple of
        them.
        """
        if state is None:
            return None
        kept = torch.from_numpy(tracks)
        return (
            state[kept]
            if isinstance(state, Tensor)
            else type(state)(*(part[kept] for part in state))
        )


class DistilledNet(nn.Module):
    """As `RewardNet`, from the present row alone; it imitates the shipped agent."""

    def __init__(self, hidden: int):
        super().__init__()
        self.layers = hidden_layers(INPUTS, hidden)
        self.output = zero_layer(hidden, 2)
        self.scale = nn.Parameter(torch.ones(1))

    def forward(self, inputs: Tensor, logs: Tensor) -> Tensor:
        """Return the logarithms of the posterior (N, M) of rows, see `reward_inputs`."""
        return torch.log_softmax(
            self.scale * logs + with_straight(GAIN * self.output(self.layers(inputs))),
            -1,
        )


class DistilledDecider(RewardDecider):
    """Declares the likeliest hypothesis once the error probability is at most alpha. It has no
    state.
    """

    network = DistilledNet
    label = "distilled agent"

    def advance(self, rows: Observations, ticks: Tensor, state: Any) -> tuple[Tensor, None]:
        return self.net(
            *map(torch.from_numpy, reward_inputs(rows, self.world.tau))
        ).double().exp(), None
