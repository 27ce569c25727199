"""Training of the transformer on measurements: the true modes of whole segments."""

from collections.abc import Sequence
from typing import Any, ClassVar

from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.reward_decider import RewardDecider
from agents.learned.transformer_net import TransformerDecider, raw_inputs
from agents.training.reward import RewardRun, Segments


class TransformerRun(RewardRun):
    """A training run of `TransformerNet` on the segments of `RewardRun`, but with their true modes."""

    decider: ClassVar[type[RewardDecider]] = TransformerDecider
    inputs = staticmethod(raw_inputs)

    def labels(self, found: Segments) -> Sequence[NDArray[Any]]:
        """See `RewardRun.labels`."""
        return (found.modes,)

    def loss(self, inputs: Tensor, logs: Tensor, lengths: Tensor, *labels: Tensor) -> Tensor:
        """Return the mean cross-entropy of the true modes (S,) over all rows."""
        (modes,) = labels
        return nn.functional.nll_loss(self.net(inputs, lengths), modes.repeat_interleave(lengths))
