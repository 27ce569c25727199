"""The interface of all filters of kinematic models: B tracks, real time steps, missing
measurements.
"""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from baselines.estimation.motion_models import check_per_item
from hybrid_env.checks import (
    FloatArray,
    OwnState,
    PositiveOrZero,
    check_array,
    check_covariance,
    check_integer,
    checked,
    dimensions,
)


class TrackFilter(OwnState, ABC):
    """A filter for the positions of B tracks in d dimensions.

    A track begins with its first measurement, or for all tracks with `begin_from`. Until then its
    state is NaN. A missing measurement is NaN: that track only predicts.
    """

    # Number of dimensions d.
    axes: int
    # Number of values per axis of the state, m.
    order: int
    # (B, n) estimates, position and derivatives axis by axis, [x, vx, y, vy] for m = 2 and d = 2.
    state: FloatArray
    # (B, n, n) of the state; None if the filter has none.
    covariance: FloatArray | None
    # (B,) of the last measurement given those before; 0 without a measurement and for the one that
    # begins a track; NaN if the filter has no likelihood.
    log_likelihood: FloatArray
    # (B,) normalized innovation squared, chi-square with d degrees of freedom if the model holds;
    # NaN.
    nis: FloatArray

    @property
    def tracks(self) -> int:
        """Number of tracks B."""
        return len(self.state)

    @property
    def position(self) -> FloatArray:
        """(B, d) estimated positions [m]."""
        return self.state[:, :: self.order]

    @property
    def velocity(self) -> FloatArray:
        """(B, d) estimated velocities [m/s]."""
        return self.state[:, 1 :: self.order]

    def begin(self, tracks: int) -> None:
        """Forget everything; `tracks` tracks begin with their first measurements."""
        self._begin(check_integer("tracks", tracks))

    def begin_from(self, state: ArrayLike, covariance: ArrayLike | None = None) -> None:
        """Forget everything and begin all tracks with estimates (B, n), and their covariances
        (n, n) or (B, n, n).
        """
        size = self.axes * self.order
        means = check_array("state", state, (None, size))
        matrices = None
        if covariance is not None:
            shape = (size, size) if dimensions(covariance) == 2 else (len(means), size, size)
            each = check_covariance(
                "covariance",
                check_array("covariance", covariance, shape),
                definite=False,
            )
            matrices = np.broadcast_to(each, (len(means), size, size)).copy()
        self._begin(len(means))
        self._set(means, matrices)

    def predict(self, dt: float | ArrayLike) -> None:
        """Advance by a time step [s], >= 0, one number or (B,)."""
        if dimensions(dt) == 0:
            self._predict(checked("dt", dt, PositiveOrZero))
        else:
            self._predict(check_per_item("dt", dt, self.tracks))

    def update(self, measurement: ArrayLike, noise: ArrayLike | None = None) -> None:
        """Correct by the measurements of one moment, (B, d) positions [m], NaN where there is none.

        `noise` is their covariance in the place of that of the filter [m^2]: a number, (d,), (d, d)
        or (B, d, d).
        """
        values = check_measurements("measurement", measurement, (self.tracks, self.axes))
        covariance = (
            None
            if noise is None
            else measurement_covariance("noise", noise, self.axes, self.tracks)
        )
        self._update(values, covariance)

    def _no_measurement(self) -> None:
        """Set what belongs to a measurement as without one."""
        self.log_likelihood, self.nis = np.zeros(self.tracks), np.full(self.tracks, np.nan)

    @abstractmethod
    def _begin(self, tracks: int) -> None: ...

    @abstractmethod
    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None: ...

    @abstractmethod
    def _predict(self, dt: float | FloatArray) -> None: ...

    @abstractmethod
    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None: ...


def check_measurements(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> FloatArray:
    """Return a copy as a float64 array; a point with a NaN is missing, with NaN in all its
    components.
    """
    values = check_array(name, value, shape, missing=True)
    values[np.isnan(values).any(-1)] = np.nan
    return values


def measurement_covariance(
    name: str,
    value: ArrayLike,
    axes: int,
    tracks: int | None = None,
) -> FloatArray:
    """Return the covariance of a measurement, (d, d) or (B, d, d), of a variance of all axes
    [m^2], (d,), or itself.
    """
    ndim = dimensions(value)
    if ndim < 2:
        return check_covariance(name, np.diag(check_per_item(name, value, axes)))
    return check_covariance(
        name,
        check_array(name, value, (axes, axes) if ndim == 2 else (tracks, axes, axes)),
    )
