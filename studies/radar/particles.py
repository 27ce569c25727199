"""A bootstrap particle filter of constant velocity. Gordon, Salmond & Smith 1993."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import t

from studies.filters.motion_models import MotionModel
from studies.filters.track_filter import TrackFilter
from studies.radar.flights import FloatArray


class ParticleFilter(TrackFilter):
    """Particles that move as the model does, weighted by the likelihood of the measurements: P for
    each axis, (B, d, P, m), resampled systematically (Kitagawa 1996) where their effective number
    falls below half of them. Errors have a scale `deviation` [m] and Student's t. `begin` starts
    the random numbers anew.
    """

    covariance: FloatArray

    def __init__(
        self,
        model: MotionModel,
        deviation: float,
        start_deviations: tuple[float, ...],
        degrees_of_freedom: float,
        particles: int = 1000,
    ):
        self.model, self.axes, self.order = model, model.axes, model.order
        self.deviation = deviation
        self.start_deviations = start_deviations
        self.degrees_of_freedom = degrees_of_freedom
        self.particles = particles

    def begin(self, tracks: int) -> None:
        """See `TrackFilter.begin`."""
        self.generator = np.random.default_rng(0)
        shape = tracks, self.axes, self.particles
        self.particle_states = np.full((*shape, self.order), np.nan)
        self.log_weights = np.full(shape, -np.log(self.particles))
        self._summarise()
        self._no_measurement()

    def _normal(self, covariance: FloatArray) -> FloatArray:
        """Return normal random numbers of covariances (..., m, m), (B, d, P, m)."""
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(values.clip(0.0))[..., None, :]
        normal = self.generator.standard_normal(self.particle_states.shape)
        return np.asarray(normal @ root.swapaxes(-1, -2), np.float64)

    def predict(self, dt: float | FloatArray) -> None:
        """See `TrackFilter.predict`."""
        steps = np.broadcast_to(dt, (self.tracks,))
        intensity = np.broadcast_to(self.model.noise, (self.axes,))
        transition = self.model.transition(steps)[:, None]
        spread = intensity[:, None, None] * self.model.step_noise(steps)[:, None]
        moved = self.particle_states @ transition.swapaxes(-1, -2)
        self.particle_states = moved + self._normal(spread)
        self._summarise()

    def update(self, measurement: FloatArray, noise: FloatArray | None = None) -> None:
        """See `TrackFilter.update`."""
        self._no_measurement()
        measured = ~np.isnan(measurement[:, 0])
        begun = ~np.isnan(self.state[:, 0])
        first = np.flatnonzero(measured & ~begun)
        used = np.flatnonzero(measured & begun)
        if first.size:
            variances = np.square([self.deviation, *self.start_deviations])
            started = self._normal(np.diag(variances)[None, None])
            started[..., 0] += measurement[..., None]
            self.particle_states[first] = started[first]
        if used.size:
            self._weigh(used, measurement[used])
        self._summarise()

    def _weigh(self, used: NDArray[np.int64], measured: FloatArray) -> None:
        """Weigh the particles of tracks (n,) by their measurements (n, d), and resample."""
        positions = self.particle_states[used, ..., 0]
        white = (measured[..., None] - positions) / self.deviation
        density = t.logpdf(white, self.degrees_of_freedom)
        logs = self.log_weights[used] + density - np.log(self.deviation)
        total = logsumexp(logs, axis=-1)
        self.log_likelihood[used] = total.sum(-1)
        logs -= total[..., None]
        self.log_weights[used] = logs
        few = np.exp(2.0 * logs).sum(-1) > 2.0 / self.particles
        for k, axis in np.argwhere(few):
            place = used[k], axis
            sums = np.exp(self.log_weights[place]).cumsum()
            # Systematic resampling: equal distances from one random number on.
            points = (self.generator.random() + np.arange(self.particles)) / self.particles
            chosen = np.searchsorted(sums, points * sums[-1]).clip(max=self.particles - 1)
            self.particle_states[place] = self.particle_states[place][chosen]
            self.log_weights[place] = -np.log(self.particles)

    def _summarise(self) -> None:
        """Set state and covariance to those of the weighted particles."""
        weights = np.exp(self.log_weights)[..., None]
        mean = (weights * self.particle_states).sum(2)
        centred = self.particle_states - mean[:, :, None]
        blocks = (weights * centred).swapaxes(-1, -2) @ centred
        tracks, d, m = mean.shape
        self.state = mean.reshape(tracks, -1)
        full = blocks[:, :, :, None] * np.eye(d)[:, None, :, None]
        self.covariance = full.reshape(tracks, d * m, d * m)
