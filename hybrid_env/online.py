"""The published filter bank of one track as a Python object, for notebooks and user code."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_env.checks import FloatArray, ReadOnlyAttributes, check_array, frozen
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.banks.published import PublishedBank, begin_published, step_published
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.records import LANES
from hybrid_env.limits import axis_variances, check_within, distinct_radii


@compiled
def _begin_one(
    bank: PublishedBank, anchor: FloatArray, covariance: FloatArray, radii: FloatArray, model: FilterModel
) -> None:
    x, vx, y, vy = anchor
    xx, xv, vv = covariance
    begin_published(bank, 0, (x, vx, y, vy), (xx, xv, 0.0, 0.0, vv, 0.0, 0.0, xx, xv, vv), radii, model)


@compiled
def _step_one(bank: PublishedBank, measurement: FloatArray, model: FilterModel) -> None:
    step_published(bank, 0, 1, measurement, model)


class KalmanBank(ReadOnlyAttributes):
    """The published bank of Kalman filters for one track. Golubkov 2018, eq. (2) and (4).

    Args:
        radii: turn radii [m], each as a left and as a right turn.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).

    >>> bank = KalmanBank(radii=[5.0], measurement_variance=0.1)
    >>> bank.anchor([0.0, 2.0, 0.0, 0.0])
    >>> bank.step([0.21, -0.03]).shape
    (3,)
    """

    read_only = frozenset(("radii", "tau", "process_variance", "variances"))

    def __init__(
        self, radii: ArrayLike = (5.0,), tau: float = 0.1, process_variance: float = 0.001,
        measurement_variance: float | ArrayLike = 0.1,
    ):  # fmt: skip
        self.radii = frozen(np.array(distinct_radii("radii", radii)))
        self.tau = check_within("tau", tau)
        self.process_variance = check_within("process_variance", process_variance)
        self.variances = frozen(axis_variances(measurement_variance))
        self._bank = bank_arrays(PublishedBank, self.radii.size, self.variances.size)
        self._model = FilterModel(self.tau, self.process_variance, float(self.variances[0]), float(self.variances[-1]))
        self._measurement = np.zeros((2, LANES))
        self._anchored = False
        prepare(_step_one, self._bank, self._measurement, self._model)

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M = 2n + 1."""
        return 2 * self.radii.size + 1

    def anchor(self, state: ArrayLike, covariance: ArrayLike = (1.0, 0.0, 1.0)) -> None:
        """Start every filter from an estimate, as at a switch.

        Args:
            state: (4,) [x, vx, y, vy] [m, m/s].
            covariance: (3,) xx, xv, vv on each axis; by default the identity, as published.
        """
        anchor = check_array("state", state, (4,))
        start = check_array("covariance", covariance, (3,))
        arguments = self._bank, anchor, start, self.radii, self._model
        prepare(_begin_one, *arguments)
        _begin_one(*arguments)
        self._anchored = True

    def step(self, measurement: ArrayLike) -> FloatArray:
        """Advance one tick. measurement: (2,) [m]. Returns the cumulative log-likelihoods, (M,)."""
        if not self._anchored:
            raise RuntimeError("step() called before anchor(): the bank has no initial estimate")
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
        """(M, 2) innovations of the current tick [m]."""
        return self._read(self._bank.innovations, "white_x", "white_y") * np.sqrt(self.innovation_variances)

    @property
    def innovation_variances(self) -> FloatArray:
        """(M, 2) innovation variance on each axis [m^2]."""
        return self._read_axes(self._bank.gains, "whitener")[:, :, 0] ** -2.0

    @property
    def covariances(self) -> FloatArray:
        """(M, 2, 3) covariance of (position, velocity) on each axis: xx, xv, vv."""
        return self._read_axes(self._bank.covariances, "xx", "xv", "vv")

    def _read(self, records: NDArray[Any], *names: str) -> FloatArray:
        """Return a copy of the fields of the single track, (..., fields)."""
        return np.stack([records[name][..., 0] for name in names], axis=-1)

    def _read_axes(self, records: NDArray[Any], *names: str) -> FloatArray:
        """Return fields stored per axis and radius as (M, 2, fields)."""
        turns = list(range(1, self.radii.size + 1))
        return self._read(records, *names)[[0, -1]][:, [0, *turns, *turns]].swapaxes(0, 1)
