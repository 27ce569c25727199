"""A causal transformer that learns the true modes of segments."""

from collections.abc import Sequence
from typing import Any

from numpy.typing import NDArray
from torch import Tensor, nn

from agents.algorithms.reward import SegmentAlgorithm, Segments, SegmentSettings
from agents.learned.transformer_net import TransformerDecider, raw_inputs


class Transformer(SegmentAlgorithm):
    """A training run of `TransformerNet`."""

    name = "transformer"
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
