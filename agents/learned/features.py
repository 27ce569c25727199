"""Features extractor of Stable-Baselines3: selected quantities of the observation, or the posterior."""

from collections.abc import Mapping
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor

from hybrid_env.checks import reject
from hybrid_env.observation import Layout

POSTERIOR = "posterior"


class ObservationFeatures(BaseFeaturesExtractor):
    """Features extractor that selects quantities of the observation by name.

    Args:
        observation_space: of one observation row.
        observe: keys of the layout, or "posterior": the posterior of each hypothesis, under equal priors
            where the observation has no probabilities.
        layout: of the observation.
    """

    def __init__(self, observation_space: spaces.Box, observe: tuple[str, ...], layout: type[Layout] = Layout):
        rows = layout.of_width(observation_space.shape[0])
        known = (*rows.slices, POSTERIOR)
        for name in observe:
            if name not in known:
                raise reject("observe", name, ", ".join(known))
        columns = [k for name in observe if name != POSTERIOR for k in range(rows.width)[rows.slices[name]]]
        hypotheses = rows.hypotheses if POSTERIOR in observe else 0
        super().__init__(observation_space, len(columns) + hypotheses)
        self.columns = torch.tensor(columns, dtype=torch.int64)
        logarithms = "log_probability" if "log_probability" in rows.slices else "log_ratio"
        first = rows.slices[logarithms].start
        self.logarithms, self.log_scale = slice(first, first + hypotheses), rows.scales[logarithms]

    def forward(self, rows: Tensor) -> Tensor:
        """Return features (N, features) of observation rows (N, width)."""
        posterior = torch.softmax(rows[:, self.logarithms] / self.log_scale, dim=-1)
        return torch.cat([posterior, rows[:, self.columns]], dim=-1)


def policy_kwargs_with_features(
    policy_kwargs: Mapping[str, Any], observe: tuple[str, ...], layout: type[Layout]
) -> dict[str, Any]:
    """Return `policy_kwargs` with the features extractor added; unchanged if `observe` is empty."""
    if not observe:
        return dict(policy_kwargs)
    keywords = {"observe": observe, "layout": layout}
    return {**policy_kwargs, "features_extractor_class": ObservationFeatures, "features_extractor_kwargs": keywords}
