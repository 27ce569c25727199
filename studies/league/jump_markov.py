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

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.algorithms.statements import StatementSettings, TrackAlgorithm, make_tracks
from agents.learned.statement_decider import UtilityDecider
from agents.learned.statement_net import StatementNet, StatementOutputs, noise_of, sides, turn_views
from agents.training.expected_reward import StatementBatch
from baselines.rules.decider import Actions, SeveralThresholds
from baselines.rules.measurements import OBSERVED, MeasurementDecider
from hybrid_env.checks import BoolArray, FloatArray, check_number, reject
from hybrid_env.quickest_options import QuickestOptions
from studies.league.kalman import SENSOR, KalmanNet, KalmanState, evidence, turning

MEASUREMENT, POSITION, VELOCITY, RADII = slice(0, 2), slice(2, 4), slice(4, 6), slice(6, None)
"""Inputs of a track at a tick: what is measured, the first estimate, and the radii of the turns."""

HYPOTHESIS_INPUTS = 6
# Of the inputs of a hypothesis, the lateral innovation.
ACROSS = 5
INPUTS = 3 * HYPOTHESIS_INPUTS + 2
CONTEXT = 4
# Without training, the second one per tick.
POSITION_GAIN, VELOCITY_GAIN = 0.2, 0.02
# Log-odds of a switch at a tick, without training.
HAZARD = -4.3
LOWEST_LOG = -15.0
SMALLEST = 1e-6


def track_inputs(world: QuickestOptions, observed: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the inputs of N tracks at a tick (N, 6 + M - 1), in deviations of the noise and ticks.

    `observed` (N, width) is what `MeasurementDecider.observe` returns; a missing measurement is
    NaN.
    """
    x, vx, y, vy = observed[:, 2:6].T
    radii = np.broadcast_to(np.tile(world.radii, 2), (len(observed), world.hypotheses - 1))
    tau = world.tau
    metres = np.column_stack([observed[:, :2], x, y, vx * tau, vy * tau, radii])
    return np.asarray(metres / noise_of(world), np.float32)


class JumpMarkovState(NamedTuple):
    """State of N tracks, with M + 1 filters each, two of them for straight motion."""

    # The differences are in the frame of the last tick.
    filters: KalmanState
    # (N, M) logarithms of the probabilities of the modes.
    logs: Tensor
    # (1, N (M - 1), hidden) of the recurrent network of the mode.
    memory: Tensor

    def detach(self) -> "JumpMarkovState":
        """Return the state without its gradients."""
        return JumpMarkovState(
            KalmanState(*(part.detach() for part in self.filters)),
            self.logs.detach(),
            self.memory.detach(),
        )

    def replaced(self, tracks: Tensor, other: "JumpMarkovState") -> "JumpMarkovState":
        """Return it with the state of another one for the tracks of a mask (N,)."""
        each = tracks.repeat_interleave(self.logs.shape[1] + 1)[:, None]
        turns = tracks.repeat_interleave(self.logs.shape[1] - 1)[:, None]
        filters = (
            torch.where(
                each,
                new,
                old,
            )
            for new, old in zip(
                other.filters,
                self.filters,
                strict=True,
            )
        )
        logs = torch.where(
            tracks[:, None],
            other.logs,
            self.logs,
        )
        return JumpMarkovState(
            KalmanState(*filters),
            logs,
            torch.where(
                turns,
                other.memory,
                self.memory,
            ),
        )


class JumpMarkovNet(nn.Module):
    """Filters of all hypotheses and the network of the mode; `hidden` units in each of the two
    recurrent parts.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.filter = KalmanNet(
            4,
            2,
            hidden,
            CONTEXT,
        )
        self.modes = StatementNet(hidden, INPUTS)
        self.hazard = nn.Parameter(torch.tensor([HAZARD]))
        with torch.no_grad():
            gain = torch.cat([POSITION_GAIN * torch.eye(2), VELOCITY_GAIN * torch.eye(2)])
            self.filter.gain[2].get_parameter("bias").copy_(gain.flatten())

    def forward(
        self,
        inputs: Tensor,
        log_probability: Tensor,
        memory: JumpMarkovState | None = None,
    ) -> StatementOutputs:
        """Process T ticks of N tracks: inputs (T, N, 6 + M - 1) of `track_inputs`.

        The probabilities of the bank (T, N, M) are used at the first tick of an episode only,
        without a memory.
        """
        found = []
        for now, logs in zip(
            inputs,
            log_probability,
            strict=True,
        ):
            outputs, memory = self.begin(now, logs) if memory is None else self.step(now, memory)
            found.append(outputs)
        utility, stay, belief, logs = (
            torch.cat([getattr(one, name) for one in found])
            for name in ("utility", "stay", "belief", "logs")
        )
        return StatementOutputs(
            utility,
            stay,
            belief,
            memory,
            logs,
        )

    def begin(self, inputs: Tensor, logs: Tensor) -> tuple[StatementOutputs, JumpMarkovState]:
        """Start from the first estimate, to which the first measurement has contributed."""
        filters = logs.shape[1] + 1
        state = inputs[:, POSITION.start : VELOCITY.stop]
        measured = inputs[:, MEASUREMENT].nan_to_num()
        each = (part.repeat_interleave(filters, 0) for part in (state, measured))
        nothing = logs.new_zeros(*logs.shape, 2)
        return self._state(
            inputs,
            self.filter.start(*each),
            logs,
            torch.zeros_like(logs),
            nothing,
            None,
        )

    def step(
        self,
        inputs: Tensor,
        last: JumpMarkovState,
    ) -> tuple[StatementOutputs, JumpMarkovState]:
        """Process one tick of N tracks, (N, 6 + M - 1)."""
        M = last.logs.shape[1]
        predicted, mixed, kept = self._mix(last)
        probability = predicted.exp()[..., None]
        origin, velocity = (probability * mixed).sum(1).split(2, -1)
        speed = velocity.norm(dim=-1, keepdim=True).clamp(min=SMALLEST)
        # Frames of the filters: along the merged velocity, and across it to the side of the turn.
        side = torch.from_numpy(np.append(sides(M)[1:], [1.0, -1.0])).roll(2).float()
        cosine, sine = (velocity / speed).split(1, -1)
        along = torch.stack([cosine, sine], -1).expand(
            -1,
            M + 1,
            -1,
        )
        across = side[:, None] * torch.stack([-sine, cosine], -1)
        frame = torch.stack([along, across], -2).flatten(0, 1)

        def local(vectors: Tensor) -> Tensor:
            return (
                frame
                @ vectors.expand(
                    -1,
                    M + 1,
                    2,
                ).reshape(
                    -1,
                    2,
                    1,
                )
            )[..., 0]

        def twice(of_modes: Tensor) -> Tensor:
            return torch.cat([of_modes[:, :1], of_modes], 1)

        is_known = ~inputs[:, :1].isnan()
        # The filters then hardly change.
        measured = torch.where(
            is_known,
            inputs[:, MEASUREMENT],
            origin,
        )
        before = last.filters
        start = twice(mixed) - nn.functional.pad(origin, (0, 2))[:, None]
        turn = nn.functional.pad(speed / inputs[:, RADII], (2, 0))
        filters = before._replace(
            state=torch.cat([local(start[..., :2]), local(start[..., 2:])], -1),
            measurement=local(
                before.measurement.view(
                    -1,
                    M + 1,
                    2,
                )
                - origin[:, None]
            ),
        )
        logs = twice(predicted) / 5.0, twice(kept) / 5.0
        context = torch.stack([*logs, 0.5 * speed.log().expand_as(turn), 10.0 * turn], -1)
        motion = coordinated_turn(turn.flatten())
        z = local((measured - origin)[:, None])
        after, found = self.filter.step(
            filters,
            motion,
            SENSOR,
            z,
            torch.ones_like(z[:, :1]),
            context.flatten(0, 1),
        )
        innovation = (z - (motion @ filters.state[..., None])[:, :2, 0]).view(
            -1,
            M + 1,
            2,
        )
        innovation = innovation * torch.stack([torch.ones(M + 1), side], -1)
        innovation = torch.cat([innovation[:, :2].mean(1, keepdim=True), innovation[:, 2:]], 1)
        # Columns: position, velocity.
        back = frame.mT @ after.state.unflatten(-1, (2, 2)).mT
        state = back.mT.flatten(1) + nn.functional.pad(origin, (0, 2)).repeat_interleave(M + 1, 0)
        after = after._replace(state=state, measurement=measured.repeat_interleave(M + 1, 0))
        likelihood = is_known * evidence(found.view(-1, M + 1))
        return self._state(
            inputs,
            after,
            predicted,
            likelihood,
            innovation,
            last.memory,
        )

    def _mix(self, last: JumpMarkovState) -> tuple[Tensor, Tensor, Tensor]:
        """Return predicted log-probabilities (N, M), mixed states (N, M, 4), and the logarithms
        of their own shares.
        """
        M = last.logs.shape[1]
        hazard = nn.functional.logsigmoid(torch.cat([-self.hazard, self.hazard]))
        change = torch.where(
            torch.eye(M) > 0.0,
            hazard[0],
            hazard[1] - np.log(M - 1.0),
        )
        joint = last.logs[:, :, None] + change
        predicted = joint.logsumexp(1)
        share = joint - predicted[:, None]
        states = last.filters.state.view(
            -1,
            M + 1,
            4,
        )
        states = torch.cat([states[:, :2].mean(1, keepdim=True), states[:, 2:]], 1)
        return predicted, share.exp().mT @ states, share.diagonal(dim1=1, dim2=2)

    def _state(
        self,
        inputs: Tensor,
        filters: KalmanState,
        predicted: Tensor,
        likelihood: Tensor,
        innovation: Tensor,
        memory: Tensor | None,
    ) -> tuple[StatementOutputs, JumpMarkovState]:
        """Return outputs and state of a tick, from what the filters say of it."""
        posterior = torch.log_softmax(predicted + likelihood, -1).clamp(min=LOWEST_LOG)
        ratio = (likelihood - likelihood.max(-1, keepdim=True).values).clamp(min=LOWEST_LOG)
        parts = [2.0 * posterior.exp() - 1.0, posterior / 5.0, predicted / 5.0, ratio / 3.0]
        each = torch.cat([torch.stack(parts, -1), 0.5 * innovation.clamp(-6.0, 6.0)], -1)
        seen = turn_views(
            each.detach().numpy(),
            posterior.detach().numpy(),
            (ACROSS,),
            2,
        )
        M = posterior.shape[1]
        speed = (
            filters.state[:, 2:]
            .view(-1, M + 1, 2)
            .mean(1)
            .norm(dim=-1, keepdim=True)
            .clamp(min=SMALLEST)
            .detach()
        )
        seen[..., -2] = 0.5 * speed.log().numpy()
        seen[..., -1] = 0.5 * (speed / inputs[:, RADII]).log().numpy() + 1.5
        outputs = self.modes(
            torch.from_numpy(seen)[None],
            posterior[None],
            memory,
        )
        logs = torch.log_softmax(outputs.belief[0], -1).clamp(min=LOWEST_LOG)
        return outputs._replace(logs=likelihood[None]), JumpMarkovState(
            filters,
            logs,
            outputs.memory,
        )


def coordinated_turn(turn: Tensor) -> Tensor:
    """Return the matrices (n, 4, 4) of position and velocity [1/tick] that turn left by an angle
    (n,) per tick.
    """
    cosine = turn.cos()
    sine = turn.sin()
    rotation = torch.stack([cosine, -sine, sine, cosine], -1).unflatten(-1, (2, 2))
    # In a frame that turns with the object.
    deviation = turning(turn)
    above = torch.cat([torch.eye(2).expand_as(rotation), rotation @ deviation[:, :2, 2:]], -1)
    return torch.cat([above, nn.functional.pad(rotation, (2, 0))], -2)


class JumpMarkovMemory(NamedTuple):
    """State of N tracks."""

    net: JumpMarkovState
    # Last statements (N,) at each of K margins.
    stated: list[Actions]


class JumpMarkovDecider(UtilityDecider, MeasurementDecider[JumpMarkovMemory], SeveralThresholds):
    """States the mode with the largest utility, from the measurements; the bank gives the first
    estimate only.

    What the network computes does not depend on statements: it is computed once for K margins, see
    `UtilityDecider`.
    """

    def __init__(self, net: JumpMarkovNet, world: QuickestOptions, *margins: float):
        super().__init__(net)
        self.world, self.hypotheses = world, world.hypotheses
        self.margins = [check_number("margin", margin) for margin in margins or (0.0,)]
        self.chosen = []

    @classmethod
    def network(cls, hidden: int) -> JumpMarkovNet:
        return JumpMarkovNet(hidden)

    @classmethod
    def together(cls, deciders: Sequence[Self]) -> Self:
        first = deciders[0]
        return cls(
            first.net,
            first.world,
            *(margin for one in deciders for margin in one.margins),
        )

    @torch.no_grad()
    def decide(
        self,
        observation: FloatArray,
        state: JumpMarkovMemory | None,
        episode_start: BoolArray | None,
    ) -> tuple[Actions, JumpMarkovMemory]:
        """See `MeasurementDecider.decide`; the statements at all margins are `chosen`."""
        tracks = len(observation)
        M = self.hypotheses
        if observation.ndim != 2 or observation.shape[1] < OBSERVED + M:
            raise reject(
                "observation shape",
                observation.shape,
                f"(N, {OBSERVED + M})",
            )
        starts = (
            np.full(tracks, state is None)
            if state is None or episode_start is None
            else episode_start
        )
        inputs = torch.from_numpy(track_inputs(self.world, observation))
        logs = torch.from_numpy(observation[:, OBSERVED : OBSERVED + M]).float()
        if state is None or starts.any():
            outputs, net = self.net.begin(inputs, logs)
        if state is not None:
            now, after = self.net.step(inputs, state.net)
            if starts.any():
                anew = torch.from_numpy(starts)
                after = after.replaced(anew, net)
                now = now._replace(
                    utility=torch.where(
                        anew[:, None],
                        outputs.utility,
                        now.utility,
                    )
                )
            outputs = now
            net = after
        utility, stay = outputs.utility[0].double().numpy(), outputs.stay[0].double().numpy()
        last = [np.zeros(tracks, np.int64)] * len(self.margins) if state is None else state.stated
        pairs = zip(
            self.margins,
            last,
            strict=True,
        )
        self.chosen = [
            self.largest(
                utility.copy(),
                stay + margin,
                stated,
                ~starts,
            )
            for margin, stated in pairs
        ]
        return self.chosen[0], JumpMarkovMemory(net, self.chosen)


class JumpMarkov(TrackAlgorithm):
    """A training run of the jump-Markov net on the tracks of `TrackAlgorithm`, without their true
    states.
    """

    Settings = StatementSettings
    decider = JumpMarkovDecider

    def simulate(
        self,
        world: QuickestOptions,
        tracks: int,
        seed: int,
        inexact: bool,
    ) -> tuple[NDArray[Any], ...]:
        """See `TrackAlgorithm.simulate`; the inputs are (T, N, 6 + M - 1), see `track_inputs`."""
        env = make_tracks(
            world,
            tracks,
            inexact,
        )
        env.reset(seed=seed)
        decider = JumpMarkovDecider(self.net, world)
        seen = []
        modes = []
        for _ in range(world.ticks):
            seen.append(decider.observe(env.world))
            modes.append(env.world.field("true_mode").astype(np.int64))
            env.step(np.zeros(tracks, np.int64))
        logs = np.array(seen, np.float32)[..., OBSERVED : OBSERVED + world.hypotheses]
        return np.array([track_inputs(world, one) for one in seen]), logs, np.array(modes)

    def further_loss(self, outputs: StatementOutputs, batch: StatementBatch) -> Tensor | float:
        """Return the mean negative log-likelihood of a measurement by the filter of the true
        mode.
        """
        assert outputs.logs is not None
        return -outputs.logs.gather(-1, batch.true_modes[..., None]).mean()
