"""
A scheme of your own
====================

Which segments an episode has is an option. Here the object turns with radii that no filter of the bank knows: how far
off may they be?
"""

# %%
# A fixed scheme is a text; a random one is an object, whose radii may differ from those of the bank.

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

from baselines import MSPRTDecider
from baselines.rules.rollout import record_decisions
from hybrid_env import RandomScheme

env = gym.make("hybrid_env:HybridTrack-v0", scheme="S80 L40r5 R40r5 S60")
env.reset(seed=0)
print(env.unwrapped.options.scheme)

# %%
# The bank expects turns of 5 m. With ``correctness="type"`` a decision is correct if straight, left or right is.

rule = MSPRTDecider(0.02, by="type")
radii = np.array([2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0])
results = []
for radius in radii:
    scheme = RandomScheme(segments=6, lengths=(50, 100), radii=(float(radius),))
    results.append(record_decisions(rule, episodes=300, scheme=scheme, correctness="type"))

# %%
# Tighter turns leave the filters behind, and their anchors suffer; wide turns look like straight motion.

straight = [100 * np.mean(result.correct[result.true_mode == 0]) for result in results]
turns = [100 * np.mean(result.correct[result.true_mode != 0]) for result in results]
ticks = [result.ticks.mean() for result in results]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.semilogx(radii, straight, "o-", color="#d55e00", label="straight segments")
left.semilogx(radii, turns, "o-", color="#0072b2", label="turns")
left.set(ylabel="correct type, %", ylim=(0, 103))
left.legend(frameon=False, loc="lower left")
right.semilogx(radii, ticks, "o-", color="0.3")
right.set(ylabel="mean decision time, ticks")
for axes in (left, right):
    axes.axvline(5.0, color="0.6", linestyle="--", linewidth=1)
    axes.set_xticks([2, 3, 5, 10, 20], ["2", "3", "5", "10", "20"])
    axes.minorticks_off()
    axes.set_xlabel("true radius, m (the bank knows 5 m)")
    axes.grid(alpha=0.25)
plt.show()
