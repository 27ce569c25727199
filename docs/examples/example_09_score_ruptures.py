"""
A change detector of another library
====================================

``score`` compares the statements of any detector with the truth. Here `ruptures <https://github.com/deepcharles/ruptures>`_ finds the
changes of a turn rate, and stands beside a rule of this package on the same tracks.
"""

# %%
# The tracks: 40 episodes in which nobody announces the switches. The rule states the mode that the interacting multiple model (IMM)
# finds probable. The same loop keeps the measured positions for the other detector.

import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import ruptures

from baselines import ThresholdDecider, score
from baselines.rules.rollout import rollout
from hybrid_env import QuickestOptions

options = QuickestOptions()
tracks, times = 40, options.tau * np.arange(options.ticks)


def run(seed):
    """True modes, measured positions and statements of the rule: (N, T), (N, T, 2), (N, T)."""
    envs = gym.make_vec("hybrid_env:HybridTrackQuickest-v0", num_envs=tracks, tick_info=True)
    true, positions, stated = [], [], []
    for now in rollout(envs, ThresholdDecider(0.7), seed):
        if now.step:
            stated.append(now.actions)
        if now.step == options.ticks:
            return (np.stack(one, axis=1) for one in (true, positions, stated))
        true.append(now.info["true_mode"])
        positions.append(now.info["measurement"])


# %%
# ruptures segments a signal whose mean changes. The angle between two successive displacements of 15 ticks is such a signal. It is
# divided by its standard deviation, and every fifth value is used, as neighbours share their measurements. A segment is a turn if its
# mean angle is more than half of that in a turn of the environment; the sign tells left from right.

width, stride = 15, 5
path = options.speed * options.tau * width  # length of a displacement
deviation = np.sqrt(6.0 * options.measurement_variance) / path


def turn_signal(positions):
    steps = positions[width:] - positions[:-width]
    first, second = steps[:-width], steps[width:]
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return np.arctan2(cross, (first * second).sum(1))[::stride, None] / deviation


def mode_of(part):
    bound = 0.5 * path / options.radii[0] / deviation
    return 1 if part.mean() > bound else 2 if part.mean() < -bound else 0  # left, right, straight


def afterwards(positions, penalty):
    """Modes from the whole track at once."""
    signal, modes, begin = turn_signal(positions), np.zeros(options.ticks, int), 0
    for end in ruptures.KernelCPD(kernel="linear", min_size=2).fit(signal).predict(pen=penalty):
        modes[begin * stride + width * (begin > 0) :] = mode_of(signal[begin:end])
        begin = end
    return modes


def live(positions, penalty):
    """Mode of the last segment, from the positions so far."""
    signal, modes = turn_signal(positions), np.zeros(options.ticks, int)
    for end in range(4, len(signal) + 1):
        ends = (
            ruptures.KernelCPD(kernel="linear", min_size=2).fit(signal[:end]).predict(pen=penalty)
        )
        modes[(end - 1) * stride + 2 * width :] = mode_of(signal[([0, *ends])[-2] : end])
    return modes


# %%
# The penalty of each form is chosen on other tracks, by the agreement.

true, positions, _ = run(seed=1000)
chosen = {}
for form in (afterwards, live):
    sets = {penalty: [form(one, penalty) for one in positions] for penalty in (1, 2, 3, 5, 10, 20)}
    found = score([times] * tracks, list(true), sets).estimates
    chosen[form] = max(found, key=lambda penalty: found[penalty]["agreement"].value)
print({form.__name__: penalty for form, penalty in chosen.items()})

# %%
# All three on new tracks. Intervals are over tracks, and those of the differences are paired.

true, positions, rule = run(seed=0)
statements = {
    "IMM": list(rule),
    "ruptures, live": [live(one, chosen[live]) for one in positions],
    "ruptures, afterwards": [afterwards(one, chosen[afterwards]) for one in positions],
}
result = score([times] * tracks, list(true), statements, per=60.0)
for name, figures in result.estimates.items():
    print(
        f"{name}:",
        ", ".join(
            f"{key} {one.value:.2f}" for key, one in figures.items() if key != "false_alarms"
        ),
    )
for name, figures in result.differences.items():
    delay = figures["full_delay"]
    print(
        f"{name}: delay {delay.value:+.2f} s [{delay.low:+.2f}, {delay.high:+.2f}] from that of the IMM"
    )

# %%
# Afterwards, ruptures agrees best: it has seen what came next. Live, from the same positions as the rule, it is later and changes more
# often. It is made for whole signals, and the rule is given the model of the tracks.
# ``hybridtrack score truth.csv imm.csv ruptures.csv`` prints the same from files.

figure, (bars, plane) = plt.subplots(
    1, 2, figsize=(10, 3.2), width_ratios=(2, 1), layout="constrained"
)
rows = np.stack([true[0], *(stated[0] for stated in statements.values())])
bars.imshow(
    rows,
    aspect="auto",
    interpolation="nearest",
    extent=(0, times[-1], len(rows) - 0.5, -0.5),
    cmap="Set2",
    vmax=7,
)
bars.set_yticks(range(len(rows)), ["truth", *statements])
bars.set(xlabel="t, s", title="One track: straight green, left orange, right blue")
for name, figures in result.estimates.items():
    x, y = figures["false_changes"], figures["full_delay"]
    plane.errorbar(
        x.value, y.value, [[y.value - y.low], [y.high - y.value]], [[x.value - x.low], [x.high - x.value]],
        marker="o", capsize=3, label=name,
    )  # fmt: skip
plane.set(xlabel="false changes a minute", ylabel="delay of all switches, s", title="On 40 tracks")
plane.set(xlim=(0, None), ylim=(0, None))
plane.grid(alpha=0.25)
plane.legend(frameon=False, fontsize=8)
plt.show()
