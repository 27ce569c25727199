"""A decider that filters the measurements again, see `component_filters`, from a better start: the
distribution of the anchor error, see `anchor_errors`, or the covariance of the estimate at the
switch.
"""

from typing import Any, ClassVar, Literal

import numpy as np

from baselines.rules.anchor_errors import AnchorErrors
from baselines.rules.component_filters import Anchors, ComponentFilters, stated_anchors
from baselines.rules.decider import Answer, Decider, Observations, Variants
from baselines.rules.measurements import observe_sensed, split_sensed
from baselines.rules.msprt import ALPHAS, error_and_best
from hybrid_env.checks import BoolArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions


class RefilteringDecider(Decider):
    """MSPRT of filters that start from the distribution of the anchor error.

    Args:
        world: options of the world, whose model the filters use.
        alpha: threshold of the posterior error probability, above 0 and at most 1.
        robust: the filters reject outliers and learn whether tails are heavy.
        bank: their kind, extended Kalman filters or those of the published bank.
        propagates: the distribution is computed, with a component for each of the likeliest
            hypotheses of the last segment; False uses the covariance that the bank states.
    """

    name = "propagated"
    title = "propagated anchor"
    symbol = "alpha"
    thresholds = ALPHAS
    default = 0.02
    bounds = 1e-300, 1.0
    every_tick = True
    reads_options = True
    any_modes = False
    variants: ClassVar[Variants] = {
        "propagated-robust": {
            "title": "propagated anchor, robust",
            "arguments": lambda options: {"robust": True},
        },
        "msprt-kept": {
            "title": "MSPRT, kept P",
            "arguments": lambda options: {"bank": "published", "propagates": False},
        },
    }

    def __init__(
        self,
        world: WorldOptions,
        alpha: float = 0.02,
        robust: bool = False,
        bank: Literal["anchor_aware", "published"] = "anchor_aware",
        propagates: bool = True,
    ):
        super().__init__(alpha)
        self.world = world
        self.robust = robust
        self.bank = bank
        # The anchor of the oracle is the true state.
        self.propagates = propagates and world.bank != "oracle"
        self.components = AnchorErrors.components if self.propagates else 1
        self.layout = Layout(world.hypotheses)
        self.observes = "tracks" if world.sensors else "rows"

    def observe(self, tracks: Any) -> Observations:
        """See `Decider.observe`: with sensors also what they measured."""
        return observe_sensed(tracks)

    def begin(self, tracks: int) -> tuple[ComponentFilters, AnchorErrors | None]:
        """Return the state of N tracks before their first rows: filters, and the errors of anchors
        unless the filters start from the stated covariance.
        """
        world = self.world
        given = self.bank, self.components, tracks, world, self.robust, self.propagates
        errors = AnchorErrors(tracks, world) if self.propagates else None
        return ComponentFilters(*given), errors

    def anchors(
        self, state: Any, rows: Observations, begins: BoolArray, first: BoolArray
    ) -> Anchors:
        """Return the anchors of the n tracks that begin a segment. begins, first: (N,) of a
        segment, of an episode.
        """
        begun = np.flatnonzero(begins)
        anchors = stated_anchors(self.world, rows[begun], self.components)
        later = ~first[begun]
        filters, errors = state
        if errors is not None and later.any():
            tracks = begun[later]
            computed = errors.after(filters, rows[tracks], tracks)
            for values, of_later in zip(anchors, computed, strict=True):
                values[later] = of_later
        return anchors

    def decide(self, observation: Observations, state: Any, episode_start: Any) -> Answer:
        """See `Decider.decide`. The state holds the filters and is changed in place."""
        rows, sensed = split_sensed(self.layout, observation)
        tracks = len(rows)
        begins = np.rint(self.layout.read(rows, "ticks")) == 1
        first = np.zeros(tracks, bool) if episode_start is None else np.asarray(episode_start)
        if state is None:
            state = self.begin(tracks)
            begins[:] = first = np.ones(tracks, bool)
        filters, errors = state
        filters.advance(rows, begins, self.anchors(state, rows, begins, first), first, sensed)
        if errors is not None:
            errors.advance(rows, begins, sensed)
        error, best = error_and_best(filters.posterior.sum(0), self.world.groups)
        return np.where(error <= self.threshold, best + 1, 0), state

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished
        tracks.
        """
        return tuple(part and part.select_tracks(tracks) for part in state)
