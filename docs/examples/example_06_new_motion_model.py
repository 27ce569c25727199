"""
A new motion model
==================

The environment moves its object along lines and circles, and a turn begins at once. A vehicle turns its wheels first.
Simulate your motion in NumPy, and give the measurements to a decider: nothing of the environment is needed.
"""

# %%
# An object that flies straight, then enters a left turn of 5 m: its curvature grows linearly from 0 to 1/5 m during an
# entry time.

import matplotlib.pyplot as plt
import numpy as np

from studies.papers.ate import track_ate

tau, radius, speed, variance, lengths = 0.1, 5.0, 2.0, 0.1, (50, 80)


def entered_turn(entry, runs, seed=0):
    """Simulate (runs, T, 2) measurements and the (T, 2) true positions; the entry time in seconds."""
    rng = np.random.default_rng(seed)
    heading, position = np.pi / 2, np.zeros(2)
    truth = np.empty((sum(lengths), 2))
    for k in range(sum(lengths)):
        turning_time = tau * max(0, k + 1 - lengths[0])
        curvature = min(1.0, turning_time / max(entry, tau)) / radius
        heading += curvature * speed * tau
        position = position + speed * tau * np.array([np.cos(heading), np.sin(heading)])
        truth[k] = position
    return truth + rng.normal(scale=np.sqrt(variance), size=(runs, *truth.shape)), truth


# %%
# ATE on 1,000 runs for each entry time, with the start known and the first segment long enough to be decided correctly.
# Its filters expect the whole turn from the first tick on. At a slow entry it decides later and more often wrongly, and
# the filter of the turn, which starts from the anchor, is ahead of the object. With more process noise Q the filters
# forgive this, and take longer.

entries = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
start = np.array([0.0, 0.0, 0.0, speed])  # x, vx, y, vy one tick before the first measurement
found = {}
for process_variance in (0.001, 0.01):
    shares, ticks, errors = [], [], []
    for entry in entries:
        measurements, truth = entered_turn(entry, runs=1000)
        result = track_ate(
            measurements, lengths, start, radii=[radius], tau=tau, measurement_variance=variance,
            process_variance=process_variance, undecided="likeliest",
        )  # fmt: skip
        shares.append(100.0 * np.mean(result.decided[:, 1] == 1))
        ticks.append(result.ticks[:, 1].mean())
        squares = ((result.estimates[:, lengths[0] :, [0, 2]] - truth[lengths[0] :]) ** 2).sum(-1)
        errors.append(np.sqrt(squares.mean()))
    found[process_variance] = shares, ticks, errors

figure, axes = plt.subplots(2, 2, figsize=(9, 7), layout="constrained")
for entry in (0.0, 2.0, 4.0):
    axes[0, 0].plot(*entered_turn(entry, 1)[1].T, label=f"{entry:g} s")
axes[0, 0].set(xlabel="x, m", ylabel="y, m", aspect="equal", title="True paths")
axes[0, 0].legend(frameon=False, title="entry time")
panels = {
    "left turn decided, %": axes[0, 1],
    "decision time, ticks": axes[1, 0],
    "RMS error in the turn, m": axes[1, 1],
}
for column, (label, panel) in enumerate(panels.items()):
    for process_variance, rows in found.items():
        panel.plot(entries, rows[column], "o-", label=f"Q = {process_variance:g} m²/s²")
    panel.set(xlabel="entry time, s", ylabel=label)
    panel.grid(alpha=0.25)
    panel.legend(frameon=False)
plt.show()

# %%
# To train on such motion it has to become part of the environment, as a word of its schemes. The
# :doc:`developer guide <../developer>` says which files that concerns.
