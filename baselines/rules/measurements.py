"""What deciders observe that filter the measurements of the environment themselves, instead of
reading its rows. With announced switches a row has the measurement, but with sensors not its
covariance. Then these deciders also observe covariance, range rates, and the anchor, so that their
filters run in the frame of the world.
"""

from typing import Any

import numpy as np

from baselines.rules.decider import UNKNOWN, Actions, Decider
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, reject
from hybrid_env.compiled import (
    MOST_RATES,
    FilterModel,
    State,
    Triangle4,
    internal,
    set_state,
    state_of,
    triangle_of,
)
from hybrid_env.live import SQUARE, TRIANGLE
from hybrid_env.observation import Layout
from hybrid_env.options import ModelOptions, WorldOptions
from hybrid_env.sensors import sensor_table
from hybrid_env.world import World

# Width of an observation without the probabilities: measurement, estimate and covariance.
OBSERVED = 2 + 4 + 10
# Further columns with sensors: covariance of the measurement over R, and range rates.
SENSED = 3 + MOST_RATES
# Columns that `observe_sensed` adds: what `sensing.write_measured` reads, anchor, heading.
OF_SENSORS = (2 + SENSED, 4, 2)


def own_filters(options: ModelOptions) -> FilterModel:
    """Return the model of a decider's own filters."""
    variances = options.variances
    return FilterModel(
        options.tau,
        options.process_variance,
        float(variances[0]),
        float(variances[-1]),
        drift_variance=options.drift_variance,
        freedom=options.freedom,
    )


def sensors_of(options: ModelOptions) -> AnyArray:
    """Return (k,) records `SENSOR` for a decider's own filters."""
    return sensor_table(options.sensors, float(options.variances[0]))


@internal
def estimate_in(entries: FloatArray) -> tuple[State, Triangle4]:
    """Return an estimate and the upper triangle of its covariance, of 14 entries, as tuples."""
    covariance = triangle_of(entries[4:14].reshape(10, 1), 0)
    return (entries[0], entries[1], entries[2], entries[3]), covariance


@internal
def copy_filter(source: Any, lane: int, target: Any, target_lane: int) -> None:
    """Copy a filter, a lane of a record `AWARE_HYPOTHESIS`, to a lane of another record."""
    set_state(target, target_lane, state_of(source, lane))
    for k in range(source.covariance.shape[0]):
        target.covariance[k, target_lane] = source.covariance[k, lane]
    target.log_likelihood[target_lane] = source.log_likelihood[lane]


class MeasurementDecider(Decider):
    """A decider for M modes that observes the measurements, and the first estimate and
    probabilities of the bank. Its state describes N tracks and is changed in place.
    """

    task = UNKNOWN
    observes = "tracks"
    every_tick = reads_options = True
    hypotheses: int

    def begin(self, tracks: int) -> Any:
        """Return the state of N tracks before their first observation."""
        raise NotImplementedError

    def begin_track(self, state: Any, track: int, start: FloatArray) -> None:
        """Begin an episode of a track from `start`, (14 + M,), after its first measurement: the
        estimate, the upper triangle of its covariance and the logarithms of the mode probabilities.
        """
        raise NotImplementedError

    def step(self, state: Any, measurements: FloatArray) -> None:
        """Advance all tracks by one tick. measurements: (N, 2) or (N, 9), see
        `sensing.write_measured`.
        """
        raise NotImplementedError

    def statements(self, state: Any, starts: BoolArray) -> Actions:
        """Return the statements (N,). starts: (N,) True where an episode begins."""
        raise NotImplementedError

    def observe(self, tracks: World) -> FloatArray:
        """Return measurement, merged estimate, covariance, log probabilities of the modes, and
        what sensors add.
        """
        if tracks.options.switches != self.task:
            raise reject("options", type(tracks.options).__name__, f"those of {self.task} switches")
        parts = [tracks.field(name) for name in ("measurement", "estimate", "covariance")]
        parts.append(tracks.hypothesis_values())
        if tracks.options.sensors:
            parts += tracks.field("noise"), tracks.field("rates")
        return np.hstack(parts)

    def decide(
        self, observation: FloatArray, state: Any, episode_start: BoolArray | None
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`; action i states mode i. Tracks begin where `episode_start` says,
        or without a state.
        """
        width = OBSERVED + self.hypotheses
        tracks = len(observation)
        if observation.ndim != 2 or observation.shape[1] not in (width, width + SENSED):
            raise reject(
                "observation shape",
                observation.shape,
                f"(N, {width}), with sensors {width + SENSED}",
            )
        if state is None:
            state = self.begin(tracks)
            episode_start = np.ones(tracks, bool)
        starts = np.zeros(tracks, bool) if episode_start is None else episode_start
        if not starts.all():
            self.step(state, np.hstack([observation[:, :2], observation[:, width:]]))
        for track in np.flatnonzero(starts).tolist():
            self.begin_track(state, track, np.ascontiguousarray(observation[track, 2:width]))
        return self.statements(state, starts), state

    def evidence(
        self, observation: FloatArray, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the probabilities of the modes by the bank, (N, M)."""
        return np.exp(observation[:, OBSERVED : OBSERVED + self.hypotheses])


def observe_sensed(tracks: Any) -> AnyArray:
    """Return the rows of a `World`, with sensors followed by what they measured, anchors and
    headings, (N, 15).
    """
    names = ("measurement", "noise", "rates", "anchor", "heading") if tracks.options.sensors else ()
    return np.hstack([tracks.take_rows(), *(tracks.field(name) for name in names)])


def split_sensed(layout: Layout, observation: AnyArray) -> tuple[AnyArray, FloatArray | None]:
    """Return the rows of an observation, and what sensors add to it, None without them."""
    if observation.ndim != 2 or observation.shape[1] != layout.width + sum(OF_SENSORS):
        return observation, None
    return observation[:, : layout.width], observation[:, layout.width :]


def in_rows(world: WorldOptions, rows: AnyArray) -> FloatArray:
    """Return the measurements of rows in the heading frame, (N, 2), NaN where there is none."""
    layout = Layout(world.hypotheses)
    names = ("displacement_along", "displacement_across")
    measurements = world.deviation * np.stack([layout.read(rows, name) for name in names], axis=-1)
    measurements[layout.read(rows, "measured") < 0.5] = np.nan
    return measurements


def axes_in_rows(world: WorldOptions, rows: AnyArray, measurements: FloatArray) -> FloatArray:
    """Return the direction of the axis with the smaller variance in the heading frame, (N, 2),
    cosine and sine of twice its angle. Rows of the first measurement of a segment give it, because
    the published bank whitens its innovations along the axes: the filter of straight motion expects
    the object `speed` times the time ahead.
    """
    layout = Layout(world.hypotheses)
    expected = layout.read(rows, "speed") * np.rint(layout.read(rows, "ticks"))
    innovation = measurements / world.deviation - expected[:, None] * [1.0, 0.0]
    white = np.stack(
        [layout.read(rows, f"innovation_{axis}")[:, 0] for axis in ("along", "across")], axis=-1
    )
    # White = W innovation, where W is symmetric and its determinant is known.
    normal = np.stack([-innovation[:, 1], innovation[:, 0]], axis=-1)
    normal *= np.exp(-0.5 * layout.read(rows, "log_variance")[:, :1])
    W = white[:, :, None] * white[:, None] + normal[:, :, None] * normal[:, None]
    axis = np.stack([W[:, 0, 0] - W[:, 1, 1], 2.0 * W[:, 0, 1]], axis=-1)
    return np.asarray(axis / np.maximum(np.hypot(*axis.T), 1e-300)[:, None])


def in_world(
    sensed: FloatArray | None, anchors: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return measurements (N, 9), anchors (C, N, 14) in the frame of the world, and headings (N,
    2).
    """
    if sensed is None:
        allowed = "what `observe` returns, with sensors"
        raise reject("observation", "a row of the environment", allowed)
    measurements, origin, heading = np.split(sensed, np.cumsum(OF_SENSORS[:2]), axis=1)
    c, s = heading.T
    turn = np.zeros((len(heading), 4, 4))
    turned = np.empty_like(anchors)
    turn[:, range(4), range(4)] = c[:, None]
    turn[:, (0, 1), (2, 3)] = -s[:, None]
    turn[:, (2, 3), (0, 1)] = s[:, None]
    turned[..., :4] = (turn @ anchors[..., :4, None])[..., 0] + origin * [1.0, 0.0, 1.0, 0.0]
    P = turn @ anchors[..., 4:][..., SQUARE] @ turn.swapaxes(1, 2)
    turned[..., 4:] = P[..., TRIANGLE[0], TRIANGLE[1]]
    return np.ascontiguousarray(measurements), turned, heading


def in_heading_frame(innovations: FloatArray, heading: FloatArray) -> FloatArray:
    """Return innovations (C, N, M, 3) along and across headings (N, 2)."""
    c, s = heading.T[..., None]
    x = innovations[..., 0]
    y = innovations[..., 1]
    return np.stack([c * x + s * y, c * y - s * x, innovations[..., 2]], axis=-1)
