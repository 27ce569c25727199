"""What several sensors measured, for deciders whose filters run on the measurements of announced segments.

A row has the measurement, but not its covariance. With sensors these deciders also observe covariance, range rates, and
the anchor, so that their filters run in the frame of the world.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import BoolArray, FloatArray, reject
from hybrid_env.core.records import MOST_RATES
from hybrid_env.live import SQUARE, TRIANGLE
from hybrid_env.observation import Layout

SENSED = 2 + 3 + MOST_RATES, 4, 2
"""Columns of `sensed_of`: what `sensing.write_measured` reads, the anchor, and its heading."""


def sensed_of(tracks: Any) -> FloatArray | None:
    """Return what the sensors of a `World` measured, anchors and headings, (N, 15); None without sensors."""
    names = ("measurement", "noise", "rates", "anchor", "heading")
    return np.hstack([tracks.field(name) for name in names]) if tracks.options.sensors else None


def observe_sensed(tracks: Any) -> NDArray[Any]:
    """Return the rows of a `World`, with sensors followed by `sensed_of`."""
    rows, sensed = tracks.take_rows(), sensed_of(tracks)
    return np.asarray(rows if sensed is None else np.hstack([rows, sensed]))


def split_sensed(layout: Layout, observation: NDArray[Any]) -> tuple[NDArray[Any], FloatArray | None]:
    """Return the rows of an observation, and `sensed_of` if it has it."""
    longer = observation.ndim == 2 and observation.shape[1] == layout.width + sum(SENSED)
    return (observation[:, : layout.width], observation[:, layout.width :]) if longer else (observation, None)


def in_rows(layout: Layout, rows: NDArray[Any], missed: bool) -> FloatArray:
    """Return the measurements of rows in the heading frame, (N, 2), NaN where one is `missed`."""
    deviation = np.exp(0.5 * layout.read(rows, "log_noise"))[:, None]
    names = ("displacement_along", "displacement_across")
    measurements = deviation * np.stack([layout.read(rows, name) for name in names], axis=-1)
    if missed:
        measurements[without_measurement(layout, rows)] = np.nan
    return np.asarray(measurements)


def without_measurement(layout: Layout, rows: NDArray[Any]) -> BoolArray:
    """Return whether the ticks of rows have no measurement, (N,): then all innovations are exactly zero."""
    names = ("innovation_along", "innovation_across")
    return ~np.any([layout.read(rows, name).any(-1) for name in names], axis=0)


def in_world(sensed: FloatArray | None, anchors: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return measurements (N, 9), anchors (C, N, 14) in the frame of the world, and headings (N, 2).

    `sensed` is from `sensed_of`, (N, 15); the anchors are in the heading frame, see `component_filters.ANCHOR_COLUMNS`.
    """
    if sensed is None:
        raise reject("observation", "a row of the environment", "what `observe` returns, with sensors")
    measurements, origin, heading = np.split(sensed, np.cumsum(SENSED[:2]), axis=1)
    c, s = heading.T
    turn = np.zeros((len(heading), 4, 4))
    turn[:, range(4), range(4)] = c[:, None]
    turn[:, (0, 1), (2, 3)], turn[:, (2, 3), (0, 1)] = -s[:, None], s[:, None]
    turned = np.empty_like(anchors)
    turned[..., :4] = (turn @ anchors[..., :4, None])[..., 0] + origin * [1.0, 0.0, 1.0, 0.0]
    P = turn @ anchors[..., 4:][..., SQUARE] @ turn.swapaxes(1, 2)
    turned[..., 4:] = P[..., TRIANGLE[0], TRIANGLE[1]]
    return np.ascontiguousarray(measurements), turned, heading


def in_heading_frame(innovations: FloatArray, heading: FloatArray) -> FloatArray:
    """Return innovations (C, N, M, 3) along and across headings (N, 2)."""
    c, s = heading.T[..., None]
    x, y = innovations[..., 0], innovations[..., 1]
    return np.stack([c * x + s * y, c * y - s * x, innovations[..., 2]], axis=-1)
