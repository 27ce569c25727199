"""
Interception of a predicted point
=================================

An interceptor flies at a target that turns. Where should it aim? What you learn: a forecast of the live tracker gives the point at
which both arrive together, and the doubt about the mode is in its covariance.
"""

# %%
# The target moves at 2 m/s and is measured ten times a second. The interceptor is slower, and starts 20 m away.

import matplotlib.pyplot as plt
import numpy as np

from baselines import OnlineTracker, ThresholdDecider
from hybrid_env import QuickestOptions
from hybrid_env.simulation import simulate

run = simulate("S60 L60r5 S50 R70r5 S60", seed=2, tau=0.1, measurement_variance=0.01)
options = QuickestOptions(radii=(5.0,), measurement_variance=0.01)
speed, ahead = 1.5, np.linspace(0.0, 15.0, 151)


def meeting_point(tracker, place):
    """The first forecast that the interceptor reaches in time, and its covariance."""
    means, covariances = tracker.forecast(ahead)
    late = np.linalg.norm(means - place, axis=1) > speed * ahead
    k = int(np.argmin(late)) if not late.all() else -1
    return means[k], covariances[k]


# %%
# At each measurement the interceptor aims anew: at the forecast, or in pursuit at the last measured position.


def intercept(aims):
    """The path of the interceptor, and the aim with its deviation, up to half a metre from the target."""
    tracker = OnlineTracker(options, ThresholdDecider(0.8))
    path, told = [np.array([10.0, 20.0])], []
    for measured, truth in zip(run.measurements[0], run.truth[0], strict=True):
        tracker.update(measured)
        point, covariance = aims(tracker, path[-1], measured)
        told.append((*point, np.sqrt(np.trace(covariance))))
        way = point - path[-1]
        if np.isfinite(way).all():
            path.append(path[-1] + 0.1 * speed * way / max(np.linalg.norm(way), 0.1 * speed))
        if np.linalg.norm(path[-1] - truth[::2]) < 0.5:
            break
    return np.array(path), np.array(told)


ways = {
    "forecast": intercept(lambda tracker, place, _: meeting_point(tracker, place)),
    "pursuit": intercept(lambda _, __, measured: (measured, np.zeros((2, 2)))),
}
for name, (path, _) in ways.items():
    print(f"{name}: {0.1 * len(path):.1f} s, {0.1 * speed * len(path):.0f} m")

# %%
# The aim moves when the mode changes; a circle is one standard deviation of the forecast.

figure, axes = plt.subplots(figsize=(7, 5), layout="constrained")
axes.plot(*run.truth[0, :, ::2].T, color="grey", label="target")
for name, (path, _) in ways.items():
    axes.plot(*path.T, label=name)
for x, y, deviation in ways["forecast"][1][5::15]:
    axes.add_artist(plt.Circle((x, y), deviation, fill=False, alpha=0.4))
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
axes.legend()
plt.show()
