"""The layouts of the observations that `core.observation_row` writes."""

import functools
from typing import ClassVar, Self

import numpy as np

from hybrid_env.checks import AnyArray, FloatArray, check_integer, reject
from hybrid_env.core.observation_row import LENGTH_SCALE, LOG_SCALE, TICK_SCALE, VELOCITY_SCALE


class Layout:
    """Position and scale of each quantity in an observation of `HybridTrackEnv` with M hypotheses.

    Attributes:
        hypothesis_features: names of the blocks of M values, in order, and their scales.
        track_features: names of the scalars after them, in order, and their scales.
        height_features: the same of further values at the end of the row, with modes that climb or
            descend.

    >>> layout = Layout(3)
    >>> layout.width
    29
    >>> repr(layout)[:50]
    'Layout(3): log_ratio 0:3, innovation_along 3:6, in'
    >>> layout.read(np.zeros((5, 29), np.float32), "log_ratio").shape
    (5, 3)
    """

    hypothesis_features: ClassVar[dict[str, float]] = {
        "log_ratio": LOG_SCALE,
        "innovation_along": 1.0,
        "innovation_across": 1.0,
        "log_variance": 1.0,
        "previous": 1.0,
        "turn_angle": 1.0,
    }
    track_features: ClassVar[dict[str, float]] = {
        "ticks": TICK_SCALE,
        "ticks_left": TICK_SCALE,
        "log_error_probability": LOG_SCALE,
        "speed": 1.0,
        "displacement_along": LENGTH_SCALE,
        "displacement_across": LENGTH_SCALE,
        "anchor_xx": 1.0,
        "anchor_xv": VELOCITY_SCALE,
        "anchor_vv": VELOCITY_SCALE**2,
        "log_noise": 1.0,
        "measured": 1.0,
    }
    height_features: ClassVar[dict[str, float]] = {
        "innovation_up": 1.0,
        "log_variance_up": 1.0,
        "climb": 1.0,
    }

    def __init__(self, hypotheses: int, climbs: bool = False):
        self.hypotheses = check_integer("hypotheses", hypotheses, minimum=2)
        self.slices: dict[str, slice] = {}
        self.scales = self.scales_by_name() | (self.height_features if climbs else {})
        blocks = (*self.hypothesis_features, "innovation_up", "log_variance_up")
        start = 0
        for name in self.scales:
            size = hypotheses if name in blocks else 1
            self.slices[name] = slice(start, start + size)
            start += size
        self.width = start

    @classmethod
    def scales_by_name(cls) -> dict[str, float]:
        """Return the scale of every quantity of the plane by its name, in the order of the row."""
        return cls.hypothesis_features | cls.track_features

    @classmethod
    @functools.cache
    def of_width(cls, width: int) -> Self:
        """Return the layout of observations of a given width, one of the plane if there are two,
        which is not so for `Layout` and `QuickestLayout`. Raises `ArgumentError` if there is none.
        """
        for climbs in (False, True):
            least, step = cls(2, climbs).width, cls(3, climbs).width - cls(2, climbs).width
            # Without blocks the width does not depend on the number of hypotheses.
            more, rest = divmod(width - least, step) if step else (1, width - least)
            if not rest and more >= 0:
                return cls(2 + more, climbs)
        blocks, singles = len(cls.hypothesis_features), len(cls.track_features)
        raise reject("width", width, f"{blocks} M + {singles} for M = 2, 3, 4, ... hypotheses")

    @classmethod
    def of_rows(cls, observation: AnyArray) -> Self:
        """Return the layout of a batch of observations, (N, width). Raises `ArgumentError`
        otherwise.
        """
        rows = np.asarray(observation)
        if rows.ndim != 2:
            raise reject("observation shape", rows.shape, "(N, width), one row per track")
        return cls.of_width(rows.shape[1])

    def __repr__(self) -> str:
        places = (f"{name} {place.start}:{place.stop}" for name, place in self.slices.items())
        return f"{type(self).__name__}({self.hypotheses}): {', '.join(places)}"

    def read(self, observation: AnyArray, name: str) -> FloatArray:
        """Return a quantity without its scale, (..., M) per hypothesis or (...) per track.

        Args:
            observation: one or more observations, (..., width).
            name: a key of `hypothesis_features`, `track_features` or `height_features`.
        """
        if not isinstance(name, str) or name not in self.slices:
            raise reject("name", name, "one of " + ", ".join(self.slices))
        rows = np.asarray(observation)
        if rows.ndim == 0 or rows.shape[-1] != self.width:
            raise reject("observation shape", rows.shape, f"(..., {self.width})")
        values = rows[..., self.slices[name]].astype(float) / self.scales[name]
        return values if values.shape[-1] > 1 else values[..., 0]


class QuickestLayout(Layout):
    """Position and scale of each quantity in an observation of `HybridTrackQuickestEnv`; see
    `Layout`.
    """

    hypothesis_features: ClassVar[dict[str, float]] = {
        "log_probability": LOG_SCALE,
        "log_ratio": 1.0,
        "innovation_along": 1.0,
        "innovation_across": 1.0,
        "log_variance": 1.0,
        "stated": 1.0,
    }
    track_features: ClassVar[dict[str, float]] = {
        "speed": 1.0,
        "stated_ticks": TICK_SCALE,
        "measured": 1.0,
    }


class RawLayout(Layout):
    """Position and scale of each quantity in an observation with `observation="raw"`; see
    `Layout`.
    """

    hypothesis_features: ClassVar[dict[str, float]] = {}
    track_features: ClassVar[dict[str, float]] = {
        "displacement_along": LENGTH_SCALE,
        "displacement_across": LENGTH_SCALE,
        "measured": 1.0,
        "ticks": TICK_SCALE,
        "ticks_left": TICK_SCALE,
        "speed": 1.0,
        "log_noise": 1.0,
    }
    height_features: ClassVar[dict[str, float]] = {"displacement_up": LENGTH_SCALE}


class StateLayout(Layout):
    """Position and scale of each quantity in an observation with `observation="state"`; see
    `Layout`.
    """

    hypothesis_features: ClassVar[dict[str, float]] = {"true_mode": 1.0}
    track_features: ClassVar[dict[str, float]] = {
        "position_along": LENGTH_SCALE,
        "position_across": LENGTH_SCALE,
        "velocity_along": 1.0,
        "velocity_across": 1.0,
        "ticks": TICK_SCALE,
        "ticks_left": TICK_SCALE,
        "log_noise": 1.0,
    }
    height_features: ClassVar[dict[str, float]] = {}


class InnovationsLayout(Layout):
    """Position and scale of each quantity in an observation with `observation="innovations"`; see
    `Layout`.
    """

    hypothesis_features: ClassVar[dict[str, float]] = {
        "innovation_along": 1.0,
        "innovation_across": 1.0,
        "previous": 1.0,
    }
    track_features: ClassVar[dict[str, float]] = {
        "ticks": TICK_SCALE,
        "ticks_left": TICK_SCALE,
        "measured": 1.0,
    }
    height_features: ClassVar[dict[str, float]] = {"innovation_up": 1.0}
