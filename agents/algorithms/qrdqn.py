"""QR-DQN of sb3-contrib: DQN with the quantiles of the return."""

from typing import Annotated

from annotated_types import Interval

from agents.algorithms.dqn import DQN


class QRDQN(DQN):
    """A training run of QR-DQN."""

    name = "qrdqn"
    policy_types = DQN.policy_types | {"n_quantiles": Annotated[int, Interval(ge=1, le=200)]}
