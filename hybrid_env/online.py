"""The filter bank of one track as a Python object, for notebooks and user code."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import (
    FloatArray,
    OwnState,
    check_array,
    check_choice,
    check_covariance,
    checked,
    dimensions,
    frozen,
)
from hybrid_env.core.bank_ticks import (
    ESTIMATES,
    ROW_LENGTH,
    read_bank_ticks,
    write_estimate,
    write_innovation,
)
from hybrid_env.core.banks import operations
from hybrid_env.core.banks.bank import FilterModel, bank_arrays
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.memory import BANKS, MEASURED, SENSOR, DenseBank, State, Triangle4
from hybrid_env.limits import Quantity, QuantityOrZero, axis_variances, distinct_radii
from hybrid_env.live import TRIANGLE
from hybrid_env.modes import modes_of_radii, motion_table, parse_modes, radii_of_modes


@compiled
def _begin_one(
    bank: Any,
    rows: FloatArray,
    anchor: State,
    covariance: Triangle4,
    radii: FloatArray,
    model: FilterModel,
) -> None:
    """Start every filter from an anchor with a covariance, upper triangle row by row."""
    operations.begin(bank, 0, anchor, covariance, radii, model)
    for h in range(bank.hypotheses.size):
        write_estimate(rows[h], bank, h, 0)


@compiled
def _step_one(bank: Any, rows: FloatArray, measured: Any, sensors: Any, model: FilterModel) -> None:
    """Advance every filter by what is measured in lane 0; NaN is none."""
    noise = model.variance_x, 0.0, model.variance_y
    measurement = measured[0].measurement
    modes = bank.hypotheses.size
    for h in range(modes):
        write_innovation(rows[h], bank, h, 0, measurement, noise, model)
    operations.step(bank, 0, modes, 0, 1, measured[0], sensors, model)
    for h in range(modes):
        write_estimate(rows[h], bank, h, 0)


class KalmanBank(OwnState):
    """The bank of Kalman filters for one track, as in the environments. Golubkov 2018, eq. (2)
    and (4).

    What the filters tell has the names that `info` has with `bank_info=True`.

    Args:
        radii: turn radii [m], each as a left and as a right turn.
        tau: length of a tick [s].
        process_variance: Q [m^2/s^2].
        measurement_variance: R [m^2], one number or (x, y).
        bank: "published" treats the anchor as exact; "anchor_aware" includes its uncertainty in the
            state of every turn, see `core.banks.anchor_aware`.
        modes: modes of the hypotheses, see `hybrid_env.modes`; None is straight motion and the
            turns of `radii`.

    >>> bank = KalmanBank(radii=[5.0], measurement_variance=0.1)
    >>> bank.anchor([0.0, 2.0, 0.0, 0.0])
    >>> bank.step([0.21, -0.03]).shape
    (3,)
    >>> bank.innovation_covariances.shape
    (3, 2, 2)
    """

    def __init__(
        self,
        radii: ArrayLike = (5.0,),
        tau: float = 0.1,
        process_variance: float = 0.001,
        measurement_variance: float | ArrayLike = 0.1,
        bank: str = "published",
        modes: Any = None,
    ):
        of_user = parse_modes(modes)
        turns = distinct_radii(radii) if of_user is None else radii_of_modes(of_user)
        self.radii = frozen(np.array(turns, float))
        self.modes = modes_of_radii(turns) if of_user is None else of_user
        self.tau = checked("tau", tau, Quantity)
        self.process_variance = checked("process_variance", process_variance, QuantityOrZero)
        self.variances = frozen(axis_variances(measurement_variance))
        self.bank = check_choice("bank", bank, [name for name in BANKS if name != "oracle"])
        if self.modes == modes_of_radii(turns):
            # The axes of an anchor may have different covariances even if they have one measurement
            # variance.
            self._filters = bank_arrays(BANKS[self.bank], self.radii.size, axes=2)
        else:
            table = motion_table(self.modes, self.tau, self.process_variance)
            arrays = bank_arrays(DenseBank, self.radii.size, modes=len(self.modes))
            self._filters = arrays._replace(motions=table)
        self._model = FilterModel(
            self.tau,
            self.process_variance,
            float(self.variances[0]),
            float(self.variances[-1]),
            exact_anchor=float(self.bank == "published"),
        )
        self._measured = np.zeros(1, MEASURED)
        self._sensors = np.zeros(0, SENSOR)
        self._rows = np.full((self.hypotheses, ROW_LENGTH), np.nan)
        self._anchored = False
        prepare(_step_one, self._filters, self._rows, self._measured, self._sensors, self._model)

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M."""
        return len(self.modes)

    def anchor(self, state: ArrayLike, covariance: ArrayLike = (1.0, 0.0, 1.0)) -> None:
        """Start every filter from an estimate, as at a switch.

        Args:
            state: (4,) [x, vx, y, vy] [m, m/s].
            covariance: (3,) xx, xv, vv on each axis, or (4, 4) of the state; by default the
                identity, as published. The published bank ignores entries between the axes.
        """
        anchor = check_array("state", state, (4,))
        if dimensions(covariance) == 1:
            xx, xv, vv = check_array("covariance", covariance, (3,))
            covariance = np.kron(np.eye(2), [[xx, xv], [xv, vv]])
        matrix = check_array("covariance", covariance, (4, 4))
        triangle = check_covariance("covariance", matrix, definite=False)[TRIANGLE]
        start = tuple(anchor.tolist()), tuple(triangle.tolist())
        arguments = self._filters, self._rows, *start, self.radii, self._model
        prepare(_begin_one, *arguments)
        _begin_one(*arguments)
        self._rows[:, :ESTIMATES] = np.nan
        self._anchored = True

    def step(self, measurement: ArrayLike) -> FloatArray:
        """Advance one tick. Returns the cumulative log-likelihoods, (M,).

        measurement: (2,) [m]. With a NaN in it there is none: the filters only predict, and the
        log-likelihoods stay.
        """
        if not self._anchored:
            raise RuntimeError("step() called before anchor(): the bank has no initial estimate")
        position = check_array("measurement", measurement, (2,), missing=True)
        self._measured["measurement"][0, :, 0] = np.nan if np.isnan(position).any() else position
        _step_one(self._filters, self._rows, self._measured, self._sensors, self._model)
        return self.log_likelihood

    @property
    def log_likelihood(self) -> FloatArray:
        """(M,) log-likelihood of the measurements since the anchor."""
        return np.array(self._filters.hypotheses["log_likelihood"][:, 0])

    @property
    def estimates(self) -> FloatArray:
        """(M, 4) estimates [x, vx, y, vy] [m, m/s]."""
        return read_bank_ticks(self._rows)["estimates"]

    @property
    def covariances(self) -> FloatArray:
        """(M, 4, 4) covariances of the estimates."""
        return read_bank_ticks(self._rows)["covariances"]

    @property
    def innovations(self) -> FloatArray:
        """(M, 2) innovations of the current tick [m], NaN without a measurement."""
        return read_bank_ticks(self._rows)["innovations"]

    @property
    def innovation_covariances(self) -> FloatArray:
        """(M, 2, 2) covariances of the innovations [m^2]; without a measurement those for one of
        variance R.
        """
        return read_bank_ticks(self._rows)["innovation_covariances"]
