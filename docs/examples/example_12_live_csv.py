"""
Live: lines of CSV
==================

A logger writes a line for every fix: an ISO time, a latitude and a longitude. The first minutes are tracked as a file, and a live
tracker goes on with the model that the file shows. What you learn: how the results of ``hybridtrack track`` begin a live tracker,
and that times need not be exact.
"""

# %%
# The logger. A simulated car drives at 20 m/s, straight and in turns of 200 m. The fixes come about once a second, up to a fifth of
# a second too early or too late, and their error has a standard deviation of 2 m.

import tempfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from pyproj import Proj

from agents.commands.track import Track
from baselines import OnlineTracker
from hybrid_env.rendering.evidence import mode_colour
from hybrid_env.simulation import simulate

route = "S450 L200r200 S350 R250r200 S300 L150r200 S400 R200r200 S350 L250r200 S400"
drive = simulate(
    route, seed=3, start=(0, 20, 0, 0), measurement_variance=4.0, process_variance=1e-3
)
rng, count = np.random.default_rng(0), len(drive.measurements[0]) // 10
ticks = 10 * np.arange(count) + rng.integers(3, 8, count)
map_of_the_car = Proj(proj="aeqd", lat_0=52.0, lon_0=4.3)
longitudes, latitudes = map_of_the_car(*drive.measurements[0, ticks].T, inverse=True)
begin = datetime(2026, 5, 1, 10, 15, tzinfo=UTC)
lines = [
    f"{(begin + timedelta(seconds=tick / 10)).isoformat()},{latitude:.7f},{longitude:.7f}\n"
    for tick, latitude, longitude in zip(ticks.tolist(), latitudes, longitudes, strict=True)
]
print(*lines[:3], sep="")

# %%
# The first 170 s are recorded. In a shell the command is ``hybridtrack track first.csv``; its ``track.json`` holds noise, radii, tick and the
# centre of the projection.

folder = Path(tempfile.mkdtemp())
(folder / "first.csv").write_text("time,lat,lon\n" + "".join(lines[:170]))
Track(files=(folder / "first.csv",)).run()

# %%
# The rest arrives line by line. ``stream`` may be ``sys.stdin``, a serial port or an open file. Latitude and longitude go in and
# come out; a line is printed when the mode changes.

stream, mode, updates = lines[170:], None, []
tracker = OnlineTracker.from_recording(folder / "first_track/track.json")
for line in stream:
    time, latitude, longitude = line.split(",")
    moment = datetime.fromisoformat(time)
    now = tracker.update((float(latitude), float(longitude)), moment)
    updates.append(now)
    if now.decided and now.mode != mode:
        mode = now.mode
        place = "{:.5f}, {:.5f}".format(*now.position)
        print(f"{moment:%H:%M:%S} {tracker.mode_names[mode]} at {place}")

# %%
# From the first decision on, straight is orange, left blue and right green.

shown = [now for now in updates if now.decided]
latitudes, longitudes = np.transpose([now.position for now in shown])
colours = [mode_colour(now.mode, tracker.options.all_modes) for now in shown]
figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
axes.scatter(longitudes, latitudes, c=colours, s=8)
axes.set(xlabel="longitude", ylabel="latitude", aspect=1 / np.cos(np.radians(latitudes[0])))
axes.ticklabel_format(useOffset=False)
plt.show()
