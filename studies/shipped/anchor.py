"""The anchor agent without a learned stop: likelihood of the anchor errors, and squared error of
the next losses.

The agent itself decides during training, once an error is less probable than a threshold that is
drawn for each segment, and a fraction of the declarations is replaced by random hypotheses. The
anchors therefore include those after early, late and wrong decisions. After every round the
networks are trained on random samples of the last anchors and declarations. `stopping` adds the
stop.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.distributions import Categorical, MixtureSameFamily, MultivariateNormal

from agents import RowRatios, regret_inputs
from hybrid_env import HybridTrackVectorEnv
from studies.arrays import Float32Array, FloatArray, IntArray
from studies.shipped.explorer import Count, Explorer, WorldsAlgorithm, WorldsSettings

# Places of the true state in a row of the trace.
TRUTH = slice(4)


@dataclass(frozen=True, kw_only=True)
class AnchorSettings(WorldsSettings):
    """Hyper-parameters of the anchor agent."""

    # Steps of the optimizer per round.
    batches: Count
    # Samples of a step.
    batch_size: Count = 1024
    # Last anchors, and last declarations, that samples are drawn from.
    buffer_size: Count = 50_000


class Anchor(WorldsAlgorithm):
    """A training run of the anchor agent."""

    Settings = AnchorSettings
    settings: AnchorSettings

    def build(self) -> None:
        """Create networks, optimizer and buffers."""
        super().build()
        # Inputs of the anchor network and whitened errors; declarations and the losses after them.
        widths = self.network.anchor.inputs + 4, self.network.regret.inputs + 1
        self._samples = [np.zeros((0, width), np.float32) for width in widths]

    def draw_margins(self, generator: np.random.Generator, tracks: int) -> FloatArray:
        """See `WorldsAlgorithm.draw_margins`: error probabilities from 0.0001 to 0.3."""
        return generator.uniform(-3.0, 5.3, tracks)

    def values(self) -> dict[str, Any]:
        """See `Algorithm.values`; with the samples."""
        return super().values() | {"samples": [torch.from_numpy(rows) for rows in self._samples]}

    def restore_values(self, values: dict[str, Any]) -> None:
        """See `Algorithm.restore_values`."""
        super().restore_values(values)
        pairs = zip(values["samples"], self._samples, strict=True)
        self._samples = [saved.float().numpy().reshape(-1, rows.shape[1]) for saved, rows in pairs]

    def train_round(self) -> tuple[int, float, float, dict[str, float]]:
        """See `NetworkAlgorithm.train_round`."""
        generator = np.random.default_rng(self.first_seed)
        decisions: list[FloatArray] = []
        steps = 0
        for explorer in self.explorers(generator):
            parts = zip(self._samples, samples_of(explorer, decisions), strict=True)
            self._samples = [
                np.concatenate([rows, *new])[-self.settings.buffer_size :] for rows, new in parts
            ]
            steps += len(explorer.seen) * explorer.env.num_envs
        self.set_learning_rate()
        losses = [self._update(generator) for _ in range(self.settings.batches)]
        names = ("anchor_loss", "regret_loss")
        reward, ticks = np.concatenate(decisions, axis=1).mean(1).tolist()
        return steps, reward, ticks, dict(zip(names, np.mean(losses, axis=0).tolist(), strict=True))

    def _update(self, generator: np.random.Generator) -> list[float]:
        """Make a step of the optimizer on random samples; return the losses of anchors and
        declarations, 0 without samples.
        """
        losses = [torch.zeros((), requires_grad=True)] * 2
        networks = self.network.anchor, self.network.regret
        parts = zip(self._samples, networks, (anchor_loss, regret_loss), (4, 1), strict=True)
        for k, (rows, network, loss, targets) in enumerate(parts):
            if len(rows):
                drawn = rows[generator.integers(len(rows), size=self.settings.batch_size)]
                inputs, values = torch.from_numpy(drawn).tensor_split((-targets,), -1)
                losses[k] = loss(network, inputs, values.squeeze(-1))
        self.improve(losses[0] + losses[1], 1.0, *networks)
        return [float(loss.detach()) for loss in losses]


def anchor_loss(network: Any, inputs: Tensor, errors: Tensor) -> Tensor:
    """Return the mean negative log-density of whitened errors (n, 4) of anchors."""
    log_weight, mean, factor = network(inputs)
    # A training that diverges is found when it is saved.
    mixture = MixtureSameFamily(
        Categorical(logits=log_weight, validate_args=False),
        MultivariateNormal(mean, scale_tril=factor, validate_args=False),
        validate_args=False,
    )
    return -mixture.log_prob(errors).mean()


def regret_loss(network: Any, inputs: Tensor, losses: Tensor) -> Tensor:
    """Return the mean squared error of the predicted losses (n,), from inputs (n, 14)."""
    predicted = network.base(inputs[:, : network.context]).squeeze(-1) + network(inputs)
    return (predicted - losses).square().mean()


def samples_of(
    explorer: Explorer, decisions: list[FloatArray]
) -> tuple[list[Float32Array], list[Float32Array]]:
    """Run the episodes of an agent in training.

    Returns:
        (n, 22 + C + 4) inputs of the anchor network and whitened errors, and (n, 15) declarations
        and the loss of the segment after each. Rewards and times of all decisions are added to
        `decisions`, (2, n).
    """
    env, world = explorer.env, explorer.world
    tracks = env.num_envs
    anchors: list[Float32Array] = []
    regrets: list[Float32Array] = []
    # Errors of the anchor in the heading frame, where a segment begins.
    errors = np.zeros((tracks, 4))
    # Inputs for the last declaration of each track, if there is one.
    declared = np.zeros((tracks, explorer.agent.net.regret.inputs), np.float32)
    has_declared = np.zeros(tracks, np.bool_)
    for now, seen, going in explorer.ticks():
        if seen.anchors is not None:
            inputs, factor, begun = seen.anchors
            white = np.linalg.solve(factor, errors[begun][..., None])[..., 0]
            anchors.append(np.hstack([inputs, white])[going[begun]].astype(np.float32))
        if "correct" not in now.info:
            continue
        decided = np.flatnonzero(now.info["_correct"] & going)
        correct, ticks, mode, true_mode = (
            now.info[name][decided]
            for name in ("correct", "ticks", "decided_mode", "decided_true_mode")
        )
        reward = world.segment_reward(correct, ticks)
        decisions.append(np.stack([reward, ticks]))
        # Losses after unusual thresholds are not learned.
        known = has_declared[decided] & (np.abs(seen.margin[decided]) < 1.8)
        pairs = np.column_stack([declared[decided], 1.0 - reward])
        regrets.append(pairs[known].astype(np.float32))
        ratios = RowRatios(world, seen.rows[decided])
        turns = (ratios.of_mode(ratios.turn, modes)[:, None] for modes in (mode, true_mode))
        declared[decided] = regret_inputs(ratios, *turns)[:, 0]
        has_declared[decided] = True
        switched = decided[~now.terminated[decided]]
        errors[switched] = anchor_errors(env, switched, seen.truth[switched])
    return anchors, regrets


def anchor_errors(env: HybridTrackVectorEnv, tracks: IntArray, before: FloatArray) -> FloatArray:
    """Return (true state - anchor) of tracks that have just been switched, (n, 4), in the heading
    frame. `env` has a trace longer than the longest segment; `before` are the true states before
    the step, (n, 4).
    """
    # The last tick of the segment.
    last = env.world.field("trace_length")[tracks] - 2
    anchor = env.world.field("anchor")[tracks]
    truth = np.where((last < 0)[:, None], before, env.world.trace[tracks, last][:, TRUTH])
    # Positions and velocities, (n, 2), as complex numbers.
    error, state = (each[:, :2] + 1j * each[:, 2:] for each in (truth - anchor, anchor))
    heading = state[:, 1] / np.maximum(np.abs(state[:, 1]), 1e-300)
    turned = error * heading.conj()[:, None]
    return np.hstack([turned.real, turned.imag])
