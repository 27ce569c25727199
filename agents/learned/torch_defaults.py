"""PyTorch as this package uses it: float32 on the CPU, whatever defaults a program has set
before.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Annotated, Any, Literal, TypeAlias

import torch
from annotated_types import Interval

from baselines.rules.decider import Decider
from hybrid_env.rendering.evidence import EvidencePanel

# Units of a hidden layer.
Units: TypeAlias = Annotated[int, Interval(ge=1, le=512)]


@contextmanager
def torch_defaults() -> Iterator[None]:
    """Set PyTorch's default type and device to those of this package; also a decorator of
    functions.

    At the end the defaults are those of before.
    """
    dtype = torch.get_default_dtype()
    device = torch.get_default_device()
    torch.set_default_dtype(torch.float32)
    try:
        # A device context slows every call of PyTorch, so that there is one only where it changes
        # something.
        with nullcontext() if device.type == "cpu" else torch.device("cpu"):
            yield
    finally:
        torch.set_default_dtype(dtype)


class NetworkDecider(Decider):
    """Base class of the deciders with a network, all of whose methods run with `torch_defaults`.
    One that is trained by an algorithm has `network`, which creates the network with a number of
    hidden units.
    """

    def __init_subclass__(cls, **keywords: Any):
        super().__init_subclass__(**keywords)
        for name in ("observe", "predict", "decide", "evidence"):
            if name in vars(cls):
                setattr(cls, name, torch_defaults()(vars(cls)[name]))

    @classmethod
    def network_of(cls, entry: Mapping[str, Any]) -> torch.nn.Module:
        """Return an untrained network for the hyper-parameters of a recipe or card."""
        kind: Any = cls
        network: torch.nn.Module = kind.network(entry["hidden"])
        return network

    def log_odds_panel(
        self, below: float, above: float, curves: Literal["single", "hypothesis"]
    ) -> EvidencePanel:
        """Return the panel of log-odds of declaring, with limits below and above the threshold."""
        return EvidencePanel(
            label="log-odds of declaring against waiting",
            limits=(self.threshold - below, self.threshold + above),
            curves=curves,
            thresholds={"": self.threshold},
            legend=f"threshold {self.threshold:g}",
        )
