"""Features extractor of Stable-Baselines3: selected quantities of the observation, or the posterior."""

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


class ObservationFeatures(BaseFeaturesExtractor):
    """Features extractor that selects quantities of the observation by name.

    Args:
        observation_space: of one observation row.
        observe: keys of `hybrid_env.Layout`, or "posterior": the posterior of each hypothesis under equal
            priors.

    Raises:
        ArgumentError: an unknown name.
    """

    def __init__(self, observation_space: spaces.Box, observe: tuple[str, ...]):
        layout = Layout.of_width(observation_space.shape[0])
        known = (*layout.slices, POSTERIOR)
        for name in observe:
            if name not in known:
                raise reject("observe", name, ", ".join(known))
        columns = np.concatenate(
            [np.arange(layout.width)[layout.slices[name]] for name in observe if name != POSTERIOR]
            or [np.zeros(0, np.int64)]
        )
        hypotheses = layout.hypotheses if POSTERIOR in observe else 0
        super().__init__(observation_space, columns.size + hypotheses)
        self.columns: Any = torch.from_numpy(columns)
        first = layout.slices["log_ratio"].start
        self.log_ratios = slice(first, first + hypotheses)

    def forward(self, rows: Tensor) -> Tensor:
        """Return features (N, features) of observation rows (N, width)."""
        posterior = torch.softmax(rows[:, self.log_ratios] / LOG_SCALE, dim=-1)
        return torch.cat([posterior, rows[:, self.columns]], dim=-1)


def policy_kwargs_with_features(policy_kwargs: Mapping[str, Any], observe: tuple[str, ...]) -> dict[str, Any]:
    """Return `policy_kwargs` with the features extractor added; unchanged if `observe` is empty."""
    if not observe:
        return dict(policy_kwargs)
    return dict(policy_kwargs) | {
        "features_extractor_class": ObservationFeatures,
        "features_extractor_kwargs": {"observe": observe},
    }
