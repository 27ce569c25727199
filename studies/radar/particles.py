"""A bootstrap particle filter of the models CV, CA and CJ. Gordon, Salmond & Smith 1993."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaln, logsumexp

from baselines.estimation.motion_models import MotionModel, check_per_item
from baselines.estimation.track_filter import TrackFilter
from hybrid_env.checks import FloatArray, check_array, check_between, check_integer, reject


class ParticleFilter(TrackFilter):
    """Particles that move as the model does, weighted by the likelihood of the measurements: P for
    each axis, (B, d, P, m), resampled systematically (Kitagawa 1996) where their effective number
    falls below half of them. Errors have a scale `deviation` on each axis [m] and Student's t, or
    without degrees of freedom the normal distribution. `begin` starts the random numbers anew.
    """

    covariance: FloatArray

    def __init__(
        self,
        model: MotionModel,
        deviation: float | ArrayLike,
        start_deviations: ArrayLike,
        degrees_of_freedom: float | None = None,
        particles: int = 1000,
        seed: int = 0,
    ):
        if not isinstance(model, MotionModel):
            raise reject("model", model, "a MotionModel")
        self.model, self.axes, self.order = model, model.axes, model.order
        self.deviation = check_per_item("deviation", deviation, model.axes)
        if not self.deviation.all():
            raise reject("deviation", deviation, "numbers > 0")
        self.start_deviations = check_array("start_deviations", start_deviations, (self.order - 1,))
        if degrees_of_freedom is not None:
            check_between("degrees_of_freedom", degrees_of_freedom, 0.0999, 1000.1)
        self.degrees_of_freedom = degrees_of_freedom
        self.particles = check_integer("particles", particles, 2, 1_000_000)
        self.seed = check_integer("seed", seed, minimum=0)

    def _begin(self, tracks: int) -> None:
        self.generator = np.random.default_rng(self.seed)
        shape = tracks, self.axes, self.particles
        self.particle_states = np.full((*shape, self.order), np.nan)
        self.log_weights = np.full(shape, -np.log(self.particles))
        self._summarise()
        self._no_measurement()

    def _set(self, state: FloatArray, covariance: FloatArray | None) -> None:
        assert covariance is not None
        d = self.axes
        m = self.order
        blocks = np.einsum("bdidj->bdij", covariance.reshape(-1, d, m, d, m))
        self.particle_states = state.reshape(-1, d, 1, m) + self._normal(blocks)
        self._summarise()

    def _normal(self, covariance: FloatArray) -> FloatArray:
        """Return normal random numbers of covariances (..., m, m), (B, d, P, m)."""
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(values.clip(0.0))[..., None, :]
        normal = self.generator.standard_normal(self.particle_states.shape)
        return np.asarray(normal @ root.swapaxes(-1, -2), np.float64)

    def _predict(self, dt: float | FloatArray) -> None:
        steps = np.broadcast_to(dt, (self.tracks,))
        intensity = np.broadcast_to(self.model.noise, (self.axes,))[:, None, None]
        moved = self.particle_states @ self.model.transition(steps)[:, None].swapaxes(-1, -2)
        self.particle_states = moved + self._normal(
            intensity * self.model.step_noise(steps)[:, None]
        )
        self._summarise()

    def _update(self, measurement: FloatArray, noise: FloatArray | None) -> None:
        if noise is not None:
            raise reject("noise", noise, "None for a particle filter")
        self._no_measurement()
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0])
        first = np.flatnonzero(measured & ~begun)
        used = np.flatnonzero(measured & begun)
        if first.size:
            deviations = np.column_stack(
                [self.deviation, np.tile(self.start_deviations, (self.axes, 1))]
            )
            started = self._normal((deviations**2)[None, ..., None] * np.eye(self.order))
            started[..., 0] += measurement[..., None]
            self.particle_states[first] = started[first]
        if used.size:
            z = measurement[used]
            spread = (
                np.diagonal(self.covariance[used], axis1=1, axis2=2)[:, :: self.order]
                + self.deviation**2
            )
            self.nis[used] = ((z - self.state[used, :: self.order]) ** 2 / spread).sum(1)
            deviation = self.deviation[:, None]
            white = (z[..., None] - self.particle_states[used, ..., 0]) / deviation
            logs = (
                self.log_weights[used]
                + log_density(white, self.degrees_of_freedom)
                - np.log(deviation)
            )
            total = logsumexp(logs, axis=-1)
            self.log_likelihood[used] = total.sum(-1)
            self.log_weights[used] = logs - total[..., None]
            for k, axis in np.argwhere(
                np.exp(2.0 * (logs - total[..., None])).sum(-1) > 2.0 / self.particles
            ):
                track = used[k]
                sums = np.exp(self.log_weights[track, axis]).cumsum()
                points = (self.generator.random() + np.arange(self.particles)) / self.particles
                chosen = np.minimum(np.searchsorted(sums, points * sums[-1]), self.particles - 1)
                self.particle_states[track, axis] = self.particle_states[track, axis, chosen]
                self.log_weights[track, axis] = -np.log(self.particles)
        self._summarise()

    def _summarise(self) -> None:
        """Set state and covariance to those of the weighted particles."""
        weights = np.exp(self.log_weights)[..., None]
        mean = (weights * self.particle_states).sum(2)
        centred = self.particle_states - mean[:, :, None]
        blocks = (weights * centred).swapaxes(-1, -2) @ centred
        tracks, d, m = mean.shape
        self.state, full = mean.reshape(tracks, -1), np.zeros((tracks, d, m, d, m))
        for axis in range(d):
            full[:, axis, :, axis] = blocks[:, axis]
        self.covariance = full.reshape(tracks, d * m, d * m)


def log_density(white: FloatArray, degrees_of_freedom: float | None) -> FloatArray:
    """Return the log-density of Student's t, or with None of the normal distribution, of scale
    1.
    """
    if degrees_of_freedom is None:
        return np.asarray(-0.5 * (white**2 + np.log(2.0 * np.pi)))
    nu = degrees_of_freedom
    constant = gammaln(0.5 * (nu + 1.0)) - gammaln(0.5 * nu) - 0.5 * np.log(nu * np.pi)
    return np.asarray(constant - 0.5 * (nu + 1.0) * np.log1p(white**2 / nu))
