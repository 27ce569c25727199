"""
ATE step by step on one track
=============================

The algorithm ATE of Golubkov 2018: at every switch it starts one Kalman filter per hypothesis from its estimate, adds up
the log-likelihood ratios to the mode decided last, and decides when one of them crosses one of Wald's two thresholds.
"""

# %%
# A recording of four segments, simulated with the model of the paper. It is an array of positions; the first tick of
# every segment is known, and so is where the object starts; the modes are not.

import matplotlib.pyplot as plt
import numpy as np

from baselines import sprt_thresholds
from hybrid_env.rendering.evidence import mode_colour, mode_name
from hybrid_env.simulation import simulate
from studies.papers.ate import track_ate

radii = [5.0]  # hypotheses: straight, left turn, right turn
start = (0.0, 0.0, 0.0, 2.0)  # x, vx, y, vy one tick before the first measurement
recording = simulate("S50 L60r5 R75r5 S50", seed=3, start=start)
measurements = recording.measurements[0]
print(measurements.shape, recording.lengths)

# %%
# ATE. The test is Wald's: accept a turn when its ratio exceeds the upper threshold, keep the active mode when all ratios
# are below the lower one.

alpha = 1e-3
tracks = track_ate(recording.measurements, recording.lengths, start, radii=radii, alpha=alpha)
decided, decision_ticks = tracks.decided[0], tracks.ticks[0]
upper, lower = sprt_thresholds(alpha)
begins = np.cumsum(recording.lengths) - recording.lengths
for begin, mode, tick in zip(begins, decided, decision_ticks, strict=True):
    print(f"segment from tick {begin + 1}: {mode_name(mode, radii)}, decided after {tick} ticks")

# %%
# The ratios. In every segment they start from 0 and end at the decision. The ratio of the mode decided last is 0.

figure, axes = plt.subplots(figsize=(9, 3.8), layout="constrained")
ticks = np.arange(1, len(measurements) + 1)
for mode in range(3):
    for k, begin in enumerate(begins):
        part = slice(begin, begin + recording.lengths[k])
        label = mode_name(mode, radii) if k == 0 else None
        axes.plot(
            ticks[part], tracks.ratios[0, part, mode], color=mode_colour(mode, radii), label=label
        )
for threshold in (lower, upper):
    axes.hlines(threshold, 0, len(ticks), color="0.3", linestyle="--", linewidth=1)
axes.text(len(ticks) + 2, upper, "accept", va="center")
axes.text(len(ticks) + 2, lower, "keep", va="center")
for begin in begins:
    axes.axvline(begin + 0.5, color="0.8", linewidth=1, zorder=0)
axes.set(
    xlabel="tick",
    ylabel="log-likelihood ratio",
    ylim=(3 * lower, 2.2 * upper),
    xlim=(0, len(ticks) + 25),
)
axes.legend(frameon=False, ncols=3, loc="upper right")
plt.show()

# %%
# The track. Until a decision the estimate is that of the old mode, so it lags behind after every switch; a cross marks
# the decision.

figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
axes.plot(*measurements.T, ".", color="0.75", markersize=4, label="measurements")
axes.plot(*recording.truth[0][:, [0, 2]].T, color="black", linewidth=1, label="truth")
estimates = tracks.estimates[0][:, [0, 2]]
# Mode of the estimate at every tick: the old one up to the decision.
old = np.concatenate([[0], decided[:-1]])
parts = np.column_stack([decision_ticks, recording.lengths - decision_ticks])
modes = np.repeat(np.column_stack([old, decided]), parts.ravel())
for mode in range(3):
    chosen = np.where((modes == mode)[:, None], estimates, np.nan)
    axes.plot(
        *chosen.T,
        color=mode_colour(mode, radii),
        linewidth=2,
        label=f"estimate, {mode_name(mode, radii)}",
    )
decisions = estimates[begins + decision_ticks - 1]
axes.plot(*decisions.T, "kx", markersize=8, markeredgewidth=2, label="decision")
axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()
