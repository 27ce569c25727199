"""
A policy by hand
================

The loop of Gymnasium with a rule of our own: declare the likeliest hypothesis as soon as it leads the others by
a margin. The margin trades errors for time.
"""

# %%
# One episode. The observation is a row of numbers; :class:`hybrid_env.Layout` reads them by name. The log-likelihood of
# each hypothesis minus the largest is 0 for the likeliest and negative for the others. With ``decide_every=1`` a decision is
# asked for at every tick, not at every eighth one.

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np

import hybrid_env

env = gym.make("hybrid_env:HybridTrack-v0", decide_every=1)
layout = hybrid_env.Layout(3)  # straight, left turn, right turn


def act(observation, margin):
    """Return the action: 0 waits, i + 1 declares hypothesis i."""
    ratios = layout.read(observation, "log_ratio")
    best = int(np.argmax(ratios))
    lead = -np.delete(ratios, best).max()
    return best + 1 if lead >= margin else 0


def run_episode(margin, seed):
    """Return rewards of the steps, and correctness and decision tick of each segment."""
    observation, _ = env.reset(seed=seed)
    rewards, correct, ticks = [], [], []
    terminated = False
    while not terminated:
        observation, reward, terminated, _, info = env.step(act(observation, margin))
        rewards.append(reward)
        if "correct" in info:
            correct.append(info["correct"])
            ticks.append(info["ticks"])
    return sum(rewards), correct, ticks


reward, correct, ticks = run_episode(margin=3.0, seed=1)
print(f"reward {reward:.2f}, correct {correct}, decided at ticks {ticks}")

# %%
# The environment draws itself. This is the first segment, a few ticks before the decision.

drawn = gym.make("hybrid_env:HybridTrack-v0", render_mode="rgb_array")
drawn.reset(seed=1)
for _ in range(25):
    drawn.step(0)
picture = drawn.render()
drawn.close()

figure, axes = plt.subplots(figsize=(9, 9 * picture.shape[0] / picture.shape[1]), layout="tight")
axes.imshow(picture)
axes.set_axis_off()
plt.show()

# %%
# The margin over 100 episodes. Waiting longer makes fewer errors, and costs more; the best reward lies between.

margins = [0.1, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0]
rewards, accuracies, times = [], [], []
for margin in margins:
    episodes = [run_episode(margin, seed) for seed in range(100)]
    rewards.append(np.mean([episode[0] / 6.0 for episode in episodes]))
    accuracies.append(np.mean([episode[1] for episode in episodes]))
    times.append(np.mean([episode[2] for episode in episodes]))

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.plot(times, 100.0 * np.array(accuracies), "o-")
left.set(xlabel="mean decision time, ticks", ylabel="correct segments, %")
right.plot(times, rewards, "o-")
right.set(xlabel="mean decision time, ticks", ylabel="mean reward per segment")
for axes in (left, right):
    axes.grid(alpha=0.25)
    axes.margins(0.1)
for time, accuracy, value, margin in zip(times, accuracies, rewards, margins, strict=True):
    left.annotate(
        f"{margin:g}", (time, 100.0 * accuracy), xytext=(6, -10), textcoords="offset points"
    )
    right.annotate(f"{margin:g}", (time, value), xytext=(6, -10), textcoords="offset points")
figure.suptitle("Numbers at the points: the margin")
plt.show()
