"""Hyper-parameters of the algorithms of Stable-Baselines3 and sb3-contrib, named as in the
libraries.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

from agents.training.settings import LARGEST_COUNT, LARGEST_WEIGHT, learning_rate_schedule
from hybrid_env.checks import check_between, check_flag, check_integer, ranged, reject

OURS = (
    "n_envs",
    "learning_rate",
    "policy",
    "policy_kwargs",
    "wait_bias",
    "observe",
    "reward_scale",
)
"""Settings that are no plain keywords of an algorithm."""
# Samples of an update, which then take less than a gigabyte.
LARGEST_ROLLOUT = 2**21
LARGEST_LAYER = 1024
MOST_LAYERS = 8
MOST_QUANTILES = 200


@dataclass(frozen=True, kw_only=True)
class LibrarySettings:
    """Hyper-parameters that all algorithms have; base class.

    The default gamma is 1: segments are fast-forwarded after a declaration, and delay is already
    penalised by the delay cost.
    """

    # Parallel tracks.
    n_envs: int
    # Constant, or "lin_" and the initial value for linear decay to zero.
    learning_rate: str | float
    # Class of the policy.
    policy: str
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    # Discount factor.
    gamma: float = 1.0
    # Initial bias of the waiting action, on its logit or its value; with 0 an untrained policy
    # declares immediately and does not learn to wait.
    wait_bias: float = 5.0
    # Names of the observed quantities, see `ObservationFeatures`; all if empty.
    observe: tuple[str, ...] = ()

    policy_name: ClassVar[str] = "MlpPolicy"
    """The only value of `policy`."""
    network_keywords: ClassVar[tuple[str, ...]] = ("net_arch", "ortho_init")
    """Allowed keyword arguments of the policy."""
    fewest_layers: ClassVar[int] = 1
    """Hidden layers of the policy."""

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)
        learning_rate_schedule(self.learning_rate)
        check_factor("gamma", self.gamma)
        check_weight("wait_bias", self.wait_bias)
        names = self.observe
        if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
            raise reject("observe", names, "a list of names")
        object.__setattr__(self, "observe", tuple(names))
        if self.policy != self.policy_name:
            raise reject("policy", self.policy, self.policy_name)
        self.check_network(self.policy_kwargs)

    @classmethod
    def check_network(cls, policy_kwargs: Any) -> None:
        """Check names and types of the keyword arguments of a policy, and the size of its
        network.
        """
        known = cls.network_keywords
        if not isinstance(policy_kwargs, Mapping) or any(
            name not in known for name in policy_kwargs
        ):
            raise reject("policy_kwargs", policy_kwargs, f"a mapping of {', '.join(known)}")
        layers = policy_kwargs.get("net_arch", [1])
        if not isinstance(layers, list) or not cls.fewest_layers <= len(layers) <= MOST_LAYERS:
            allowed = f"a list of {cls.fewest_layers} to {MOST_LAYERS} layers"
            raise reject("net_arch", layers, allowed)
        for units in layers:
            check_integer("net_arch", units, maximum=LARGEST_LAYER)
        largest = {
            "lstm_hidden_size": LARGEST_LAYER,
            "n_lstm_layers": 2,
            "n_quantiles": MOST_QUANTILES,
        }
        for name, maximum in largest.items():
            check_integer(name, policy_kwargs.get(name, 1), maximum=maximum)
        for name in ("ortho_init", "enable_critic_lstm"):
            check_flag(name, policy_kwargs.get(name, True))

    @property
    def keywords(self) -> dict[str, Any]:
        """Plain keywords of the algorithm."""
        return {
            one.name: getattr(self, one.name)
            for one in dataclasses.fields(self)
            if one.name not in OURS
        }


def check_factor(name: str, value: Any) -> None:
    """Raise `ArgumentError` if a value is not in (0, 1]."""
    if isinstance(value, bool) or value != 1.0:
        check_between(name, value, 0.0, 1.0)


check_weight = ranged(-LARGEST_WEIGHT, LARGEST_WEIGHT, f"a magnitude of at most {LARGEST_WEIGHT:g}")
