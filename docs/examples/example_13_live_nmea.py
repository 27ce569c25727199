"""
Live: sentences of NMEA 0183
============================

A GPS receiver sends sentences, and `pynmea2 <https://github.com/Knio/pynmea2>`_ reads them. Nothing was recorded before: the tracker
is told the model in metres and seconds. What you learn: which options describe a sensor and its object, and what to do with seconds
without a fix. ``pip install pynmea2``
"""

# %%
# The receiver stands on a boat that moves at 8 m/s and turns with a radius of 60 m. Every second it sends the sentence RMC, with date,
# time and place, and GGA, with the quality of the fix. Below a bridge it has no fix for ten seconds.

from datetime import UTC, datetime, timedelta

import matplotlib.pyplot as plt
import numpy as np
import pynmea2
from pyproj import Proj

from baselines import OnlineTracker, ThresholdDecider
from baselines.recordings.projection import Projection
from hybrid_env import QuickestOptions
from hybrid_env.rendering.evidence import mode_colour
from hybrid_env.simulation import simulate

route = "S60 L25r60 S50 R40r60 S45 L30r60 R30r60 S60"
trip = simulate(
    route, seed=1, tau=1.0, start=(0, 8, 0, 0), measurement_variance=1.0, process_variance=0.01
)
river = Proj(proj="aeqd", lat_0=52.0, lon_0=4.3)


def sentences(second, x, y):
    """RMC and GGA of one second."""
    longitude, latitude = river(x, y, inverse=True)
    moment = datetime(2026, 5, 1, 10, 15, tzinfo=UTC) + timedelta(seconds=second)
    time, fix = f"{moment:%H%M%S}.00", not 130 <= second < 140
    # NMEA has degrees and minutes in one number.
    place = tuple(
        text
        for degrees, width, side in ((latitude, 8, "N"), (longitude, 9, "E"))
        for text in (f"{100 * int(degrees) + degrees % 1 * 60:0{width + 2}.5f}", side)
    )
    place = place if fix else ("", "", "", "")
    rmc = (time, "AV"[not fix], *place, "", "", f"{moment:%d%m%y}", "", "")
    gga = (time, *place, str(int(fix)), "08", "0.9", "", "M", "", "M", "", "")
    return str(pynmea2.RMC("GP", "RMC", rmc)), str(pynmea2.GGA("GP", "GGA", gga))


points = trip.measurements[0].tolist()
stream = [line for second, point in enumerate(points) for line in sentences(second, *point)]
print(*stream[:4], sep="\n")

# %%
# The model has the units of the sensor: a tick of 1 s, a standard deviation of 1 m, modes that last 40 ticks on average. Its plane is
# centred near the boat.

options = QuickestOptions(
    radii=(60.0,),
    tau=1.0,
    speed=8.0,
    measurement_variance=1.0,
    process_variance=0.01,
    durations="geometric 40",
)
tracker = OnlineTracker(options, ThresholdDecider(0.8), projection=Projection(52.0, 4.3))

# %%
# RMC alone says all that is needed. A sentence without a fix is a measurement that is missing, and the tracker predicts. A receiver that
# sends GGA only has ``timestamp``, the time of day, and ``gps_qual``, which is 0 without a fix.

mode, updates = None, []
for line in stream:
    message = pynmea2.parse(line)
    if message.sentence_type == "RMC":
        place = (message.latitude, message.longitude) if message.is_valid else None
        now = tracker.update(place, message.datetime)
        updates.append(now)
        if now.decided and now.mode != mode:
            mode = now.mode
            where = "{:.5f}, {:.5f}".format(*now.position)
            print(f"{message.datetime:%H:%M:%S} {tracker.mode_names[mode]} at {where}")

# %%
# From the first decision on, straight is orange, left blue and right green; crosses are predicted.

shown = [now for now in updates if now.decided]
latitudes, longitudes = np.transpose([now.position for now in shown])
colours = np.array([mode_colour(now.mode, options.radii) for now in shown])
missing = np.array([now.status == "missing" for now in shown])
figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
for part, marker in ((~missing, "o"), (missing, "x")):
    axes.scatter(longitudes[part], latitudes[part], c=colours[part], s=12, marker=marker)
axes.set(xlabel="longitude", ylabel="latitude", aspect=1 / np.cos(np.radians(52.0)))
axes.ticklabel_format(useOffset=False)
plt.show()
