"""Hyper-parameters of PPO, importable without torch."""

from dataclasses import dataclass

from hybrid_env.checks import check_between, check_integer, check_number, check_positive, reject

STEPS = 1_500_000
"""Environment steps of a training, summed over tracks; about half a minute on one core."""


@dataclass(kw_only=True)
class PPOSettings:
    """Hyper-parameters of PPO; gamma is 1, because haste is priced by the delay cost already."""

    num_envs: int = 64
    """Tracks trained on at once."""
    rollout: int = 128
    """Steps of each track between updates."""
    batch: int = 2048
    """Samples of a gradient step."""
    epochs: int = 4
    """Passes over each rollout."""
    learning_rate: float = 6e-3
    """Adam's step size, annealed linearly to 0."""
    gae_lambda: float = 0.9
    """Of generalised advantage estimation."""
    entropy: float = 0.0
    """Coefficient of the entropy bonus."""
    hidden: tuple[int, ...] = (64, 64)
    """Units of the hidden layers of actor and critic."""
    wait_bias: float = 5.0
    """First bias of the logit of waiting; at 0 a fresh policy declares at once and never learns to wait."""

    def check(self) -> None:
        """Refuse nonsense in one line."""
        for name in ("num_envs", "rollout", "epochs"):
            check_integer(name.replace("_", "-"), getattr(self, name))
        check_integer("batch", self.batch, minimum=2)
        if check_positive("learning-rate", self.learning_rate) > 1.0:
            raise reject("learning-rate", self.learning_rate, "at most 1")
        if self.gae_lambda != 1.0:
            check_between("gae-lambda", self.gae_lambda, 0.0, 1.0)
        check_positive("entropy", self.entropy, allow_zero=True)
        check_number("wait-bias", self.wait_bias)
        if not self.hidden:
            raise reject("hidden", self.hidden, "one or more layers")
        for units in self.hidden:
            check_integer("hidden", units)
        if self.num_envs * self.rollout % self.batch:
            samples = self.num_envs * self.rollout
            raise reject("batch", self.batch, f"a divisor of num-envs x rollout = {samples}")
