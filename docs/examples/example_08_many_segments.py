"""
A study of 100,000 segments
===========================

The vector environment runs thousands of tracks in one call, so that statistics are a matter of seconds.
"""

# %%
# First by hand: 16,667 tracks of six segments each, and a rule that reads the rows of all tracks at once. A track that has
# finished begins another episode, which is not counted.

import time

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
from scipy import stats

import hybrid_env
from baselines import MSPRTDecider, SPRTDecider
from baselines.rules.rollout import record_decisions

tracks = 16_667
envs = gym.make_vec("hybrid_env:HybridTrack-v0", num_envs=tracks)
layout = hybrid_env.Layout(3)
began = time.perf_counter()
observations, _ = envs.reset(seed=0)
correct, ticks, finished = [], [], np.zeros(tracks, bool)
while not finished.all():
    ratios = layout.read(observations, "log_ratio")  # (N, 3)
    error = 1.0 - 1.0 / np.exp(ratios).sum(1)
    actions = np.where(error <= 0.02, ratios.argmax(1) + 1, 0)
    observations, _, terminated, _, info = envs.step(actions)
    if "correct" in info:
        new = info["_correct"] & ~finished
        correct.append(info["correct"][new])
        ticks.append(info["ticks"][new])
    finished |= terminated
correct, ticks = np.concatenate(correct), np.concatenate(ticks)
print(
    f"{correct.size:,} segments: {100 * correct.mean():.2f} % correct after {ticks.mean():.2f} ticks"
)
print("less than 20 s" if time.perf_counter() - began < 20.0 else "slower than expected")

# %%
# :func:`baselines.rules.rollout.record_decisions` is this loop for any decider. On the published bank, the decision times of two
# rules with about the same accuracy, and the error over the decision time:

rules = {"SPRT": SPRTDecider(1e-4), "MSPRT": MSPRTDecider(0.03)}
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
for name, rule in rules.items():
    found = record_decisions(
        rule, "hybrid_env:HybridTrackPublished-v0", episodes=tracks, seed=1_000_000
    )
    print(
        f"{name}: {100 * found.correct.mean():.2f} % correct after {found.ticks.mean():.2f} ticks"
    )
    counts = np.bincount(found.ticks.ravel(), minlength=101)[:101]
    left.step(np.arange(101), 100 * counts / found.ticks.size, where="mid", label=name)
    wrong = np.bincount(found.ticks.ravel(), weights=~found.correct.ravel(), minlength=101)[:101]
    enough = counts >= 300
    at, wrong, counts = np.flatnonzero(enough), wrong[enough].astype(int), counts[enough]
    tests = [stats.binomtest(k, n) for k, n in zip(wrong, counts, strict=True)]
    bounds = np.array([test.proportion_ci(method="wilson") for test in tests])
    (line,) = right.plot(at, 100 * wrong / counts, label=name)
    right.fill_between(at, *100 * bounds.T, color=line.get_color(), alpha=0.25, linewidth=0)
left.set(
    xlabel="decision time, ticks", ylabel="segments, %", title="When they decide", xlim=(0, 70)
)
right.set(
    xlabel="decision time, ticks",
    ylabel="wrong decisions, %",
    title="Errors, with 95 % intervals (Wilson)",
)
right.set_ylim(bottom=0)
for axes in (left, right):
    axes.grid(alpha=0.25)
    axes.legend(frameon=False)
plt.show()
