"""
Clone a policy from a data set
==============================

Offline learning: a small network imitates the shipped agent from recorded episodes only, where the bank is the published one. The data set has the format of
`Minari <https://minari.farama.org>`_, which other libraries for offline learning read as well.
"""

# %%
# One command of a study writes the episodes; it runs in a checkout of the repository. They have seeds that no evaluation uses.

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import minari
import numpy as np
import torch
from torch import nn

import hybrid_env

folder = tempfile.TemporaryDirectory()
os.environ["MINARI_DATASETS_PATH"] = folder.name
env_id = "HybridTrackPublished-v0"
command = f"-m studies.datasets shipped --env {env_id} --episodes 1000"
root = Path(hybrid_env.__file__).parents[1]
subprocess.run([sys.executable, *command.split()], cwd=root, check=True)

# %%
# The rows that the agent saw, and what it did: it nearly always waits.

episodes = list(minari.load_dataset(f"{env_id}/shipped-v0"))
rows = torch.as_tensor(np.concatenate([episode.observations[:-1] for episode in episodes]))
actions = torch.as_tensor(np.concatenate([episode.actions for episode in episodes]))
print(
    f"{len(rows):,} rows of {rows.shape[1]} numbers; it waits in {100 * (actions == 0).float().mean():.0f} %"
)

# %%
# Behaviour cloning is classification of the rows by the action.

torch.set_num_threads(1)
torch.manual_seed(0)
net = nn.Sequential(
    nn.Linear(rows.shape[1], 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(), nn.Linear(64, 4)
)
epochs, batch = 20, 512
optimizer = torch.optim.Adam(net.parameters(), 3e-3)
schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.02, epochs)
for epoch in range(epochs):
    losses = []
    for chosen in torch.randperm(len(rows)).split(batch):
        loss = nn.functional.cross_entropy(net(rows[chosen]), actions[chosen])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    schedule.step()
    if epoch % 5 == 4:
        print(f"epoch {epoch + 1}: cross-entropy {np.mean(losses):.3f}")

# %%
# The clone declares when waiting is less likely than a threshold, 0.5 at first. A class with ``predict`` is enough for
# :func:`baselines.rules.rollout.record_decisions`, which lets all deciders face the same episodes.

import gymnasium as gym
import matplotlib.pyplot as plt

from agents.evaluation.registry import load_decider
from baselines.rules.rollout import record_decisions
from baselines.scoring.estimates import confidence_interval


class Clone:
    def __init__(self, threshold=0.5):
        self.threshold = threshold

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        with torch.no_grad():
            probabilities = net(torch.as_tensor(observation)).softmax(1).numpy()
        declared = probabilities[:, 1:].argmax(1) + 1
        return np.where(probabilities[:, 0] < self.threshold, declared, 0), None


options = gym.make(f"hybrid_env:{env_id}").unwrapped.options
deciders = {
    "shipped": load_decider("shipped", options),
    "clone": Clone(),
    "ATE": load_decider("ate", options),
}
results = {
    name: record_decisions(decider, env_id, episodes=1000) for name, decider in deciders.items()
}
for name, found in results.items():
    low, high = confidence_interval(found.reward.mean(1))
    print(
        f"{name}: reward {found.reward.mean():.3f} [{low:.3f}, {high:.3f}] a segment, "
        f"{100 * found.correct.mean():.1f} % correct after {found.ticks.mean():.1f} ticks"
    )

# %%
# It is better than ATE and worse than its teacher: the shipped agent remembers the segment, and its clone
# sees the present row only.

figure, axes = plt.subplots(figsize=(6, 3.8), layout="constrained")
curve = [
    record_decisions(Clone(threshold), env_id, episodes=1000)
    for threshold in (0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
]
axes.plot(
    [one.ticks.mean() for one in curve], [one.reward.mean() for one in curve], "o-", label="clone"
)
for (name, found), marker in zip(results.items(), "*os", strict=True):
    if name != "clone":
        axes.plot(found.ticks.mean(), found.reward.mean(), marker, markersize=10, label=name)
axes.set(xlabel="mean decision time, ticks", ylabel="mean reward of a segment")
axes.grid(alpha=0.25)
axes.legend(frameon=False)
plt.show()
folder.cleanup()
