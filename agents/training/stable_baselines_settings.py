"""Hyper-parameters of the algorithms of Stable-Baselines3 and sb3-contrib, named as in the
libraries.
"""

import dataclasses
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from agents.learned.policy_file import check_policy_kwargs
from hybrid_env.checks import check_between, check_integer, check_positive, ranged, reject

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
# Samples of an update of PPO, which then take less than a gigabyte.
LARGEST_ROLLOUT = 2**21
# Transitions, which then take a quarter of a gigabyte with three hypotheses.
LARGEST_BUFFER = 10**6
# Transitions, whose pairs of quantiles then take less than a gigabyte.
LARGEST_BATCH = 2**12
# Tracks, steps or passes.
LARGEST_COUNT = 100_000
# Of a part of the loss, and of the initial bias.
LARGEST_WEIGHT = 100.0


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

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)
        learning_rate_schedule(self.learning_rate)
        check_factor("gamma", self.gamma)
        check_weight("wait_bias", self.wait_bias)

    def check_algorithm(self, algo: str) -> None:
        """Raise `ArgumentError` for a value that an algorithm does not take."""
        policy = "MlpLstmPolicy" if algo == "recurrent_ppo" else "MlpPolicy"
        if self.policy != policy:
            raise reject("policy", self.policy, policy)
        check_policy_kwargs(self.policy_kwargs, algo)

    @property
    def keywords(self) -> dict[str, Any]:
        """Plain keywords of the algorithm."""
        return {
            one.name: getattr(self, one.name)
            for one in dataclasses.fields(self)
            if one.name not in OURS
        }


def learning_rate_schedule(rate: str | float) -> tuple[float, bool]:
    """Return the initial learning rate, in (0, 1], and whether it decays linearly, with "lin_"
    before it.
    """
    decays = isinstance(rate, str) and rate.startswith("lin_")
    value = math.nan
    if isinstance(rate, (str, int, float)):
        with suppress(ValueError, OverflowError):
            value = float(rate.removeprefix("lin_") if isinstance(rate, str) else rate)
    if isinstance(rate, bool) or not 0.0 < value <= 1.0:
        raise reject(
            "learning_rate",
            rate,
            "a number above 0, at most 1, or lin_ and such a number",
        )
    return value, decays


def check_factor(name: str, value: Any) -> None:
    """Raise `ArgumentError` if a value is not in (0, 1]."""
    if isinstance(value, bool) or value != 1.0:
        check_between(name, value, 0.0, 1.0)


check_weight = ranged(-LARGEST_WEIGHT, LARGEST_WEIGHT, f"a magnitude of at most {LARGEST_WEIGHT:g}")


@dataclass(frozen=True, kw_only=True)
class A2CSettings(LibrarySettings):
    """Hyper-parameters of A2C."""

    # Of each track per rollout.
    n_steps: int
    # Of generalized advantage estimation.
    gae_lambda: float
    # Entropy coefficient of the loss.
    ent_coef: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_steps", self.n_steps, maximum=LARGEST_COUNT)
        check_factor("gae_lambda", self.gae_lambda)
        check_positive("ent_coef", self.ent_coef, allow_zero=True)
        check_weight("ent_coef", self.ent_coef)
        if self.n_envs * self.n_steps > LARGEST_ROLLOUT:
            raise reject(
                "n_steps",
                self.n_steps,
                f"n_envs x n_steps of at most {LARGEST_ROLLOUT:,}",
            )


@dataclass(frozen=True, kw_only=True)
class PPOSettings(A2CSettings):
    """Hyper-parameters of PPO and RecurrentPPO."""

    # Of a mini-batch; a divisor of n_envs x n_steps.
    batch_size: int
    # Passes over a rollout per update.
    n_epochs: int

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_epochs", self.n_epochs, maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, minimum=2)
        samples = self.n_envs * self.n_steps
        if samples % self.batch_size:
            raise reject(
                "batch_size",
                self.batch_size,
                f"a divisor of n_envs x n_steps = {samples}",
            )


@dataclass(frozen=True, kw_only=True)
class QSettings(LibrarySettings):
    """Hyper-parameters of DQN and QR-DQN; with `net_arch: []` of Q-learning with linear values.

    The loss is quadratic for errors below 1 only: without a scale of the rewards, values of large
    costs would lie near the median of the returns and not at their mean.
    """

    # Transitions of the replay buffer, at least one for each track.
    buffer_size: int
    # Transitions of an update.
    batch_size: int
    # Environment steps before the first update, in which actions are random.
    learning_starts: int
    # Steps of each track between updates.
    train_freq: int
    # Updates then.
    gradient_steps: int
    # Environment steps between updates of the target network, at least n_envs.
    target_update_interval: int
    # Share of the training in which the share of random actions decreases.
    exploration_fraction: float
    # Share of random actions at last.
    exploration_final_eps: float
    exploration_initial_eps: float = 1.0
    # Rewards of a track that a target sums before it takes the value of the network.
    n_steps: int = 1
    # Factor of the rewards.
    reward_scale: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("train_freq", "gradient_steps", "n_steps"):
            check_integer(name, getattr(self, name), maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, maximum=LARGEST_BATCH)
        check_integer("buffer_size", self.buffer_size, minimum=self.n_envs, maximum=LARGEST_BUFFER)
        check_integer("learning_starts", self.learning_starts, minimum=0)
        check_integer("target_update_interval", self.target_update_interval, minimum=self.n_envs)
        for name in ("exploration_fraction", "reward_scale"):
            check_factor(name, getattr(self, name))
        for name in ("exploration_initial_eps", "exploration_final_eps"):
            ranged(0.0, 1.0)(name, getattr(self, name))
