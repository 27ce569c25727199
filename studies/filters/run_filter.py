"""A filter over the recorded positions of many tracks, and what filters and smoothers return."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from studies.arrays import FloatArray
from studies.filters.track_filter import TrackFilter


@dataclass(frozen=True)
class Estimates:
    """Estimates for T ticks of B tracks in d dimensions."""

    # (T, B, n) estimates after the measurement of each tick, NaN before a track begins.
    states: FloatArray
    # (T, B, n, n) of the estimates; None if there are none or they were not kept.
    covariances: FloatArray | None
    # Number of values per axis of a state, m.
    order: int
    # Estimates of the state some time ahead, see `horizons` of `run_filter`.
    forecasts: tuple["Estimates", ...] = ()

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
    keep_covariances: bool = True,
    horizons: Sequence[float] = (),
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
        keep_covariances: False leaves the covariances out, which take the most memory.
        horizons: times ahead of each tick for which the state is forecast [s].
    """
    tracks = measurements.shape[1]
    moments = np.asarray(times, float)
    if begun is None:
        track_filter.begin(tracks)
    first = moments[:1] if begun is None else np.full_like(moments[:1], begun)
    steps = np.diff(moments, axis=0, prepend=first)
    kept = keep_covariances and track_filter.covariance is not None
    written: list[list[Any]] = [[] for _ in range(1 + len(horizons))]
    for k, step in enumerate(steps):
        track_filter.predict(step)
        track_filter.update(measurements[k], None if noises is None else noises[k])
        later = [copy.deepcopy(track_filter) for _ in horizons]
        for horizon, forecast in zip(horizons, later, strict=True):
            forecast.predict(horizon)
        for rows, each in zip(written, (track_filter, *later), strict=True):
            covariance = np.array(each.covariance) if kept else np.empty(tracks)
            rows.append((each.state.copy(), covariance))
    results = []
    for rows in written:
        states, covariances = (np.stack(column) for column in zip(*rows, strict=True))
        results.append(Estimates(states, covariances if kept else None, track_filter.order))
    return replace(results[0], forecasts=tuple(results[1:]))
