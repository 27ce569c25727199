"""A filter over the recorded positions of many tracks, and what filters and smoothers return."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import FloatArray
from studies.filters.track_filter import TrackFilter


@dataclass(frozen=True)
class Estimates:
    """Estimates for T ticks of B tracks in d dimensions."""

    # (T, B, n) estimates after the measurement of each tick, NaN before a track begins.
    states: FloatArray
    # (T, B, n, n) of the estimates; None if the filter has none.
    covariances: FloatArray | None
    # Number of values per axis of a state, m.
    order: int

    @property
    def positions(self) -> FloatArray:
        """(T, B, d) [m]."""
        return self.states[..., :: self.order]

    @property
    def velocities(self) -> FloatArray:
        """(T, B, d) [m/s]."""
        return self.states[..., 1 :: self.order]


def run_filter(
    track_filter: TrackFilter,
    measurements: FloatArray,
    times: ArrayLike,
    *,
    noises: FloatArray | None = None,
    begun: float | None = None,
) -> Estimates:
    """Run a filter over recorded positions.

    Args:
        track_filter: any filter.
        measurements: (T, B, d) positions [m], NaN where there is none.
        times: (T,) or (T, B) [s], not decreasing. The same time twice has measurements of two
            sensors.
        noises: covariances of the measurements [m^2] in the place of that of the filter, (T, d, d)
            or (T, B, d, d).
        begun: time of the present estimates of the filter [s], see `KalmanFilter.begin_from`; None
            begins each track with its first measurement.
    """
    moments = np.asarray(times, float)
    if begun is None:
        track_filter.begin(measurements.shape[1])
    first = moments[:1] if begun is None else np.full_like(moments[:1], begun)
    steps = np.diff(moments, axis=0, prepend=first)
    states = []
    covariances = []
    for k, step in enumerate(steps):
        track_filter.predict(step)
        track_filter.update(measurements[k], None if noises is None else noises[k])
        states.append(track_filter.state.copy())
        if track_filter.covariance is not None:
            covariances.append(track_filter.covariance.copy())
    spreads = np.stack(covariances) if covariances else None
    return Estimates(np.stack(states), spreads, track_filter.order)
