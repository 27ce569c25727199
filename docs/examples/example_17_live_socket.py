"""
Live: JSON from a socket or an MQTT broker
==========================================

A robot sends its positions as JSON, a line each. On the way some are lost, some come twice and some come late. What you learn: what
the tracker does with each of them, and how it forecasts where the robot will be.
"""

# %%
# The robot moves at 2 m/s and turns with a radius of 5 m. It sends a position every tenth of a second. Of 100 lines 10 are lost, 5
# come twice and 5 come three lines too late.

import collections
import json
import socket

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Ellipse

from agents import track_recording
from baselines import OnlineTracker
from hybrid_env.rendering.evidence import mode_colour
from hybrid_env.simulation import simulate

route = "S70 L60r5 S50 R75r5 S40 L60r5 S60 R50r5 L70r5 S60 R40r5"
walk = simulate(route, seed=4, measurement_variance=0.02).measurements[0]
rng, order = np.random.default_rng(0), []
for k in range(len(walk)):
    fate = rng.choice(["", "lost", "twice", "late"], p=[0.8, 0.1, 0.05, 0.05])
    order += {"": [(k, k)], "lost": [], "twice": [(k, k), (k, k)], "late": [(k + 3.5, k)]}[fate]
lines = [
    json.dumps({"t": round(0.1 * k, 3), "x": walk[k, 0], "y": walk[k, 1]}) for _, k in sorted(order)
]
robot, receiver = socket.socketpair()
robot.sendall("".join(f"{line}\n" for line in lines).encode())
robot.close()

# %%
# The first 300 lines show the model. ``track_recording`` reads increasing times, so that each time is taken once.

stream = receiver.makefile()
first = [json.loads(next(stream)) for _ in range(300)]
rows = sorted({(row["t"], row["x"], row["y"]) for row in first})
times, *positions = np.transpose(rows)
recorded = track_recording(times, np.transpose(positions))
print(
    f"radii {recorded.model.radii}, standard deviation {recorded.model.measurement_variance**0.5:.2f}"
)

# %%
# The rest arrives line by line. ``now.status`` says what became of a measurement: a repeated one changes nothing, and a late one is put in
# its place and the later ones are filtered again.

tracker = OnlineTracker.from_recording(recorded)
modes, updates = [], []


def receive(line):
    """Track a message."""
    message = json.loads(line)
    now = tracker.update((message["x"], message["y"]), message["t"])
    updates.append(now)
    if now.decided and modes[-1:] != [now.mode]:
        modes.append(now.mode)
        where = "{:.1f}, {:.1f} m".format(*now.position)
        print(f"{message['t']:.1f} s: {tracker.mode_names[now.mode]} at {where}")


for line in stream:
    receive(line)
print(collections.Counter(now.status for now in updates))

# %%
# With an MQTT broker the loop is that of `paho-mqtt <https://eclipse.dev/paho/>`_:
#
# .. code-block:: python
#
#     from paho.mqtt import subscribe
#
#     subscribe.callback(
#         lambda client, data, message: receive(message.payload), "robot/position", hostname="broker"
#     )
#
# From the first decision on, straight is orange, left blue and right green. The ellipses hold the robot 1, 2 and 5 s after the last line with
# a probability of 95 %, if it keeps its mode.

shown = [now for now in updates if now.decided]
x, y = np.transpose([now.position for now in shown])
colours = [mode_colour(now.mode, tracker.options.all_modes) for now in shown]
figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
axes.scatter(x, y, c=colours, s=8)
for mean, covariance in zip(*tracker.forecast((1.0, 2.0, 5.0)), strict=True):
    lengths, directions = np.linalg.eigh(covariance)
    # The 95 % quantile of the chi-squared law of two degrees of freedom is 5.99.
    width, height = 2.0 * np.sqrt(5.99 * lengths)
    angle = np.degrees(np.arctan2(directions[1, 0], directions[0, 0]))
    axes.add_patch(Ellipse(mean, width, height, angle=angle, fill=False, color="0.4"))
    axes.plot(*mean, "k+")
axes.set(xlabel="x, m", ylabel="y, m", aspect="equal")
plt.show()
