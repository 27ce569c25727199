"""The interface of all filters of kinematic models: B tracks, real time steps, missing
measurements.
"""

from abc import ABC, abstractmethod

from studies.arrays import FloatArray

# Means and covariances.
Moments = tuple[FloatArray, FloatArray]


class TrackFilter(ABC):
    """A filter for the positions of B tracks in d dimensions.

    A track begins with its first measurement. Until then its state is NaN.
    """

    # Number of dimensions d.
    axes: int
    # Number of values per axis of the state, m.
    order: int
    # (B, n) estimates, position and derivatives axis by axis, [x, vx, y, vy] for m = 2 and d = 2.
    state: FloatArray
    # (B, n, n) of the state; None if the filter has none.
    covariance: FloatArray | None

    @property
    def tracks(self) -> int:
        """Number of tracks B."""
        return len(self.state)

    @property
    def position(self) -> FloatArray:
        """(B, d) estimated positions [m]."""
        return self.state[:, :: self.order]

    @abstractmethod
    def begin(self, tracks: int) -> None:
        """Forget everything; `tracks` tracks begin with their first measurements."""

    @abstractmethod
    def predict(self, dt: float | FloatArray) -> None:
        """Advance by a time step [s], >= 0, one number or (B,)."""

    @abstractmethod
    def update(self, measurement: FloatArray, noise: FloatArray | None = None) -> None:
        """Correct by the measurements of one moment, (B, d) positions [m]; a track whose
        measurement has a NaN only predicts.

        `noise` is their covariance in the place of that of the filter, (d, d) or (B, d, d) [m^2].
        """
