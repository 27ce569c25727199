"""
Train PPO and watch it decide
=============================

PPO of Stable-Baselines3 with its default settings, for 50,000 decisions, then its decisions on one episode. With 100,000
it earns more. The command ``hybridtrack train`` does the same with many tracks, a run folder, checkpoints and a
learning curve.
"""

# %%
# ``at-once`` declares the likeliest hypothesis at once: what PPO earns above it is learned.

import gymnasium as gym
import torch
from stable_baselines3 import PPO

from agents import evaluate

torch.set_num_threads(1)  # fastest for a small network
model = PPO("MlpPolicy", gym.make("hybrid_env:HybridTrack-v0"), seed=0)
for _ in range(3):
    reward = evaluate(model)["reward"].value  # per segment, on the same 1,000 episodes
    print(f"PPO, {model.num_timesteps} decisions: {reward:.3f}")
    model.learn(20_000, reset_num_timesteps=False)
model.save("ppo.zip")  # hybridtrack evaluate ppo.zip
for rule in ("at-once", "sprt", "msprt"):
    print(f"{rule}: {evaluate(rule)['reward'].value:.3f}")

# %%
# One episode, decision by decision: the probability that the policy gives to each action.

import matplotlib.pyplot as plt
import numpy as np

env = gym.make("hybrid_env:HybridTrack-v0")
observation, info = env.reset(seed=7)
probabilities, decisions = [], []
terminated = False
while not terminated:
    with torch.no_grad():
        logits = model.policy.get_distribution(
            torch.as_tensor(observation)[None]
        ).distribution.logits[0]
    probabilities.append(np.exp(logits.numpy()))
    action, _ = model.predict(observation, deterministic=True)
    observation, _, terminated, _, info = env.step(action)
    if "correct" in info:
        decisions.append((len(probabilities), info["decided_mode"], info["correct"]))

figure, axes = plt.subplots(figsize=(9, 3.6), layout="constrained")
colours = ("0.75", "#d55e00", "#0072b2", "#009e73")
labels = ("wait", "declare straight", "declare left", "declare right")
axes.stackplot(
    np.arange(1, len(probabilities) + 1),
    np.array(probabilities).T,
    colors=colours,
    labels=labels,
    step="mid",
)
for step, mode, correct in decisions:
    axes.axvline(step + 0.5, color="black", linewidth=1)
    text = ("straight", "left", "right")[mode] + ("" if correct else ", wrong")
    axes.text(step, 1.02, text, ha="right", va="bottom", fontsize=9)
axes.set(
    xlabel="step of the episode",
    ylabel="probability of the action",
    ylim=(0, 1),
    xlim=(1, len(probabilities) + 0.5),
)
axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=4, frameon=False)
plt.show()
