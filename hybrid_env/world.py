"""The arrays of N tracks and the calls into the kernel; environments are views of it."""

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from hybrid_env import bank, kernel
from hybrid_env.observation import LOG_FLOOR, LOG_SCALE, TICK_SCALE, Layout
from hybrid_env.options import WorldOptions
from hybrid_env.track import TRACE_COLUMNS, TRACK

TICK_INFO = ("segment", "tick", "true_mode", "truth", "measurement", "anchor", "estimate")
"""Fields of `TRACK` that describe the present tick; `log_likelihood` goes with them."""

DECISION_INFO = (
    "decided_mode",
    "decided_true_mode",
    "correct",
    "type_correct",
    "ticks",
    "forced",
    "decided_length",
    "decided_squared_error",
)
"""Fields of `TRACK` that describe the decision made in this step."""


class World:
    """State of N tracks under one set of options.

    Args:
        options: of the model.
        tracks: N.
        trace_rows: ticks of one step that are kept for rendering and recording, 0 for none.
    """

    def __init__(self, options: WorldOptions, tracks: int, trace_rows: int = 0):
        self.options = options
        self.layout = Layout(options.hypotheses)
        radii = np.array(options.radii)
        variances = options.variances
        self.tracks = np.zeros(tracks, TRACK)
        self.filters, motion, gains = bank.bank_arrays(tracks, radii.size, variances.size)
        self.trace = np.zeros((tracks, trace_rows, len(TRACE_COLUMNS)))
        self.observations = np.zeros((tracks, self.layout.width), np.float32)
        self.rewards = np.zeros(tracks)
        self.seeded = np.zeros(tracks, np.bool_)
        self._waiting = np.zeros(tracks, np.int64)
        self._arrays = (
            self.tracks, self.filters, motion, gains, options.parameters(), radii, variances,
            options.table, self.trace, self.observations, self.rewards,
        )  # fmt: skip

    @property
    def log_likelihood(self) -> NDArray[np.float64]:
        """(N, M) cumulative since the switch, a view."""
        return self.filters[:, bank.LOG_LIKELIHOOD]

    @property
    def nbytes(self) -> int:
        """Memory of all tracks [bytes]."""
        motion, gains = self._arrays[2], self._arrays[3]
        arrays = (self.tracks, self.filters, motion, gains, self.observations, self.rewards, self.trace)
        return sum(array.nbytes for array in arrays)

    def seed(self, track: int, generator: np.random.Generator) -> None:
        """Start the random stream of one track from a generator."""
        self.tracks["random_state"][track] = generator.integers(1, 2**64, 4, dtype=np.uint64)
        self.seeded[track] = True

    def reset(self, mask: NDArray[np.bool_]) -> None:
        """Begin a new episode on the tracks of the mask, (N,)."""
        kernel.advance_tracks(True, mask, self._waiting, *self._arrays)

    def step(self, actions: NDArray[np.int64]) -> int:
        """One step of every track; a terminated one begins its next episode. actions: (N,) int64, contiguous.

        Returns:
            `kernel.DECIDED` if any track made a decision, plus `kernel.TERMINATED` if any terminated.

        Raises:
            InvalidAction: nothing has been done then.
        """
        events: int = kernel.advance_tracks(False, self.seeded, actions, *self._arrays)
        if events < 0:
            raise self.invalid_action(int(actions[-1 - events]))
        return events

    def traced(self, track: int) -> NDArray[np.float64]:
        """The ticks of the last call, (ticks, len(TRACE_COLUMNS))."""
        return self.trace[track, : self.tracks["traced"][track]].copy()

    def observation_space(self) -> spaces.Box:
        """The space of one row; finite bounds wherever the quantity has one."""
        unbounded = float(np.finfo(np.float32).max)
        low = np.full(self.layout.width, -unbounded, np.float32)
        high = np.full(self.layout.width, unbounded, np.float32)
        bounds: dict[str, tuple[float, float]] = {
            "log_ratio": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_doubt": (LOG_SCALE * LOG_FLOOR, 0.0),
            "log_variance": (0.0, unbounded),
            "previous": (0.0, 1.0),
            "ticks": (0.0, TICK_SCALE * self.options.longest_segment * (1 + 1e-6)),
            "ticks_left": (0.0, TICK_SCALE * self.options.longest_segment * (1 + 1e-6)),
            "speed": (0.0, unbounded),
            "anchor_xx": (0.0, unbounded),
            "anchor_vv": (0.0, unbounded),
        }
        for name, (lowest, highest) in bounds.items():
            low[self.layout.slices[name]] = lowest
            high[self.layout.slices[name]] = highest
        return spaces.Box(low, high, dtype=np.float32)

    def action_space(self) -> spaces.Discrete:
        """Wait, or declare."""
        return spaces.Discrete(self.options.action_count)

    def invalid_action(self, action: Any) -> Exception:
        """The error for an action outside the space."""
        last = self.options.action_count - 1
        return gym.error.InvalidAction(
            f"action={action!r} is not allowed: expected an integer from 0 (wait) to {last}"
        )
