"""Base class of the runs that train a network of this package, without Stable-Baselines3."""

from typing import ClassVar

import torch
from torch import nn

from agents.training.learning_rate import learning_rate_schedule
from agents.training.run import Run


class OwnNetworkRun(Run):
    """A run with Adam and a learning rate that may decay. Its `build` calls `start`."""

    smallest_factor: ClassVar[float]
    """Lower bound of the learning rate, as a factor of the first one, while it decays linearly."""

    def start(self, network: nn.Module, learning_rate: str | float) -> None:
        """Create the optimizer of a new network, and count steps from zero."""
        self._network, self._num_timesteps = network, 0
        self._rate, self._decays = learning_rate_schedule(learning_rate)
        self._optimizer = torch.optim.Adam(network.parameters(), lr=self._rate)
        for parameter in network.parameters():  # a part without samples yet has no gradient
            parameter.grad = torch.zeros_like(parameter)

    def set_learning_rate(self) -> None:
        """Set the learning rate of the next update."""
        remaining = 1.0 - self.num_timesteps / self.steps
        factor = max(self.smallest_factor, remaining) if self._decays else 1.0
        for group in self._optimizer.param_groups:
            group["lr"] = self._rate * factor

    @property
    def num_timesteps(self) -> int:
        """Environment steps so far."""
        return self._num_timesteps

    @num_timesteps.setter
    def num_timesteps(self, steps: int) -> None:
        self._num_timesteps = steps
        self.steps_changed()

    def steps_changed(self) -> None:
        """Called after `num_timesteps` has been set, also by a checkpoint."""

    @property
    def network(self) -> nn.Module:
        """The network."""
        return self._network

    @property
    def optimizer(self) -> torch.optim.Optimizer:
        """Its optimizer."""
        return self._optimizer
