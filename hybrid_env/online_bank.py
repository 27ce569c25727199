"""The published bank of one track as an object, for notebooks and for one's own loops."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import check_array, check_positive, check_radii, noise_axes
from hybrid_env.core.compilation import compiled
from hybrid_env.core.published_bank import (
    FilterModel,
    FloatArray,
    PublishedBank,
    begin_published,
    published_arrays,
    step_published,
)
from hybrid_env.core.records import LANES


@compiled
def _begin_one(
    bank: PublishedBank,
    anchor: FloatArray,
    covariance: FloatArray,
    radii: FloatArray,
    model: FilterModel,
) -> None:
    x, vx, y, vy = anchor
    xx, xv, vv = covariance
    begin_published(bank, 0, (x, vx, y, vy), (xx, xv, 0.0, 0.0, vv, 0.0, 0.0, xx, xv, vv), radii, model)


@compiled
def _step_one(bank: PublishedBank, measurement: FloatArray, model: FilterModel) -> None:
    step_published(bank, 0, 1, measurement, model)


class KalmanBank:
    """The bank of one track.

    >>> bank = KalmanBank(radii=[5.0], measurement_variance=0.1)
    >>> bank.anchor([0.0, 2.0, 0.0, 0.0])
    >>> bank.step([0.21, -0.03]).shape
    (3,)
    """

    def __init__(
        self,
        radii: ArrayLike = (5.0,),
        tau: float = 0.1,
        process_variance: float = 0.001,
        measurement_variance: float | ArrayLike = 0.1,
    ):
        self.radii = check_radii("radii", radii)
        self.tau = check_positive("tau", tau)
        self.process_variance = check_positive("process_variance", process_variance, allow_zero=True)
        self.variances = noise_axes(measurement_variance)
        self._bank = published_arrays(self.radii.size, self.variances.size)
        self._model = FilterModel(
            self.tau, self.process_variance, float(self.variances[0]), float(self.variances[-1])
        )
        self._measurement = np.zeros((2, LANES))
        self._anchored = False

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M = 2n + 1."""
        return 2 * self.radii.size + 1

    def anchor(self, state: ArrayLike, covariance: ArrayLike = (1.0, 0.0, 1.0)) -> None:
        """Start a segment at an estimate.

        Args:
            state: (4,) [x, vx, y, vy] [m, m/s].
            covariance: (3,) of (position, velocity), the same on both axes; the published bank's identity.
        """
        anchor = check_array("state", state, (4,))
        start = check_array("covariance", covariance, (3,))
        _begin_one(self._bank, anchor, start, self.radii, self._model)
        self._anchored = True

    def step(self, measurement: ArrayLike) -> FloatArray:
        """One tick. measurement: (2,) [m]. Returns the cumulative log-likelihoods, (M,)."""
        if not self._anchored:
            raise RuntimeError("step() before anchor(): the bank has no starting estimate")
        self._measurement[:, 0] = check_array("measurement", measurement, (2,))
        _step_one(self._bank, self._measurement, self._model)
        return self.log_likelihood

    @property
    def log_likelihood(self) -> FloatArray:
        """(M,) log-likelihood of the measurements since the anchor."""
        return self._read(self._bank.hypotheses, "log_likelihood")[:, 0]

    @property
    def estimates(self) -> FloatArray:
        """(M, 4) estimates [x, vx, y, vy] [m, m/s]."""
        return self._read(self._bank.hypotheses, "x", "vx", "y", "vy")

    @property
    def innovations(self) -> FloatArray:
        """(M, 2) innovations of the last tick [m]."""
        return self._read(self._bank.innovations, "white_x", "white_y") * np.sqrt(self.innovation_variances)

    @property
    def innovation_variances(self) -> FloatArray:
        """(M, 2) variance of the innovation on each axis [m^2]."""
        return self._by_axis(self._bank.gains, "whitener")[:, :, 0] ** -2.0

    @property
    def covariances(self) -> FloatArray:
        """(M, 2, 3) covariance of (position, velocity) on each axis: xx, xv, vv."""
        return self._by_axis(self._bank.covariances, "xx", "xv", "vv")

    def _read(self, records: NDArray[Any], *names: str) -> FloatArray:
        """(..., fields) of the one track, a copy."""
        return np.stack([records[name][..., 0] for name in names], axis=-1)

    def _by_axis(self, records: NDArray[Any], *names: str) -> FloatArray:
        """(M, 2, fields) of what is shared by radius and axis."""
        turns = list(range(1, self.radii.size + 1))
        return self._read(records, *names)[[0, -1]][:, [0, *turns, *turns]].swapaxes(0, 1)
