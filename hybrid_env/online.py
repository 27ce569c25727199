"""The filter bank of one track as a Python object, for notebooks and user code."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_env.checks import FloatArray, OwnState, check_array, check_covariance, dimensions
from hybrid_env.core.kernels import BEGIN, MEASURE
from hybrid_env.live import TRIANGLE
from hybrid_env.options import WorldOptions
from hybrid_env.world import World


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
        options: dict[str, Any] = {
            "radii": radii,
            "tau": tau,
            "process_variance": process_variance,
            "measurement_variance": measurement_variance,
            "bank": bank,
            "modes": modes,
        }
        self.options = WorldOptions(
            **options,
            # The axes of an anchor may have different covariances.
            follow="bank",
            reset_covariance=False,
            # Of an object, of which there is none.
            speed=1e-18,
            initial_error=0,
        )
        self._world = World(self.options, bank_info=True, live=True)
        # Positions have variance R.
        self._world.blocks["noise"][:, ::2] = 1.0
        self._anchored = False

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M."""
        return self.options.hypotheses

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
        block = self._world.blocks[0]
        block["estimate"][:, 0], block["covariance"][:, 0] = anchor, triangle
        # The first segment begins.
        block["segment"][0] = -1
        self._world.run(BEGIN)
        self._world.bank_ticks[:] = np.nan
        self._anchored = True

    def step(self, measurement: ArrayLike) -> FloatArray:
        """Advance one tick. Returns the cumulative log-likelihoods, (M,).

        measurement: (2,) [m]. With a NaN in it there is none: the filters only predict, and the
        log-likelihoods stay.
        """
        if not self._anchored:
            raise RuntimeError("step() called before anchor(): the bank has no initial estimate")
        position = check_array("measurement", measurement, (2,), missing=True)
        given = np.nan if np.isnan(position).any() else position
        self._world.blocks[0]["measurement"][:, 0] = given
        self._world.run(MEASURE)
        return self.log_likelihood

    @property
    def log_likelihood(self) -> FloatArray:
        """(M,) log-likelihood of the measurements since the anchor."""
        return self._world.hypothesis_values()[0]

    @property
    def estimates(self) -> FloatArray:
        """(M, 4) estimates [x, vx, y, vy] [m, m/s]; NaN before the first step."""
        return self._told("estimates")

    @property
    def covariances(self) -> FloatArray:
        """(M, 4, 4) covariances of the estimates; NaN before the first step."""
        return self._told("covariances")

    @property
    def innovations(self) -> FloatArray:
        """(M, 2) innovations of the current tick [m], NaN without a measurement."""
        return self._told("innovations")

    @property
    def innovation_covariances(self) -> FloatArray:
        """(M, 2, 2) covariances of the innovations [m^2]; without a measurement those for one of
        variance R.
        """
        return self._told("innovation_covariances")

    def _told(self, name: str) -> FloatArray:
        """Return what the filters tell of the current tick, by its name in `info`."""
        return self._world.bank_tick()[name][0]
