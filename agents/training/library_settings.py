"""Hyper-parameters of the algorithms of Stable-Baselines3 and sb3-contrib, named as in the
libraries.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

from annotated_types import Interval

from agents.training.settings import Factor, check_rate
from hybrid_env.checks import Checked, Count, declared_fields

# Units of a layer, of which a file may not ask for more.
Layer = Annotated[int, Interval(ge=1, le=1024)]


@dataclass(frozen=True, kw_only=True)
class LibrarySettings(Checked):
    """Hyper-parameters that all algorithms have; base class.

    The default gamma is 1: segments are fast-forwarded after a declaration, and delay is already
    penalised by the delay cost.
    """

    # Parallel tracks.
    n_envs: Count
    # Constant, or "lin_" and the initial value for linear decay to zero.
    learning_rate: Annotated[str | float, check_rate]
    # Class of the policy, and its keyword arguments, see `LibraryAlgorithm`.
    policy: str
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    # Discount factor.
    gamma: Factor = 1.0
    # Initial bias of the waiting action, on its logit or its value; with 0 an untrained policy
    # declares immediately and does not learn to wait.
    wait_bias: float = 5.0
    # Names of the observed quantities, see `ObservationFeatures`; all if empty.
    observe: tuple[str, ...] = ()

    @property
    def keywords(self) -> dict[str, Any]:
        """Plain keywords of the algorithm."""
        base: Any = LibrarySettings
        ours = declared_fields(base).keys() - {"gamma"} | {"reward_scale"}
        return {name: value for name, value in vars(self).items() if name not in ours}
