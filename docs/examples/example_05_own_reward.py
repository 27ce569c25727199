"""
A reward of your own
====================

The environment pays +1 for a correct and -1 for a wrong decision, and takes a cost for every tick. If other errors hurt
more, a wrapper changes the reward; ``info`` has all that it needs.
"""

# %%
# Here a turn that is taken for straight motion, or for a turn to the other side, costs 5 instead of 1: the object may
# hit something. A false alarm costs 1 as before.

from typing import Any

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

from hybrid_env import Layout


class MissedTurns(gym.Wrapper):
    """Takes 4 more for a turn that was not recognised."""

    def step(self, action: Any):
        """Step, and change the reward of a decision."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        if "correct" in info and not info["correct"] and info["decided_true_mode"] != 0:
            reward -= 4.0
        return observation, reward, terminated, truncated, info


# %%
# A rule with two thresholds: straight motion is declared at a smaller error probability than a turn. The first is varied.

layout = Layout(3)


def act(observation, alpha_straight, alpha_turn):
    """Declare the likeliest hypothesis once the others have at most alpha of the posterior."""
    likelihoods = np.exp(layout.read(observation, "log_ratio"))
    best = int(likelihoods.argmax())
    error = 1.0 - likelihoods[best] / likelihoods.sum()
    return best + 1 if error <= (alpha_turn if best else alpha_straight) else 0


def mean_reward(env, alpha_straight, alpha_turn=0.05, episodes=60):
    """Mean reward per segment."""
    total = 0.0
    for seed in range(episodes):
        observation, _ = env.reset(seed=seed)
        terminated = False
        while not terminated:
            observation, reward, terminated, _, _ = env.step(
                act(observation, alpha_straight, alpha_turn)
            )
            total += float(reward)
    return total / (6 * episodes)


alphas = np.array([0.3, 0.2, 0.1, 0.05, 0.02, 0.01, 3e-3, 1e-3, 3e-4])
plain = gym.make("hybrid_env:HybridTrack-v0")
wrapped = MissedTurns(plain)
rewards = {
    "the reward of the environment": [mean_reward(plain, alpha) for alpha in alphas],
    "missed turns cost 5": [mean_reward(wrapped, alpha) for alpha in alphas],
}

# %%
# With the new reward it pays to be surer before straight motion is declared.

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for label, values in rewards.items():
    (line,) = axes.semilogx(alphas, values, "o-", label=label, markerfacecolor="white")
    best = int(np.argmax(values))
    axes.plot(alphas[best], values[best], "o", color=line.get_color(), markersize=9)
    print(f"{label}: best alpha for straight motion {alphas[best]:g}, reward {values[best]:.3f}")
axes.invert_xaxis()
axes.set(
    xlabel="error probability at which straight motion is declared",
    ylabel="mean reward per segment",
)
axes.grid(alpha=0.25)
axes.legend(frameon=False)
plt.show()
