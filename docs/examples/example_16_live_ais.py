"""
Live: AIS messages of several ships
===================================

Ships report their positions by AIS, and `pyais <https://github.com/M0r13n/pyais>`_ decodes the messages. Each ship has a tracker of
its own, with the model that an earlier hour shows. What you learn: how one stream is divided among trackers, and that reports may
come at any intervals. ``pip install pyais``
"""

# %%
# The receiver: a ferry at 9 m/s that turns with 400 m, and a tanker at 7 m/s that turns with 900 m. A ship reports every 2 to 10 s, and
# some reports are lost. Each line has the time of reception and a message.

import csv
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyais
from pyproj import Proj

from agents.commands.track import Track
from baselines import OnlineTracker
from hybrid_env.rendering.evidence import mode_colour
from hybrid_env.simulation import simulate

ships = {
    244000001: ("S500 L100r400 S350 R120r400 S450 L90r400 S300 R110r400", (0, 9, 0, 0)),
    244000002: ("S600 R300r900 S700 L350r900 S500 R280r900", (500, 0, -3000, 7)),
}
harbour, rng, stream = Proj(proj="aeqd", lat_0=53.4, lon_0=6.0), np.random.default_rng(0), []
begin = datetime(2026, 5, 1, 10, tzinfo=UTC).timestamp()
for mmsi, (route, start) in ships.items():
    # Twice the route, at seconds.
    trip = simulate(f"{route} {route}", seed=mmsi, tau=1.0, start=start, measurement_variance=25.0)
    seconds = np.cumsum(rng.integers(2, 11, 800))
    for second in seconds[seconds < len(trip.measurements[0])]:
        longitude, latitude = harbour(*trip.measurements[0, second], inverse=True)
        report = {"type": 1, "mmsi": mmsi, "lat": latitude, "lon": longitude, "second": second % 60}
        if rng.random() > 0.1:
            stream.append(
                (begin + float(second), pyais.encode_dict(report, sentence_type="VDM")[0])
            )
stream.sort()
print(*stream[:3], sep="\n")

# %%
# A file of the first half. ``hybridtrack track first.csv`` tells the ships apart by the column ``mmsi``, and each has a folder of its
# own, with its radii and its noise in ``track.json``.


def position(message):
    """Position in a message, or None: other messages have none, and 91 and 181 degrees mean that it is not known."""
    known = message.msg_type in (1, 2, 3, 18) and abs(message.lat) <= 90 and abs(message.lon) <= 180
    return (message.lat, message.lon) if known else None


folder = Path(tempfile.mkdtemp())
half = len(stream) // 2
with (folder / "first.csv").open("w", newline="") as file:
    rows = csv.writer(file)
    rows.writerow(["time", "mmsi", "lat", "lon"])
    for time, line in stream[:half]:
        message = pyais.decode(line)
        rows.writerow([time, message.mmsi, *position(message)])
Track(files=(folder / "first.csv",)).run()

# %%
# The second half arrives message by message.

trackers = {
    mmsi: OnlineTracker.from_recording(folder / f"first_track/{mmsi}/track.json") for mmsi in ships
}
modes, updates = {}, {mmsi: [] for mmsi in ships}
for time, line in stream[half:]:
    message = pyais.decode(line)
    ship, place = message.mmsi, position(message)
    if ship not in trackers or place is None:
        continue
    now = trackers[ship].update(place, time)
    updates[ship].append(now)
    if now.decided and now.mode != modes.get(ship):
        modes[ship] = now.mode
        name = trackers[ship].mode_names[now.mode]
        moment = datetime.fromtimestamp(time, UTC)
        where = "{:.5f}, {:.5f}".format(*now.position)
        print(f"{moment:%H:%M:%S} {ship} {name} at {where}")

# %%
# From the first decision on, straight is orange, left blue and right green.

figure, axes = plt.subplots(figsize=(7, 6), layout="constrained")
for ship, tracker in trackers.items():
    shown = [now for now in updates[ship] if now.decided]
    latitudes, longitudes = np.transpose([now.position for now in shown])
    colours = [mode_colour(now.mode, tracker.options.all_modes) for now in shown]
    axes.scatter(longitudes, latitudes, c=colours, s=8)
    axes.annotate(f" {ship}", (longitudes[0], latitudes[0]))
axes.set(xlabel="longitude", ylabel="latitude", aspect=1 / np.cos(np.radians(53.4)))
axes.ticklabel_format(useOffset=False)
plt.show()
