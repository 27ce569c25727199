"""Hyper-parameters of the algorithms of Stable-Baselines3 and sb3-contrib, named as in the libraries."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from agents.learned.policy_file import check_policy_kwargs
from agents.training.learning_rate import learning_rate_schedule
from hybrid_env.checks import check_between, check_integer, check_number, check_positive, reject

POLICIES = {
    "ppo": "MlpPolicy", "recurrent_ppo": "MlpLstmPolicy", "a2c": "MlpPolicy", "dqn": "MlpPolicy", "qrdqn": "MlpPolicy",
}  # fmt: skip
OURS = ("n_envs", "learning_rate", "policy", "policy_kwargs", "wait_bias", "observe", "reward_scale")
"""Settings that are no plain keywords of an algorithm."""
LARGEST_ROLLOUT = 2**21  # samples of an update of PPO, which then take less than a gigabyte
LARGEST_BUFFER = 10**6  # transitions, which then take a quarter of a gigabyte with three hypotheses
LARGEST_BATCH = 2**12  # transitions, whose pairs of quantiles then take less than a gigabyte
LARGEST_COUNT = 100_000  # tracks, steps or passes
LARGEST_WEIGHT = 100.0  # of a part of the loss, and of the initial bias


@dataclass(frozen=True, kw_only=True)
class LibrarySettings:
    """Hyper-parameters that all algorithms have; base class.

    The default gamma is 1: segments are fast-forwarded after a declaration, and delay is already penalised by
    the delay cost.

    Attributes:
        n_envs: number of parallel tracks.
        learning_rate: constant, or "lin_" and the initial value for linear decay to zero.
        policy: class of the policy, as in `POLICIES`.
        policy_kwargs: keyword arguments of the policy.
        gamma: discount factor.
        wait_bias: initial bias of the waiting action, on its logit or its value. With 0 an untrained policy
            declares immediately and does not learn to wait.
        observe: names of the observed quantities, see `agents.learned.features`; all if empty.
    """

    n_envs: int
    learning_rate: str | float
    policy: str
    policy_kwargs: Mapping[str, Any] = field(default_factory=dict)
    gamma: float = 1.0
    wait_bias: float = 5.0
    observe: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_integer("n_envs", self.n_envs, maximum=LARGEST_COUNT)
        learning_rate_schedule(self.learning_rate)
        check_share("gamma", self.gamma)
        check_weight("wait_bias", self.wait_bias)

    def check_algorithm(self, algo: str) -> None:
        """Raise `ArgumentError` for a value that an algorithm, a key of `POLICIES`, does not take."""
        if self.policy != POLICIES[algo]:
            raise reject("policy", self.policy, POLICIES[algo])
        check_policy_kwargs(self.policy_kwargs, algo)

    @property
    def keywords(self) -> dict[str, Any]:
        """Plain keywords of the algorithm."""
        return {one.name: getattr(self, one.name) for one in dataclasses.fields(self) if one.name not in OURS}


def check_share(name: str, value: Any) -> None:
    """Raise `ArgumentError` if a value is not in (0, 1]."""
    if isinstance(value, bool) or value != 1.0:
        check_between(name, value, 0.0, 1.0)


def check_weight(name: str, value: Any) -> None:
    """Raise `ArgumentError` if a value is no number of magnitude at most `LARGEST_WEIGHT`."""
    if abs(check_number(name, value)) > LARGEST_WEIGHT:
        raise reject(name, value, f"a magnitude of at most {LARGEST_WEIGHT:g}")


@dataclass(frozen=True, kw_only=True)
class A2CSettings(LibrarySettings):
    """Hyper-parameters of A2C.

    Attributes:
        n_steps: steps of each track per rollout.
        gae_lambda: of generalized advantage estimation.
        ent_coef: entropy coefficient of the loss.
    """

    n_steps: int
    gae_lambda: float
    ent_coef: float

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_steps", self.n_steps, maximum=LARGEST_COUNT)
        check_share("gae_lambda", self.gae_lambda)
        check_positive("ent_coef", self.ent_coef, allow_zero=True)
        check_weight("ent_coef", self.ent_coef)
        if self.n_envs * self.n_steps > LARGEST_ROLLOUT:
            raise reject("n_steps", self.n_steps, f"n_envs x n_steps of at most {LARGEST_ROLLOUT:,}")


@dataclass(frozen=True, kw_only=True)
class PPOSettings(A2CSettings):
    """Hyper-parameters of PPO and RecurrentPPO.

    Attributes:
        batch_size: mini-batch size; a divisor of n_envs x n_steps.
        n_epochs: passes over a rollout per update.
    """

    batch_size: int
    n_epochs: int

    def __post_init__(self) -> None:
        super().__post_init__()
        check_integer("n_epochs", self.n_epochs, maximum=LARGEST_COUNT)
        check_integer("batch_size", self.batch_size, minimum=2)
        samples = self.n_envs * self.n_steps
        if samples % self.batch_size:
            raise reject("batch_size", self.batch_size, f"a divisor of n_envs x n_steps = {samples}")


@dataclass(frozen=True, kw_only=True)
class QSettings(LibrarySettings):
    """Hyper-parameters of DQN and QR-DQN; with `net_arch: []` of Q-learning with linear values.

    Attributes:
        buffer_size: transitions of the replay buffer, at least one for each track.
        batch_size: transitions of an update.
        learning_starts: environment steps before the first update, in which actions are random.
        train_freq: steps of each track between updates.
        gradient_steps: updates then.
        target_update_interval: environment steps between updates of the target network, at least n_envs.
        exploration_initial_eps, exploration_final_eps: share of random actions at first, and at last.
        exploration_fraction: share of the training in which it decreases.
        reward_scale: factor of the rewards. The loss is quadratic for errors below 1 only, and values of large costs
            would lie near the median of the returns and not at their mean.
        n_steps: rewards of a track that a target sums before it takes the value of the network.
    """

    buffer_size: int
    batch_size: int
    learning_starts: int
    train_freq: int
    gradient_steps: int
    target_update_interval: int
    exploration_fraction: float
    exploration_final_eps: float
    exploration_initial_eps: float = 1.0
    n_steps: int = 1
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
            check_share(name, getattr(self, name))
        for name in ("exploration_initial_eps", "exploration_final_eps"):
            if not 0.0 <= check_number(name, getattr(self, name)) <= 1.0:
                raise reject(name, getattr(self, name), "a number from 0 to 1")
