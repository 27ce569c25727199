"""
Train PPO and watch it decide
=============================

PPO of Stable-Baselines3, for some seconds, then its decisions on one episode. The command ``hybridtrack train`` does the
same with a run folder, checkpoints and a learning curve.
"""

# %%
# :class:`~agents.training.vec_env.HybridTrackVecEnv` is the vector environment as a ``VecEnv``. Two things matter: a
# discount factor of 1, because the reward already counts the delay, and a first policy that waits, because otherwise it
# never sees what waiting is worth.

import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO

from agents.learned.policy import PolicyDecider
from agents.training.vec_env import HybridTrackVecEnv
from baselines import SPRTDecider
from baselines.rules.rollout import evaluate

torch.set_num_threads(1)
steps = 400_000
model = PPO(
    "MlpPolicy",
    HybridTrackVecEnv("hybrid_env:HybridTrack-v0", num_envs=64),
    gamma=1.0,
    gae_lambda=0.9,
    n_steps=128,
    batch_size=2048,
    n_epochs=4,
    learning_rate=lambda left: 6e-3 * left,
    seed=0,
    device="cpu",
)
model.policy.action_net.bias.data[0] = 5.0
model.learn(steps)

# %%
# The same 300 episodes for the trained policy and for ATE. Three times as many steps gain about 0.06 more.

decider = PolicyDecider(model.policy)
deciders = {"PPO": decider, "ATE": SPRTDecider(1e-3)}
for name, rule in deciders.items():
    decisions = evaluate(rule, episodes=300)
    print(
        f"{name}: reward {decisions.reward.mean():.3f} a segment, "
        f"{100 * decisions.correct.mean():.1f} % correct after {decisions.ticks.mean():.1f} ticks"
    )

# %%
# One episode, tick by tick: the probability that the policy gives to each action.

import gymnasium as gym

env = gym.make("hybrid_env:HybridTrack-v0")
observation, info = env.reset(seed=7)
probabilities, decisions = [], []
terminated = False
while not terminated:
    with torch.no_grad():
        logits = model.policy.get_distribution(torch.as_tensor(observation)[None]).distribution.logits[0]
    probabilities.append(np.exp(logits.numpy()))
    actions, _ = decider.predict(observation[None], None, np.array([False]), True)
    observation, _, terminated, _, info = env.step(int(actions[0]))
    if "correct" in info:
        decisions.append((len(probabilities), info["decided_mode"], info["correct"]))

figure, axes = plt.subplots(figsize=(9, 3.6), layout="constrained")
colours = ("0.75", "#d55e00", "#0072b2", "#009e73")
labels = ("wait", "declare straight", "declare left", "declare right")
axes.stackplot(
    np.arange(1, len(probabilities) + 1), np.array(probabilities).T, colors=colours, labels=labels, step="mid"
)
for step, mode, correct in decisions:
    axes.axvline(step + 0.5, color="black", linewidth=1)
    text = ("straight", "left", "right")[mode] + ("" if correct else ", wrong")
    axes.text(step, 1.02, text, ha="right", va="bottom", fontsize=9)
axes.set(
    xlabel="step of the episode", ylabel="probability of the action", ylim=(0, 1), xlim=(1, len(probabilities) + 0.5)
)
axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=4, frameon=False)
plt.show()
