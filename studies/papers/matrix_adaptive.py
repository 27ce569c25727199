"""The adaptive filter of Zimchuk & Kankin 2006 in matrix form, for n sensors with correlated
errors.

The state is that of all d axes, [x, vx, y, vy] in the plane, and the measurement g = C x + f holds
the positions of n sensors. With the pseudo-inverse C+ of C, which for one sensor is the C' of eq.
(17), and F+ in the rows of the velocities, where nu_i is the innovation i ticks ago:

    P_e C' = M[(-D^3 x_e + C+ (3 nu_1 - 3 nu_2 + nu_3) + F+ (3 nu_1 - 6 nu_2 + 4 nu_3 - nu_4) / T)
    nu'] K      = P_e C' H_0^-1                                       eq. (5), with C P_e C' + R =
    H_0 = M[nu nu']
"""

import numpy as np

from baselines.estimation.gain_filters import (
    LAGS,
    PRODUCTS,
    ConstantStepFilter,
    shifted,
    third_difference,
)
from hybrid_env.checks import FloatArray, check_integer, reject

# Coefficients of the innovations in eq. (17) with N = 3, newest first, for positions and
# velocities.
LAGS_OF = np.array([[0.0, 3.0, -3.0, 1.0, 0.0], [0.0, 3.0, -6.0, 4.0, -1.0]])


def matrix_gain(covariances: FloatArray, spread: FloatArray, tau: float) -> FloatArray:
    """Gains of positions [-] and velocities [1/s], (2, ..., d, m), of the values of m = n d
    measured axes. From H_0 (..., m, m) [m^2], invertible, and the rows of P_e C', (2, ..., d, m).
    The limits are those of `adaptive.AdaptiveFilter`, in the directions in which the gain of a
    common position is diagonal: with L L' = C' H_0^-1 C the eigenvectors of L' P L, P the symmetric
    part of the covariance of the predicted position.
    """
    inverse = np.linalg.inv(covariances)
    d, m = spread.shape[-2:]
    # C without the columns of the velocities.
    sensors = np.tile(np.eye(d), (m // d, 1))
    # C' H_0^-1.
    of_position = sensors.T @ inverse
    factor = np.linalg.cholesky(of_position @ sensors)
    position, velocity = np.swapaxes(factor, -1, -2) @ (spread @ sensors / (m // d)) @ factor
    gains, directions = np.linalg.eigh(0.5 * (position + np.swapaxes(position, -1, -2)))
    gains = np.clip(gains, 0.0, 1.0)
    rates = np.einsum("...ik,...ij,...jk->...k", directions, velocity, directions)
    rates = np.clip(rates, 0.0, gains**2 / ((2.0 - gains) * tau))
    limited = (directions * np.stack([gains, rates])[..., None, :]) @ np.swapaxes(
        directions,
        -1,
        -2,
    )
    unfactor = np.linalg.inv(factor)
    return np.asarray(np.swapaxes(unfactor, -1, -2) @ limited @ unfactor @ of_position)


class MatrixAdaptiveFilter(ConstantStepFilter):
    """The adaptive filter with one gain matrix (2, B, d, n d), see `matrix_gain`, for the d axes of
    the state and all n sensors. A measurement has the n d positions of one sensor after another,
    its `axes`; it is missing where a sensor has none, and products around it are left out of the
    means.
    """

    def __init__(self, dimensions: int, tau: float, *, sensors: int = 1):
        self.dimensions = check_integer("dimensions", dimensions)
        self.sensors = check_integer("sensors", sensors)
        super().__init__(self.dimensions * self.sensors, tau)

    def _begin(self, tracks: int) -> None:
        super()._begin(tracks)
        d = self.dimensions
        m = self.axes
        self.state = np.full((tracks, 2 * d), np.nan)
        self._predictions = np.full((2, LAGS, tracks, d), np.nan)
        self._innovations = np.full((LAGS, tracks, m), np.nan)
        # H_0, then P_e C'.
        self._means = np.zeros((tracks, m + 2 * d, m))
        self._products = np.zeros(tracks)

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        if self.sensors > 1:
            raise reject("state", state.tolist(), "none with several sensors: begin(tracks)")
        super()._set(state, covariance)

    def _mean_of_sensors(self, values: FloatArray) -> FloatArray:
        """C+ of measurements or innovations, (..., m) to (..., d)."""
        return values.reshape(*values.shape[:-1], self.sensors, self.dimensions).mean(-2)

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0])
        first = measured & ~begun
        later = measured & begun
        self._count = np.where(first, 1, self._count + (later & (self._elapsed > 0.0)))
        self.gains = self._find_gains(measurement)
        change = self.gains @ self._innovations[0][..., None]
        for row in range(2):
            self.state[later, row::2] += change[row, later, :, 0]
        self.state[first, ::2], self.state[first, 1::2] = (
            self._mean_of_sensors(measurement[first]),
            0.0,
        )
        self._elapsed[measured] = 0.0

    def _line_gains(self, line: FloatArray) -> FloatArray:
        return line[..., None] * np.tile(np.eye(self.dimensions), self.sensors) / self.sensors

    def _adapted(
        self,
        measurement: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
    ) -> FloatArray:
        innovation = measurement - np.tile(position, self.sensors)
        newest = np.stack([position, velocity])[:, None]
        self._predictions = np.concatenate([newest, self._predictions[:, :-1]], axis=1)
        self._innovations = shifted(self._innovations, innovation)
        lags = self._mean_of_sensors(self._innovations)
        units = (1.0, self.tau)
        spread = [
            np.tensordot(coefficients, lags, axes=1) / unit - third_difference(predictions)
            for coefficients, unit, predictions in zip(
                LAGS_OF,
                units,
                self._predictions,
                strict=True,
            )
        ]
        new = np.concatenate([innovation, *spread], axis=-1)[..., None] * innovation[:, None, :]
        known = np.logical_not(np.isnan(new).any(axis=(1, 2)))
        self._products += known
        weight = (known / np.maximum(self._products, 1.0))[:, None, None]
        self._means += np.where(known[:, None, None], weight * (new - self._means), 0.0)
        d = self.dimensions
        m = self.axes
        gains = np.full((2, self.tracks, d, m), np.nan)
        covariances, *spread = np.split(self._means, (m, m + d), axis=1)
        ready = self._products > PRODUCTS * m
        # Exact values identify nothing.
        ready &= np.linalg.matrix_rank(covariances, hermitian=True) == m
        gains[:, ready] = matrix_gain(covariances[ready], np.stack(spread)[:, ready], self.tau)
        return gains
