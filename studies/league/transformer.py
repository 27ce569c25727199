"""A causal transformer over the measurements of a segment, without filters, and as a decider.

It reads positions in the frame of the anchor (the estimate at the switch), in units of the noise,
once for each turn hypothesis from the side of this turn. Innovations, likelihoods and covariances
of the bank are not among its inputs. All heads share keys and values (multi-query attention,
Shazeer 2019), so that the memory of a track stays small.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.statement_net import GAIN, sides, zero_layer
from baselines.rules.decider import Observations
from hybrid_env.observation import Layout
from studies.league.reward import (
    LIMIT,
    SMALLEST,
    RewardDecider,
    SegmentAlgorithm,
    Segments,
    SegmentSettings,
    with_straight,
)

RAW_INPUTS = 11
LAYERS, HEADS, KEY = 2, 4, 16
# Last ticks of a segment that a decider remembers.
CONTEXT = 256


def raw_inputs(
    rows: NDArray[np.float32],
    tau: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the inputs of each turn hypothesis (N, M - 1, 11), and the logarithms of equal
    priors (N, M).

    The rows are (N, width), and a tick has the length tau [s].
    """
    layout = Layout.of_rows(rows)
    side = sides(layout.hypotheses)[1:]
    ticks = layout.read(rows, "ticks")
    # In a tick.
    distance = np.maximum(layout.read(rows, "speed") * tau, SMALLEST)
    # In units of the noise.
    pace = distance * np.exp(-0.5 * layout.read(rows, "log_noise"))
    ahead = layout.read(rows, "displacement_along") - pace * ticks
    across = layout.read(rows, "displacement_across")[:, None] * side
    longer = ticks / 5.0 + 1.0
    previous = layout.read(rows, "previous")
    kind = np.where(
        previous @ sides(layout.hypotheses) > 0,
        1.0,
        -1.0,
    )
    columns = [
        np.arcsinh(across),
        across / longer[:, None],
        np.arcsinh(ahead),
        ahead / longer,
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        np.log(pace),
        10.0 * layout.read(rows, "curvature")[:, 1:] * side * distance[:, None],
        previous[:, 0],
        previous[:, 1:],
        (1.0 - previous[:, 0])[:, None] * kind[:, None] * side,
    ]
    out = np.empty((len(rows), side.size, RAW_INPUTS), np.float32)
    for k, column in enumerate(columns):
        out[..., k] = np.clip(
            column if column.ndim == 2 else column[:, None],
            -LIMIT,
            LIMIT,
        )
    return out, np.zeros((len(rows), layout.hypotheses), np.float32)


class AttentionLayer(nn.Module):
    """Self-attention and a feed-forward part, each added to its input: a stream of `hidden`
    units.
    """

    def __init__(self, hidden: int):
        super().__init__()
        self.norm = nn.LayerNorm(hidden)
        self.query, self.memory = nn.Linear(hidden, HEADS * KEY), nn.Linear(hidden, 2 * KEY)
        self.join = nn.Linear(HEADS * KEY, hidden)
        self.feed = nn.Sequential(
            nn.LayerNorm(hidden),
            nn.Linear(hidden, 2 * hidden),
            nn.SiLU(),
            nn.Linear(2 * hidden, hidden),
        )

    def stored(self, x: Tensor) -> Tensor:
        """Return keys and values (..., 2 KEY) of a stream (..., hidden)."""
        return self.memory(self.norm(x))

    def forward(self, x: Tensor, stored: Tensor, mask: Tensor | None = None) -> Tensor:
        """Return the stream (B, Q, hidden) after the layer, which attends to ticks of `stored`
        (B, T, 2 KEY).

        The mask (B, 1, Q, T) is True where it does; None stands for all ticks up to its own, with Q
        = T.
        """
        query = self.query(self.norm(x)).unflatten(-1, (HEADS, KEY)).transpose(1, 2)
        key, value = (
            stored[:, None]
            .expand(
                -1,
                HEADS,
                -1,
                -1,
            )
            .split(KEY, -1)
        )
        found = nn.functional.scaled_dot_product_attention(
            query,
            key,
            value,
            mask,
            is_causal=mask is None,
        )
        x = x + self.join(found.transpose(1, 2).flatten(2))
        return x + self.feed(x)


class TransformerNet(nn.Module):
    """Posterior of the hypotheses after each tick of a segment; equal without training."""

    def __init__(self, hidden: int):
        super().__init__()
        self.enter = nn.Linear(RAW_INPUTS, hidden)
        self.layers: Any = nn.ModuleList(AttentionLayer(hidden) for _ in range(LAYERS))
        self.output = nn.Sequential(nn.LayerNorm(hidden), zero_layer(hidden, 2))

    def logits(self, x: Tensor) -> Tensor:
        """Return logarithms of the posterior (..., M) from streams of each turn (..., M - 1,
        hidden).
        """
        return torch.log_softmax(with_straight(GAIN * self.output(x)), -1)

    def forward(self, inputs: Tensor, lengths: Tensor) -> Tensor:
        """Return logarithms of the posterior (n, M) of all rows of S segments of `lengths` (S,)
        rows.

        The inputs (n, M - 1, 11) are those of `raw_inputs`, one segment after the other.
        """
        segment = torch.arange(len(lengths)).repeat_interleave(lengths)
        place = torch.arange(len(inputs)) - (lengths.cumsum(0) - lengths)[segment]
        turns = inputs.shape[1]
        x = inputs.new_zeros(
            len(lengths),
            int(lengths.max()),
            *inputs.shape[1:],
        )
        x[segment, place] = inputs
        x = self.enter(x.transpose(1, 2).flatten(0, 1))
        for layer in self.layers:
            x = layer(x, layer.stored(x))
        return self.logits(x.unflatten(0, (-1, turns)).transpose(1, 2)[segment, place])

    def step(self, inputs: Tensor, ticks: Tensor, memory: Tensor) -> Tensor:
        """Return logarithms of the posterior (N, M) after the inputs (N, M - 1, 11) of one tick,
        (N,) from 1.

        The memory (N, M - 1, T, LAYERS, 2 KEY + 1) of the last T ticks changes in place; its last
        number is 1 where there is one.
        """
        tracks = torch.arange(len(inputs))
        place = (ticks - 1) % memory.shape[2]
        memory[ticks == 1] = 0.0
        memory[tracks, :, place, :, -1] = 1.0
        x = self.enter(inputs).flatten(0, 1)[:, None]
        used = int(ticks.max().clamp(max=memory.shape[2]))
        for k, layer in enumerate(self.layers):
            memory[tracks, :, place, k, :-1] = layer.stored(x)[:, 0].unflatten(0, inputs.shape[:2])
            part = memory[:, :, :used, k].flatten(0, 1)
            x = layer(
                x,
                part[..., :-1],
                part[:, None, None, :, -1] > 0.5,
            )
        return self.logits(x[:, 0].unflatten(0, inputs.shape[:2]))


class TransformerDecider(RewardDecider):
    """Declares the likeliest hypothesis once its error probability is at most alpha; the state
    is the memory.
    """

    default = 0.02
    network = TransformerNet
    label = "transformer on measurements"

    def advance(
        self,
        rows: Observations,
        ticks: Tensor,
        state: Tensor | None,
    ) -> tuple[Tensor, Tensor]:
        inputs = torch.from_numpy(raw_inputs(rows, self.world.tau)[0])
        if state is None:
            longest = min(self.world.longest_segment, CONTEXT)
            state = torch.zeros(
                *inputs.shape[:2],
                longest,
                LAYERS,
                2 * KEY + 1,
            )
        return self.net.step(
            inputs,
            ticks,
            state,
        ).double().exp(), state


class Transformer(SegmentAlgorithm):
    """A training run of `TransformerNet`."""

    Settings = SegmentSettings
    decider = TransformerDecider
    inputs = staticmethod(raw_inputs)

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `SegmentAlgorithm.labels`: the true modes (S,)."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the true modes over all rows."""
        return nn.functional.nll_loss(
            self.net(inputs, lengths),
            labels[0].repeat_interleave(lengths),
        )
