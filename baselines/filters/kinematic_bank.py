"""A bank of kinematic models: each hypothesis is a Kalman filter, CV, CA or CJ, with a state of its own size.

Its rows have the layout of `HybridTrackEnv`, so that every rule that reads ratios and innovations decides
between the models without a change: SPRT, MSPRT, gap rule, fixed time. Types of motion do not exist here;
rules are used by hypothesis.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import logsumexp

from baselines.filters.imm import resized
from baselines.filters.kalman import KalmanFilter
from baselines.filters.robust import LOG_TWO_PI
from baselines.filters.track_filter import (
    check_covariance,
    check_measurements,
    check_steps,
)
from hybrid_env.checks import check_array, dimensions, reject
from hybrid_env.core.observation_row import LARGEST, LARGEST_ANCHOR
from hybrid_env.observation import LOG_FLOOR, Layout

FloatArray = NDArray[np.float64]


class KinematicBank:
    """Kalman filters of B tracks that start together at a switch and are compared by their likelihoods.

    A filter with more derivatives than the estimate at the switch starts them at 0 with the variances of its
    `start_deviations`.

    Args:
        filters: M = 3, 5, 7 ... Kalman filters, plain or robust, with the same number of axes and, for
            likelihoods that can be compared, the same kind of robust update.

    Raises:
        ArgumentError: an argument has a value that is not allowed.

    Attributes:
        log_likelihood: (B, M) of the measurements since the switch.

    >>> from baselines import MSPRTDecider
    >>> from baselines.filters.motion_models import MotionModel
    >>> models = [MotionModel("CV", 2, 0.01), MotionModel("CA", 2, 0.01), MotionModel("CJ", 2, 0.01)]
    >>> deviations = [(9.0,), (9.0, 2.0), (9.0, 2.0, 1.0)]
    >>> bank = KinematicBank([KalmanFilter(*pair) for pair in zip(models, [0.25] * 3, deviations)])
    >>> bank.begin(state=[[0.0, 5.0, 0.0, 0.0]], covariance=0.25 * np.eye(4))
    >>> decider = MSPRTDecider(alpha=0.02)
    >>> for k in range(1, 60):
    ...     bank.step(0.2, [[k + 0.03 * k**2, 0.0]])
    ...     action, _ = decider.predict(bank.rows(previous=[0]))
    ...     if action[0]:
    ...         break
    >>> models[action[0] - 1].name
    'CA'
    """

    def __init__(self, filters: Sequence[KalmanFilter]):
        known = isinstance(filters, Sequence) and all(isinstance(one, KalmanFilter) for one in filters)
        if not known or len({one.axes for one in filters}) != 1:
            raise reject("filters", filters, "KalmanFilters with the same number of axes")
        self.layout = Layout(len(filters))
        self.filters = list(filters)
        self.axes = filters[0].axes
        _, self._log_noise = np.linalg.slogdet(filters[0].noise)  # of R, the unit of variances in a row
        if filters[0].noise.ndim != 2:
            raise reject("filters", "a covariance per track", "one covariance of the measurements")

    @property
    def hypotheses(self) -> int:
        """Number of hypotheses M."""
        return len(self.filters)

    def begin(self, state: ArrayLike, covariance: ArrayLike) -> None:
        """Start all filters from estimates, as at a switch.

        Args:
            state: (B, d m) with any number m >= 2 of values per axis.
            covariance: (d m, d m) or (B, d m, d m).

        Raises:
            ArgumentError: an argument has a value that is not allowed, or a filter with more derivatives has
            no
                `start_deviations`.
        """
        means = check_array("state", state, (None, None))
        tracks, size = means.shape
        if size % self.axes or size < 2 * self.axes:
            raise reject("state", f"{size} values", f"position and derivatives on each of {self.axes} axes")
        shape = (size, size) if dimensions(covariance) == 2 else (tracks, size, size)
        matrix = check_covariance("covariance", check_array("covariance", covariance, shape), definite=False)
        self._begin([(means, np.broadcast_to(matrix, (tracks, size, size)))], np.zeros(tracks, np.int64))

    def switch(self, chosen: ArrayLike) -> None:
        """Start all filters from the present estimate of one of them.

        Args:
            chosen: (B,) the hypothesis whose estimate is taken for each track.

        Raises:
            ArgumentError: an index is out of range.
        """
        sources = [(one.state, one.covariance) for one in self.filters]
        self._begin(sources, self._checked_hypotheses("chosen", chosen))

    def _begin(self, sources: Sequence[tuple[FloatArray, FloatArray]], chosen: NDArray[np.int64]) -> None:
        """Start every filter from the chosen source, means and covariances of any size, of each track."""
        tracks, d = len(chosen), self.axes
        starts = []
        for one in self.filters:
            if one.start_variances is None and one.order > min(state.shape[1] // d for state, _ in sources):
                raise reject("filters", one.model.name, "start_deviations of the larger models")
            parts = [resized(state, matrix, d, one.order, one.start_variances) for state, matrix in sources]
            states = np.stack([state for state, _ in parts])[chosen, np.arange(tracks)]
            matrices = np.stack([matrix for _, matrix in parts])[chosen, np.arange(tracks)]
            starts.append((states, matrices))
        for one, start in zip(self.filters, starts, strict=True):
            one._begin(tracks)
            one._set(*start)
        self.log_likelihood = np.zeros((tracks, self.hypotheses))
        self._anchor = self.filters[0].position.copy(), self.filters[0].velocity.copy()
        self._anchor_covariance = self.filters[0].covariance.copy()
        self._ticks = 0
        self._sizes, self._scales = np.zeros((2, tracks, self.hypotheses))
        self._directions = np.zeros((tracks, self.hypotheses, d))
        self._displacement = np.zeros((tracks, d))

    def step(self, dt: float | ArrayLike, measurement: ArrayLike) -> None:
        """Advance all filters to a measurement.

        Args:
            dt: time since the last one [s], one number or (B,).
            measurement: (B, d) [m], NaN where there is none.

        Raises:
            ArgumentError: an argument has a value that is not allowed.
        """
        tracks = len(self.log_likelihood)
        steps = check_steps("dt", dt, tracks)
        values = check_measurements("measurement", measurement, (tracks, self.axes))
        measured = ~np.isnan(values[:, 0])
        known = np.where(measured[:, None], values, 0.0)
        self._ticks += 1
        self._displacement = np.where(measured[:, None], known - self._anchor[0], self._displacement)
        exponents = np.zeros_like(self.log_likelihood)
        for h, one in enumerate(self.filters):
            one._predict(steps)
            spread = one.covariance[:, :: one.order, :: one.order] + one.noise
            innovation = np.where(measured[:, None], known - one.position, 0.0)
            half_log = np.where(measured, 0.5 * np.linalg.slogdet(spread)[1], 0.0)
            one._update(values, None)
            self.log_likelihood[:, h] += one.log_likelihood
            exponents[:, h] = half_log + one.log_likelihood
            self._scales[:, h] = np.where(measured, half_log - 0.5 * self._log_noise, 0.0)
            length = np.linalg.norm(innovation, axis=1)
            self._directions[:, h] = innovation / np.where(length > 0.0, length, 1.0)[:, None]
        # the length of the whitened innovation of a Gaussian filter with this likelihood, up to a constant
        largest = np.maximum(exponents.max(-1), -0.5 * self.axes * LOG_TWO_PI)
        squares = 2.0 * (largest[:, None] - exponents)
        self._sizes = np.where(measured[:, None], np.sqrt(np.maximum(squares, 0.0)), 0.0)

    def rows(self, previous: ArrayLike, ticks_left: ArrayLike = 0) -> NDArray[np.float32]:
        """Rows that a decider reads, (B, 6 M + 10), see `hybrid_env.observation.Layout`.

        The innovation is given along and across the velocity at the switch; in more than two dimensions,
        `innovation_across` is the length of the part across. Its length and `log_variance` are such that they
        give the likelihood of the tick, also of a robust filter. Curvatures are 0.

        Args:
            previous: (B,) last decided hypothesis of each track.
            ticks_left: ticks to the next switch, one number or (B,), which some learned deciders read.

        Raises:
            ArgumentError: an index is out of range.
        """
        M, tracks = self.hypotheses, len(self.log_likelihood)
        active = self._checked_hypotheses("previous", previous)
        ratios = self.log_likelihood - self.log_likelihood.max(-1, keepdims=True)
        best = ratios.argmax(-1)
        others = np.where(np.arange(M) == best[:, None], -np.inf, ratios)
        error = logsumexp(others, axis=-1) - logsumexp(ratios, axis=-1)
        along, across = self._in_heading(self._directions * np.minimum(self._sizes, LARGEST)[..., None])
        noise = float(np.exp(self._log_noise / self.axes))  # R, or its geometric mean over the axes
        moved_along, moved_across = self._in_heading(self._displacement[:, None] / np.sqrt(noise))
        xx, xv, vv = self._anchor_means(noise)
        values = {
            "log_ratio": np.maximum(ratios, LOG_FLOOR),
            "innovation_along": along,
            "innovation_across": across,
            "log_variance": self._scales,
            "previous": np.arange(M) == active[:, None],
            "curvature": np.zeros((tracks, M)),
            "ticks": self._ticks,
            "ticks_left": np.asarray(ticks_left),
            "log_error_probability": np.maximum(error, LOG_FLOOR),
            "speed": np.linalg.norm(self._anchor[1], axis=1),
            "displacement_along": moved_along[:, 0],
            "displacement_across": moved_across[:, 0],
            "anchor_xx": xx,
            "anchor_xv": xv,
            "anchor_vv": vv,
            "log_noise": self._log_noise / self.axes,
        }
        rows = np.empty((tracks, self.layout.width), np.float32)
        for name, scale in self.layout.scales.items():
            block = np.clip(np.asarray(values[name], np.float64), -LARGEST_ANCHOR, LARGEST_ANCHOR) * scale
            rows[:, self.layout.slices[name]] = block if block.ndim == 2 else block.reshape(-1, 1)
        return rows

    def _in_heading(self, vectors: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Components of (B, M, d) vectors along and across the velocity at the switch, each (B, M)."""
        velocity = self._anchor[1]
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        heading = np.where(speed > 0.0, velocity / np.where(speed > 0.0, speed, 1.0), np.eye(self.axes)[0])
        along = (vectors * heading[:, None]).sum(-1)
        if self.axes == 2:
            return along, vectors[..., 1] * heading[:, None, 0] - vectors[..., 0] * heading[:, None, 1]
        return along, np.linalg.norm(vectors - along[..., None] * heading[:, None], axis=-1)

    def _anchor_means(self, noise: float) -> list[FloatArray]:
        """Means over the axes of P_xx, P_xv and P_vv at the switch, over R, each (B,)."""
        m, d = self.filters[0].order, self.axes
        matrix = self._anchor_covariance.reshape(-1, d, m, d, m)
        pairs = [(0, 0), (0, 1), (1, 1)]
        return [np.einsum("bii->b", matrix[:, :, row, :, column]) / (d * noise) for row, column in pairs]

    def _checked_hypotheses(self, name: str, value: ArrayLike) -> NDArray[np.int64]:
        """Return checked indices of hypotheses, (B,)."""
        indices = np.asarray(value)
        if indices.dtype.kind not in "iu" or indices.shape != (len(self.log_likelihood),):
            raise reject(name, value, f"{len(self.log_likelihood)} integers, one per track")
        if ((indices < 0) | (indices >= self.hypotheses)).any():
            raise reject(name, value, f"integers from 0 to {self.hypotheses - 1}")
        return indices.astype(np.int64)
