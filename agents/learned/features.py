"""What a policy sees of a row: some of its quantities by name, or the posterior made of them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor

from hybrid_env.checks import reject
from hybrid_env.observation import LOG_SCALE, Layout

POSTERIOR = "posterior"


class RowFeatures(BaseFeaturesExtractor):
    """Some quantities of the observation, as Stable-Baselines3's extractor of features.

    Args:
        space: of the rows.
        observe: keys of `hybrid_env.Layout`, or "posterior": of each hypothesis, with equal priors.
    """

    def __init__(self, space: spaces.Box, observe: tuple[str, ...]):
        layout = Layout.of_width(space.shape[0])
        known = (*layout.slices, POSTERIOR)
        for name in observe:
            if name not in known:
                raise reject("observe", name, ", ".join(known))
        columns = np.concatenate(
            [np.arange(layout.width)[layout.slices[name]] for name in observe if name != POSTERIOR]
            or [np.zeros(0, np.int64)]
        )
        hypotheses = layout.hypotheses if POSTERIOR in observe else 0
        super().__init__(space, columns.size + hypotheses)
        self.columns: Any = torch.from_numpy(columns)
        first = layout.slices["log_ratio"].start
        self.ratios = slice(first, first + hypotheses)

    def forward(self, rows: Tensor) -> Tensor:
        """(N, features) of rows (N, width)."""
        posterior = torch.softmax(rows[:, self.ratios] / LOG_SCALE, dim=-1)
        return torch.cat([posterior, rows[:, self.columns]], dim=-1)


def policy_keywords(policy_kwargs: Mapping[str, Any], observe: tuple[str, ...]) -> dict[str, Any]:
    """Keywords of a policy of Stable-Baselines3 that sees some quantities, all if none is named."""
    if not observe:
        return dict(policy_kwargs)
    return dict(policy_kwargs) | {
        "features_extractor_class": RowFeatures,
        "features_extractor_kwargs": {"observe": observe},
    }
