"""A filter over the recorded positions of many tracks, and what filters and smoothers return."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.track_filter import (
    TrackFilter,
    check_measurements,
    measurement_covariance,
)
from hybrid_env.checks import (
    LARGEST_NUMBER,
    ArgumentError,
    FloatArray,
    check_array,
    check_number,
    dimensions,
    reject,
)


@dataclass(frozen=True)
class Estimates:
    """Estimates for T ticks of B tracks in d dimensions. A single track has no axis B."""

    # (T, B, n) estimates at each tick, NaN before a track begins.
    states: FloatArray
    # (T, B, n, n) of the estimates; None if there are none or they were not kept.
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

    def write(self, k: int, track_filter: TrackFilter) -> None:
        """Write the present estimates of a filter at tick k."""
        self.states[k] = track_filter.state
        if self.covariances is not None:
            self.covariances[k] = track_filter.covariance

    def of_one(self) -> "Estimates":
        """Return the estimates of a single track, without the axis B."""
        covariances = None if self.covariances is None else self.covariances[:, 0]
        return Estimates(self.states[:, 0], covariances, self.order)


@dataclass(frozen=True)
class Filtered(Estimates):
    """Output of a filter: estimates after the measurement of each tick, and how well each
    measurement fits.
    """

    # (T, B), see `TrackFilter.log_likelihood`
    log_likelihoods: FloatArray
    # (T, B), see `TrackFilter.nis`
    nis: FloatArray
    # Estimates of the state some time ahead, see `horizons` of `run_filter`.
    forecasts: tuple[Estimates, ...] = ()


def run_filter(
    track_filter: TrackFilter,
    measurements: ArrayLike,
    times: ArrayLike,
    *,
    noises: ArrayLike | None = None,
    start: tuple[ArrayLike, ArrayLike, float] | None = None,
    keep_covariances: bool = True,
    horizons: Sequence[float] = (),
) -> Filtered:
    """Run a filter over recorded positions.

    Args:
        track_filter: any filter; it begins anew.
        measurements: (T, B, d) positions [m], NaN where there is none, or (T, d) of a single track.
        times: (T,) or (T, B) [s], not decreasing. The same time twice has measurements of two
            sensors.
        noises: covariances of the measurements [m^2] in the place of that of the filter, (T, d, d)
            or (T, B, d, d).
        start: estimates (B, n), or (n,) of a single track, covariances (n, n) or (B, n, n), and
            their time [s]; None begins each track with its first measurement.
        keep_covariances: False leaves the covariances out, which take the most memory.
        horizons: times ahead of each tick for which the state is forecast [s].
    """
    single = dimensions(measurements) == 2
    axes = track_filter.axes
    shape: tuple[int | None, ...] = (None, axes) if single else (None, None, axes)
    values = check_measurements("measurements", measurements, shape)
    values = values[:, None] if single else values
    total, tracks = values.shape[:2]
    moments = check_times(times, total, tracks)
    covariances = None
    if noises is not None:
        each = (total, axes, axes) if dimensions(noises) == 3 else (total, tracks, axes, axes)
        flat = check_array("noises", noises, each).reshape(-1, axes, axes)
        covariances = measurement_covariance("noises", flat, axes).reshape(each)
    if start is None:
        track_filter.begin(tracks)
        first = moments[0]
    else:
        means, covariance, begun = start
        track_filter.begin_from(np.atleast_2d(means), covariance)
        allowed = "a time not after the first measurement"
        last = float(moments[0].min())
        first = np.full(
            moments.shape[1:],
            check_number("start time", begun, allowed, -LARGEST_NUMBER, last),
        )
        if track_filter.tracks != tracks:
            raise reject("start estimates", track_filter.tracks, f"{tracks}, one for each track")
    size = track_filter.state.shape[1]
    kept = keep_covariances and track_filter.covariance is not None
    present, *ahead = (
        Estimates(
            np.empty((total, tracks, size)),
            np.empty((total, tracks, size, size)) if kept else None,
            track_filter.order,
        )
        for _ in range(1 + len(horizons))
    )
    log_likelihoods = np.empty((total, tracks))
    nis = np.empty((total, tracks))
    for k, step in enumerate(np.diff(moments, axis=0, prepend=first[None])):
        # One product of matrices for all tracks.
        equal = step.ndim == 0 or (step == step[0]).all()
        track_filter._predict(float(step.flat[0]) if equal else step)
        track_filter._update(values[k], None if covariances is None else covariances[k])
        log_likelihoods[k] = track_filter.log_likelihood
        nis[k] = track_filter.nis
        present.write(k, track_filter)
        for horizon, forecast in zip(horizons, ahead, strict=True):
            later = copy.deepcopy(track_filter)
            later.predict(horizon)
            forecast.write(k, later)
    if single:
        present = present.of_one()
        ahead = [forecast.of_one() for forecast in ahead]
        log_likelihoods = log_likelihoods[:, 0]
        nis = nis[:, 0]
    return Filtered(
        **vars(present), log_likelihoods=log_likelihoods, nis=nis, forecasts=tuple(ahead)
    )


def check_times(times: ArrayLike, total: int, tracks: int) -> FloatArray:
    """Return checked times that do not decrease, (T,) or (T, B)."""
    moments = check_array("times", times, (total,) if dimensions(times) == 1 else (total, tracks))
    wrong = np.argwhere(np.diff(moments, axis=0) < 0.0)
    if wrong.size:
        place = wrong[0, 0] + 1
        raise ArgumentError(f"times[{place}] is not allowed: expected times that do not decrease")
    return moments
