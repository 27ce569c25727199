"""
Train PPO and watch it decide
=============================

PPO of Stable-Baselines3, for some seconds, then its decisions on one episode. The command ``hybridtrack train`` does the
same with a run folder, checkpoints and a learning curve.
"""

# %%
# :func:`agents.as_vec_env` is the environment with many tracks as a ``VecEnv``. All hyper-parameters are the library's
# defaults, but for a rollout that is divided over the tracks.

import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO

from agents import as_vec_env, evaluate

torch.set_num_threads(1)
model = PPO("MlpPolicy", as_vec_env("hybrid_env:HybridTrack-v0", 64), n_steps=32, seed=0, device="cpu")
model.learn(150_000)

# %%
# The same 300 episodes for the trained policy and for the classical rules. ATE reads the bank of its paper, the others the
# rows of the environment.

for name, decider in {"PPO": model, "ATE": "ate", "SPRT": "sprt", "MSPRT": "msprt"}.items():
    found = evaluate(decider, episodes=300)
    print(
        f"{name}: reward {found['reward'].value:.3f} a segment, "
        f"{100 * found['accuracy'].value:.1f} % correct after {found['ticks'].value:.1f} ticks"
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
    action, _ = model.predict(observation, deterministic=True)
    observation, _, terminated, _, info = env.step(action)
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
