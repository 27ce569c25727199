"""The jump-Markov net: filters with a learned gain, and a recurrent network for the mode; and it
as a decider.

In the way of JMFNet (Stamatelis & Alexandropoulos 2025, "Filtering jump Markov systems with
partially known dynamics: a model-based deep learning approach", arXiv:2511.09569), which joins a
recurrent network for the mode and a KalmanNet that is told its probabilities. Here every hypothesis
has such a filter, all with the same weights, and the filters are mixed as in the IMM algorithm
(Blom & Bar-Shalom 1988). `StatementNet` corrects the posterior by their likelihoods. The motions
are known; gains, covariances and the rate of switches are learned. Without training it is an IMM
with a fixed gain.
"""

from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents import StatementNet, StatementOutputs, UtilityDecider, turn_views
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions
from studies.league.kalman import (
    KalmanNet,
    KalmanState,
    evidence,
    filter_sides,
    turning,
    two_by_two,
)
from studies.league.segments import each_tensor, where
from studies.shipped.expected_reward import StatementBatch
from studies.shipped.statements import Statements, StatementSettings

# Of the logarithm of a probability or a likelihood.
LOWEST_LOG = -15.0
SMALLEST = 1e-6


class JumpMarkovState(NamedTuple):
    """State of N tracks, with M + 1 filters each, two of them for straight motion."""

    # (N, M + 1); the differences are in the frame of the last tick.
    filters: KalmanState
    # (N, M) logarithms of the probabilities of the modes.
    logs: Tensor
    # (N, M - 1, hidden) of the recurrent network of the mode.
    memory: Tensor

    def detach(self) -> Any:
        """Return the state without its gradients."""
        return each_tensor(Tensor.detach, self)


Tick = tuple[StatementOutputs, JumpMarkovState]
"""Outputs of one tick, without the axis of ticks, and the state after it."""


class JumpMarkovNet(nn.Module):
    """Filters of all hypotheses and the network of the mode; `hidden` units in each of the two
    recurrent parts. The inputs of a track at a tick are those of `JumpMarkovDecider.observe`.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.filter = KalmanNet(hidden, context=4)
        # Of straight motion, a turn and the other turns six numbers each, and two of the track.
        self.modes = StatementNet(hidden, 3 * 6 + 2)
        # Log-odds of a switch at a tick.
        self.hazard = nn.Parameter(torch.tensor([-4.3]))
        with torch.no_grad():
            # Of position and velocity.
            gain = torch.cat([0.2 * torch.eye(2), 0.02 * torch.eye(2)])
            self.filter.gain[2].get_parameter("bias").copy_(gain.flatten())

    def forward(
        self, inputs: Tensor, log_probability: Tensor, memory: JumpMarkovState | None = None
    ) -> StatementOutputs:
        """Process T ticks of N tracks, (T, N, 6 + M - 1).

        The probabilities of the bank (T, N, M) are used at the first tick of an episode only,
        without a memory.
        """
        ticks = []
        for now, logs in zip(inputs, log_probability, strict=True):
            outputs, memory = self.begin(now, logs) if memory is None else self.step(now, memory)
            ticks.append(outputs)
        return each_tensor(lambda *parts: torch.stack(parts), *ticks)._replace(memory=memory)

    def begin(self, inputs: Tensor, logs: Tensor) -> Tick:
        """Start from the first estimate, to which the first measurement has contributed."""
        of_filters = inputs[:, None].expand(-1, logs.shape[1] + 1, -1)
        start = self.filter.start(of_filters[..., 2:6], of_filters[..., :2].nan_to_num())
        nothing = torch.zeros_like(logs)
        innovation = nothing[..., None].expand(-1, -1, 2)
        return self._tick(inputs, start, logs, nothing, innovation, None)

    def step(self, inputs: Tensor, last: JumpMarkovState) -> Tick:
        """Process one tick of N tracks, (N, 6 + M - 1)."""
        predicted, mixed, kept = self._mix(last)
        origin, velocity = (predicted.exp()[..., None] * mixed).sum(1).split(2, -1)
        speed = velocity.norm(dim=-1, keepdim=True).clamp(min=SMALLEST)
        # Frames of the filters: along the merged velocity, and across it to the side of the turn.
        side = torch.from_numpy(filter_sides(last.logs.shape[1])).float()
        signs = torch.stack([torch.ones_like(side), side], -1)
        frame = signs[..., None] * two_by_two(*(velocity / speed).split(1, -1))

        def local(vectors: Tensor) -> Tensor:
            return (frame @ vectors[..., None])[..., 0]

        def twice(of_modes: Tensor) -> Tensor:
            return torch.cat([of_modes[:, :1], of_modes], 1)

        is_known = ~inputs[:, :1].isnan()
        # Without a measurement the filters hardly change.
        measured = torch.where(is_known, inputs[:, :2], origin)
        position, moving = twice(mixed).split(2, -1)
        filters = last.filters._replace(
            state=torch.cat([local(position - origin[:, None]), local(moving)], -1),
            measurement=local(last.filters.measurement - origin[:, None]),
        )
        turn = nn.functional.pad(speed / inputs[:, 6:], (2, 0))
        logs = twice(predicted) / 5.0, twice(kept) / 5.0
        pace = 0.5 * speed.log().expand_as(turn)
        context = torch.stack([*logs, pace, 10.0 * turn], -1)
        motion = coordinated_turn(turn)
        z = local((measured - origin)[:, None])
        scale = torch.ones_like(z[..., :1])
        after, likelihoods = self.filter.step(filters, motion, z, scale, context)
        innovation = z - (motion @ filters.state[..., None])[..., :2, 0]
        # Columns: position, velocity.
        back = frame.mT @ after.state.unflatten(-1, (2, 2)).mT
        after = after._replace(
            state=back.mT.flatten(-2) + nn.functional.pad(origin, (0, 2))[:, None],
            measurement=measured[:, None].expand_as(z),
        )
        likelihood = is_known * evidence(likelihoods)
        innovation = of_modes(innovation * signs)
        return self._tick(inputs, after, predicted, likelihood, innovation, last.memory)

    def _mix(self, last: JumpMarkovState) -> tuple[Tensor, Tensor, Tensor]:
        """Return predicted log-probabilities (N, M), mixed states (N, M, 4), and the logarithms
        of their own shares.
        """
        M = last.logs.shape[1]
        hazard = nn.functional.logsigmoid(torch.cat([-self.hazard, self.hazard]))
        change = torch.where(torch.eye(M) > 0.0, hazard[0], hazard[1] - np.log(M - 1.0))
        joint = last.logs[:, :, None] + change
        predicted = joint.logsumexp(1)
        share = joint - predicted[:, None]
        mixed = share.exp().mT @ of_modes(last.filters.state)
        return predicted, mixed, share.diagonal(dim1=1, dim2=2)

    def _tick(
        self,
        inputs: Tensor,
        filters: KalmanState,
        predicted: Tensor,
        likelihood: Tensor,
        innovation: Tensor,
        memory: Tensor | None,
    ) -> Tick:
        """Return outputs and state of a tick, from what the filters say of it."""
        posterior = torch.log_softmax(predicted + likelihood, -1).clamp(min=LOWEST_LOG)
        ratio = (likelihood - likelihood.max(-1, keepdim=True).values).clamp(min=LOWEST_LOG)
        parts = [2.0 * posterior.exp() - 1.0, posterior / 5.0, predicted / 5.0, ratio / 3.0]
        each = torch.cat([torch.stack(parts, -1), 0.5 * innovation.clamp(-6.0, 6.0)], -1)
        # The lateral innovation, in column 5, changes its sign in a mirrored trajectory.
        views = turn_views(
            each.detach().numpy(),
            posterior.detach().numpy(),
            filter_sides(posterior.shape[-1])[2:],
            (5,),
            2,
        )
        velocity = filters.state[..., 2:].mean(1).detach()
        speed = velocity.norm(dim=-1, keepdim=True).clamp(min=SMALLEST)
        views[..., -2] = 0.5 * speed.log().numpy()
        views[..., -1] = 0.5 * (speed / inputs[:, 6:]).log().numpy() + 1.5
        outputs = self.modes(
            torch.from_numpy(views)[None],
            posterior[None],
            None if memory is None else memory.flatten(0, 1)[None],
        )
        memory = outputs.memory[0].view(*views.shape[:2], -1)
        utility, stay, belief = (part[0] for part in outputs[:3])
        logs = torch.log_softmax(belief, -1).clamp(min=LOWEST_LOG)
        state = JumpMarkovState(filters, logs, memory)
        return StatementOutputs(utility, stay, belief, None, likelihood), state


def of_modes(filters: Tensor) -> Tensor:
    """Return values of the hypotheses (N, M, k) from those of the filters (N, M + 1, k)."""
    return evidence(filters.mT).mT


def coordinated_turn(turn: Tensor) -> Tensor:
    """Return the matrices (..., 4, 4) of position and velocity [1/tick] that turn left by an angle
    (...) per tick.
    """
    rotation = two_by_two(turn.cos(), -turn.sin())
    # In a frame that turns with the object.
    deviation = turning(turn)[..., :2, 2:]
    above = torch.cat([torch.eye(2).expand_as(rotation), rotation @ deviation], -1)
    return torch.cat([above, nn.functional.pad(rotation, (2, 0))], -2)


class JumpMarkovDecider(UtilityDecider):
    """States the mode with the largest utility, from the measurements; the bank gives the first
    estimate only. The state is that of the network, and the last statements (N,).
    """

    task = "unknown"
    observes = "tracks"
    every_tick = True

    def __init__(self, net: JumpMarkovNet, world: QuickestOptions):
        super().__init__(net)
        self.world = world

    @classmethod
    def network(cls, hidden: int) -> JumpMarkovNet:
        return JumpMarkovNet(hidden)

    def observe(self, tracks: Any) -> NDArray[np.float32]:
        """Return the inputs of a tick, (N, 6 + M - 1), and the logarithms of the probabilities of
        the modes in the bank, (N, M).

        The inputs are what is measured (NaN where it is missing), position and velocity of the
        first estimate, and the radii of the turns, in deviations of the noise and ticks.
        """
        x, vx, y, vy = tracks.field("estimate").T
        radii = np.tile(self.world.radii, (len(x), 2))
        tau = self.world.tau
        variances = self.world.variances
        # The geometric mean of those of the axes.
        noise = np.sqrt(np.prod(variances) ** (1.0 / variances.size))
        columns = [tracks.field("measurement"), x, y, vx * tau, vy * tau, radii]
        inputs = np.column_stack(columns) / noise
        return np.hstack([inputs, tracks.hypothesis_values()]).astype(np.float32)

    def evidence(
        self, observation: NDArray[np.float32], state: Any = None, episode_start: Any = None
    ) -> NDArray[np.float64]:
        """Return the probabilities of the modes by the bank, (N, M)."""
        return np.exp(observation[:, -self.world.hypotheses :].astype(np.float64))

    @torch.no_grad()
    def decide(
        self,
        observation: NDArray[np.float32],
        state: tuple[JumpMarkovState, Tensor] | None,
        episode_start: NDArray[np.bool_] | None,
    ) -> tuple[NDArray[np.int64], tuple[JumpMarkovState, Tensor]]:
        """See `Decider.decide`; action i states mode i."""
        seen = self.divide(observation)
        starts = np.zeros(len(observation), np.bool_) if episode_start is None else episode_start
        stated = np.zeros(len(observation), np.int64)
        if state is None:
            starts = np.ones_like(starts)
            outputs, net = self.net.begin(*seen)
        else:
            outputs, net = self.net.step(seen[0], state[0])
            if starts.any():
                begun = self.net.begin(*seen)
                outputs, net = where(torch.from_numpy(starts), begun, (outputs, net))
            stated = state[1].numpy()
        utility, stay = (part.double().numpy() for part in outputs[:2])
        stated = self.largest(utility, stay, stated, ~starts)
        return stated, (net, torch.from_numpy(stated))

    def divide(self, observation: NDArray[np.float32]) -> tuple[Tensor, ...]:
        """Return inputs and log-probabilities, the parts of what `observe` returns (..., width)."""
        return torch.from_numpy(observation).tensor_split((-self.world.hypotheses,), -1)


class JumpMarkov(Statements):
    """A training run of the jump-Markov net on the tracks of `Statements`, without their true
    states.
    """

    Settings = StatementSettings
    decider = JumpMarkovDecider

    def simulate(self, world: QuickestOptions, tracks: int, seed: int) -> tuple[NDArray[Any], ...]:
        """See `Statements.simulate`."""
        env = HybridTrackQuickestVectorEnv(tracks, "Disabled", **vars(world))
        env.reset(seed=seed)
        decider = JumpMarkovDecider(self.net, world)
        seen, modes = [], []
        for _ in range(world.ticks):
            seen.append(decider.observe(env.world))
            modes.append(env.world.field("true_mode").astype(np.int64))
            env.step(np.zeros(tracks, np.int64))
        inputs, logs = (part.numpy() for part in decider.divide(np.array(seen)))
        return inputs, logs, np.array(modes)

    def further_loss(self, outputs: StatementOutputs, batch: StatementBatch) -> Tensor:
        """Return the mean negative log-likelihood of a measurement by the filter of the true
        mode.
        """
        assert outputs.logs is not None
        return -outputs.logs.gather(-1, batch.true_modes[..., None]).mean()
