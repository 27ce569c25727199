"""An algorithm as a user writes one: a network says whether the likeliest hypothesis is right."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from agents import NetworkAlgorithm, NetworkDecider, NetworkSettings, task_of
from hybrid_env import HybridTrackVectorEnv, Layout


class SmallNet(nn.Module):
    """The log-odds (N,) of inputs (N, 2)."""

    def __init__(self, hidden):
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(2, hidden), nn.Tanh(), nn.Linear(hidden, 1))

    def forward(self, inputs):
        return self.layers(inputs).squeeze(-1)


class SmallDecider(NetworkDecider):
    """Declares the likeliest hypothesis once the log-odds exceed the threshold."""

    network = SmallNet
    symbol = "log-odds"
    thresholds = -1.0, 0.0, 1.0
    default = 0.0

    def __init__(self, net, world):
        super().__init__()
        self.net, self.layout = net, Layout(world.hypotheses)

    def odds(self, rows):
        names = "ticks", "log_error_probability"
        inputs = np.column_stack([self.layout.read(rows, name) for name in names])
        return self.net(torch.from_numpy(inputs / 50.0).float())

    @torch.no_grad()
    def decide(self, observation, state, episode_start):
        best = self.layout.read(observation, "log_ratio").argmax(-1)
        declares = self.odds(observation).numpy() > self.threshold
        return np.where(declares, best + 1, 0), state


@dataclass(frozen=True, kw_only=True)
class SmallSettings(NetworkSettings):
    n_envs: int


class Small(NetworkAlgorithm):
    Settings = SmallSettings
    decider = SmallDecider
    smallest_factor = 0.1

    def prepare(self):
        self.world = task_of(self.env_id, self.options).options

    def train_round(self):
        """A step of the optimizer for the tenth tick of each track."""
        env = HybridTrackVectorEnv(self.settings.n_envs, **vars(self.world))
        env.reset(seed=self.seed + 1000 * self.rounds)
        for _ in range(9):
            rows, *_ = env.step(np.zeros(env.num_envs, np.int64))
        agent = self.agent("")
        right = agent.layout.read(rows, "log_ratio").argmax(-1) == env.world.field("true_mode")
        target = torch.from_numpy(right).float()
        loss = nn.functional.binary_cross_entropy_with_logits(agent.odds(rows), target)
        self.set_learning_rate()
        self.improve(loss, 1.0, self.network)
        steps = 10 * env.num_envs
        return steps, float(target.mean()), math.nan, {"loss": float(loss.detach())}
