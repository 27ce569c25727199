"""
A recording of your own
=======================

Positions in a file, with or without known moments at which the mode may switch. On the command line the two parts are
``hybridtrack track flight.csv --lengths 70 60 40 75 60 --radii 5`` and ``hybridtrack track flight.csv``.
"""

# %%
# The file has the columns ``t, x, y``. Here it is simulated; put your own in its place.

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from agents import track_recording
from hybrid_env.rendering.evidence import mode_colour, mode_name
from hybrid_env.simulation import simulate

radii, variance, tau = (5.0,), 0.05, 0.1
flight = simulate("S70 L60r5 S40 R75r5 L60r5", seed=0, measurement_variance=variance)
file = Path(tempfile.mkdtemp()) / "flight.csv"
times = tau * np.arange(1, len(flight.measurements[0]) + 1)
np.savetxt(
    file,
    np.column_stack([times, flight.measurements[0]]),
    delimiter=",",
    header="t,x,y",
    comments="",
    fmt="%.4f",
)

rows = np.loadtxt(file, delimiter=",", skiprows=1)
times, measurements = rows[:, 0], rows[:, 1:]

# %%
# **Known moments.** A route is divided into pieces of known lengths, and the object flies turns of 5 m. The noise is estimated.

known = track_recording(times, measurements, lengths=(70, 60, 40, 75, 60), radii=radii)
names = np.array(known.mode_names())
print("decided:", names[known.pieces[:, 2]])

# %%
# **Nothing known.** Moments, radii and noise are all found from the positions.

unknown = track_recording(times, measurements)
print("radii", unknown.model.radii, "noise variance", unknown.model.measurement_variance)
print("warnings:", unknown.warnings or "none")

# %%
# Both over time; the true modes are known here, because the recording is simulated. The probabilities are those of the second.

true = np.repeat([0, 1, 0, 2, 1], flight.lengths)
figure, (top, bottom) = plt.subplots(
    2, 1, figsize=(9, 5), layout="constrained", sharex=True, height_ratios=(1, 1.5)
)
for row, modes in enumerate((true, known.modes, unknown.modes)):
    for mode in range(3):
        left = times[modes == mode] - tau
        top.barh(
            row, np.full(left.size, tau), left=left, color=mode_colour(mode, radii), linewidth=0
        )
top.set_yticks(range(3), ["truth", "known moments", "nothing known"])
top.invert_yaxis()
top.set_title("Modes")
for mode in range(3):
    bottom.plot(
        times,
        unknown.probabilities[:, mode],
        color=mode_colour(mode, radii),
        label=mode_name(mode, radii),
    )
bottom.set(
    xlabel="time, s",
    ylabel="probability",
    title="Probabilities, nothing known",
    xlim=(0, times[-1]),
)
bottom.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()

# %%
# The estimates.

figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
axes.plot(*measurements.T, ".", color="0.75", markersize=4, label="measurements")
axes.plot(*known.estimates[:, [0, 2]].T, label="known moments", linewidth=1.5)
axes.plot(*unknown.estimates[:, [0, 2]].T, label="nothing known", linewidth=1.5)
axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
axes.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
plt.show()
