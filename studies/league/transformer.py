"""A causal transformer over the measurements of a segment, without filters, and as a decider.

It reads positions in the frame of the anchor (the estimate at the switch), in units of the noise,
once for each turn hypothesis from the side of this turn. Innovations, likelihoods and covariances
of the bank are not among its inputs. All heads share keys and values (multi-query attention,
Shazeer 2019), so that the memory of a track stays small.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from hybrid_env import Layout
from studies.league.segments import (
    SMALLEST,
    Rows,
    SegmentAlgorithm,
    SegmentDecider,
    Segments,
    places,
    sides,
    with_straight,
    zero_layer,
)


def raw_inputs(rows: Rows) -> tuple[Rows]:
    """Return the inputs of each turn hypothesis (N, M - 1, 11), from rows (N, width)."""
    layout = Layout.of_rows(rows)
    read = {name: layout.read(rows, name) for name in layout.slices}
    side = sides(layout.hypotheses)
    ticks = read["ticks"][:, None]
    pace = np.maximum(read["speed"], SMALLEST)[:, None]
    ahead = read["displacement_along"][:, None] - pace * ticks
    across = read["displacement_across"][:, None] * side[1:]
    longer = ticks / 5.0 + 1.0
    previous = read["previous"]
    straight, turns = previous[:, :1], previous[:, 1:]
    kind = np.where(previous @ side > 0, 1.0, -1.0)[:, None]
    columns = [
        np.arcsinh(across),
        across / longer,
        np.arcsinh(ahead),
        ahead / longer,
        ticks / 50.0 - 0.5,
        np.log(np.maximum(ticks, 1.0)) - 2.0,
        np.log(pace),
        10.0 * read["turn_angle"][:, 1:] * side[1:],
        straight,
        turns,
        (1.0 - straight) * kind * side[1:],
    ]
    out = np.stack(np.broadcast_arrays(*columns), -1)
    return (out.clip(-5.0, 5.0).astype(np.float32),)


class AttentionLayer(nn.Module):
    """Self-attention and a feed-forward part, each added to its input: a stream of `hidden`
    units.
    """

    heads, key = 4, 16

    def __init__(self, hidden: int):
        super().__init__()
        self.norm = nn.LayerNorm(hidden)
        self.query = nn.Linear(hidden, self.heads * self.key)
        self.memory = nn.Linear(hidden, 2 * self.key)
        self.join = nn.Linear(self.heads * self.key, hidden)
        self.feed = nn.Sequential(
            nn.LayerNorm(hidden),
            nn.Linear(hidden, 2 * hidden),
            nn.SiLU(),
            nn.Linear(2 * hidden, hidden),
        )

    def stored(self, x: Tensor) -> Tensor:
        """Return keys and values (..., 2 key) of a stream (..., hidden)."""
        return self.memory(self.norm(x))

    def forward(self, x: Tensor, stored: Tensor, mask: Tensor | None = None) -> Tensor:
        """Return the stream (B, Q, hidden) after the layer, which attends to ticks of `stored`
        (B, T, 2 key).

        The mask (B, 1, Q, T) is True where it does; None stands for all ticks up to its own, with Q
        = T.
        """
        query = self.query(self.norm(x)).unflatten(-1, (self.heads, self.key)).transpose(1, 2)
        key, value = stored[:, None].expand(-1, self.heads, -1, -1).split(self.key, -1)
        attended = nn.functional.scaled_dot_product_attention(
            query, key, value, mask, is_causal=mask is None
        )
        x = x + self.join(attended.transpose(1, 2).flatten(2))
        return x + self.feed(x)


class TransformerNet(nn.Module):
    """Posterior of the hypotheses after each tick of a segment; equal without training."""

    def __init__(self, hidden: int, layers: int = 2):
        super().__init__()
        self.enter = nn.Linear(11, hidden)
        self.layers: Any = nn.ModuleList(AttentionLayer(hidden) for _ in range(layers))
        self.output = nn.Sequential(nn.LayerNorm(hidden), zero_layer(hidden, 2))

    def logits(self, x: Tensor) -> Tensor:
        """Return logarithms of the posterior (..., M) from streams of each turn (..., M - 1,
        hidden).
        """
        return torch.log_softmax(with_straight(self.output(x)), -1)

    def forward(self, inputs: Tensor, lengths: Tensor) -> Tensor:
        """Return logarithms of the posterior (n, M) of all rows of S segments of `lengths` (S,)
        rows.

        The inputs (n, M - 1, 11) are those of `raw_inputs`, one segment after the other.
        """
        segment, place = places(lengths)
        turns = inputs.shape[1]
        x = inputs.new_zeros(len(lengths), int(lengths.max()), *inputs.shape[1:])
        x[segment, place] = inputs
        x = self.enter(x.transpose(1, 2).flatten(0, 1))
        for layer in self.layers:
            x = layer(x, layer.stored(x))
        return self.logits(x.unflatten(0, (-1, turns)).transpose(1, 2)[segment, place])

    def step(self, inputs: Tensor, ticks: Tensor, memory: Tensor) -> Tensor:
        """Return logarithms of the posterior (N, M) after the inputs (N, M - 1, 11) of one tick,
        (N,) from 1.

        The memory (N, M - 1, T, layers, 2 key) of the longest segment changes in place.
        """
        tracks, used = torch.arange(len(inputs)), int(ticks.max())
        mask = torch.arange(used) < ticks.repeat_interleave(inputs.shape[1])[:, None, None, None]
        x = self.enter(inputs).flatten(0, 1)[:, None]
        for k, layer in enumerate(self.layers):
            memory[tracks, :, ticks - 1, k] = layer.stored(x)[:, 0].unflatten(0, inputs.shape[:2])
            x = layer(x, memory[:, :, :used, k].flatten(0, 1), mask)
        return self.logits(x[:, 0].unflatten(0, inputs.shape[:2]))


class TransformerDecider(SegmentDecider):
    """Declares once the error probability is at most alpha; the state is the memory of a track."""

    network = TransformerNet

    def advance(self, rows: Rows, ticks: Tensor, state: Tensor | None) -> tuple[Tensor, Tensor]:
        inputs = torch.from_numpy(raw_inputs(rows)[0])
        if state is None:
            state = torch.zeros(
                *inputs.shape[:2],
                self.world.longest_segment,
                len(self.net.layers),
                2 * AttentionLayer.key,
            )
        return self.net.step(inputs, ticks, state).double().exp(), state


class Transformer(SegmentAlgorithm):
    """A training run of `TransformerNet`."""

    decider = TransformerDecider

    def inputs(self, rows: Rows, lengths: NDArray[np.int64]) -> tuple[Rows]:
        return raw_inputs(rows)

    def loss(self, inputs: list[Tensor], segments: Segments) -> Tensor:
        """Return the mean cross-entropy of the true modes over all rows."""
        logs = self.net(*inputs, segments.lengths)
        return nn.functional.nll_loss(logs, segments.modes[places(segments.lengths)[0]])
