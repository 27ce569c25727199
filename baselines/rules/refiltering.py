"""Deciders that run filters of their own on the measurements, see `component_filters`: one starts
the filters of the published bank from the covariance of the estimate at the switch, not from the
identity; the other extended Kalman filters (`hybrid_env.core.banks.anchor_aware`) from the
distribution of the anchor error.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from baselines.rules import component_filters
from baselines.rules.anchor_prior import AnchorPrior, anchor_errors, fit_anchor_prior
from baselines.rules.component_filters import ComponentFilters, anchor_rows, stated_covariance
from baselines.rules.decider import Actions, Decider, Observations
from baselines.rules.measurements import observe_sensed, split_sensed
from baselines.rules.msprt import ALPHAS, error_and_best, mode_types
from baselines.rules.rollout import rollout
from baselines.rules.seeds import FITTING
from hybrid_env.checks import BoolArray, FloatArray, check_number
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

CALIBRATION_EPISODES = 2000
# Error probability at which the decider declares in these episodes.
FITTED_ALPHA = 0.05


@dataclass
class _State:
    """What is known of N tracks with C components each."""

    filters: ComponentFilters
    # (N, C) logarithms of the weights of the components.
    log_weights: FloatArray
    # (N, M) of the last tick.
    posterior: FloatArray


class KeptCovarianceDecider(Decider):
    """MSPRT of the published bank started from the covariance of the estimate at the switch.

    Args:
        world: options of the world, whose model the filters use.
        alpha: threshold of the posterior error probability, above 0 and at most 1.
        robust: the filters reject outliers, learn whether tails are heavy and allow for axes of
            different variances.
    """

    name = "msprt-kept"
    title = "MSPRT, kept P"
    symbol = "alpha"
    thresholds = ALPHAS
    default = 0.02
    colour = "#0000b4"
    marker = ">"
    every_tick = reads_options = True
    bank: ClassVar[str] = "published"
    components: ClassVar[int] = 1

    def __init__(self, world: WorldOptions, alpha: float = 0.02, robust: bool = False):
        self.world, self.robust = world, robust
        self.alpha = check_number("alpha", alpha, "a number > 0 and <= 1", math.ulp(0.0), 1.0)
        self.by_type = world.correctness == "type"
        self.layout = Layout(world.hypotheses)
        self.observes = "tracks" if world.sensors else "rows"

    def observe(self, tracks: Any) -> Observations:
        """See `Decider.observe`: with sensors also what they measured."""
        return observe_sensed(tracks)

    def anchors(
        self,
        rows: Observations,
        first: BoolArray,
        correct: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return initial estimates with covariances, (C, N, 14), and weights, (N, C), from first
        rows of a segment. first: (N,) True for the first segment of an episode; correct: (N,)
        probability of a correct last declaration.
        """
        return anchor_rows(self.layout, rows, 0.0, stated_covariance(self.layout, rows))[
            None
        ], np.ones((len(rows), 1))

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state holds the filters and is changed in place."""
        layout = self.layout
        rows, sensed = split_sensed(layout, np.asarray(observation))
        tracks = len(rows)
        begins = np.rint(layout.read(rows, "ticks")) == 1
        if state is None:
            filters = ComponentFilters(self.bank, self.components, tracks, self.world, self.robust)
            M = self.world.hypotheses
            state = _State(
                filters,
                np.zeros((tracks, self.components)),
                np.full((tracks, M), 1.0 / M),
            )
            begins[:] = True
        first = np.zeros(tracks, np.bool_) if episode_start is None else np.asarray(episode_start)
        anchors = np.zeros((self.components, tracks, component_filters.ANCHOR_COLUMNS))
        log_weights = state.log_weights.copy()
        if begins.any():
            decided = layout.read(rows[begins], "previous").argmax(-1)
            correct = np.take_along_axis(state.posterior[begins], decided[:, None], 1)[:, 0]
            anchors[:, begins], weights = self.anchors(rows[begins], first[begins], correct)
            state.log_weights[begins] = np.log(np.maximum(weights, 1e-300))
        state.filters.advance(rows, begins, anchors, log_weights, first, sensed)
        state.posterior = component_filters.joint_posterior(
            state.filters.log_likelihood,
            state.log_weights,
        ).sum(0)
        error, best = error_and_best(state.posterior, self.by_type)
        return np.where(error <= self.alpha, best + 1, 0), state

    def select_tracks(self, state: _State, tracks: BoolArray) -> _State:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished
        tracks.
        """
        return _State(
            state.filters.select_tracks(tracks),
            state.log_weights[tracks],
            state.posterior[tracks],
        )


class CalibratedAnchorDecider(KeptCovarianceDecider):
    """MSPRT of extended Kalman filters, one bank per component of the distribution of the anchor
    error.

    Arguments as of `KeptCovarianceDecider`, and the distribution after correct and after wrong
    declarations, `prior`; None uses the covariance that the bank states.
    """

    name = "calibrated"
    title = "calibrated anchor"
    colour = "#00e196"
    marker = "p"
    bank = "anchor_aware"
    components = 4
    rejects_outliers: ClassVar[bool] = False

    def __init__(
        self,
        world: WorldOptions,
        prior: AnchorPrior | None,
        alpha: float = 0.02,
        robust: bool = False,
    ):
        super().__init__(world, alpha, robust)
        self.prior = prior

    @classmethod
    def maker(cls, options: WorldOptions) -> Callable[[float], Decider]:
        """Return the rule with the distribution of the anchor fitted to simulated episodes."""
        robust = cls.rejects_outliers
        prior = functools.cache(
            lambda: fit_calibrated_anchor(options, CALIBRATION_EPISODES, FITTING, robust)
        )
        return lambda alpha: CalibratedAnchorDecider(options, prior(), alpha, robust)

    def anchors(
        self,
        rows: Observations,
        first: BoolArray,
        correct: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """See `KeptCovarianceDecider.anchors`."""
        tracks = len(rows)
        weight = np.tile([1.0, 0.0, 0.0, 0.0], (tracks, 1))
        mean = np.zeros((tracks, 4, 4))
        covariance = np.repeat(stated_covariance(self.layout, rows)[:, None], 4, axis=1)
        later = np.flatnonzero(~first)
        if self.prior is not None and later.size:
            decided = self.layout.read(rows[later], "previous").argmax(-1)
            weights, means, covariances = self.prior.after(
                mode_types(self.world.hypotheses)[decided]
            )
            outcome = np.stack([correct[later], 1.0 - correct[later]], axis=1)
            weight[later] = (weights * outcome[..., None]).reshape(-1, 4)
            mean[later] = means.reshape(-1, 4, 4)
            covariance[later] = covariances.reshape(-1, 4, 4, 4)
        anchors = [anchor_rows(self.layout, rows, mean[:, k], covariance[:, k]) for k in range(4)]
        return np.stack(anchors), weight


class RobustCalibratedAnchorDecider(CalibratedAnchorDecider):
    """The same with filters that reject outliers."""

    name = "calibrated-robust"
    title = "calibrated anchor, robust"
    colour = "#0f961e"
    marker = "8"
    rejects_outliers = True


def fit_calibrated_anchor(
    world: WorldOptions,
    episodes: int,
    seed: int,
    robust: bool = False,
) -> AnchorPrior:
    """Fit the distribution of the anchor error to simulated episodes, in which the decider
    itself declares.

    The first of two rounds of episodes declares with the stated covariance, the second with the
    first fit.
    """
    prior: AnchorPrior | None = None
    # A segment decided at once, and the first tick of the next.
    rows = world.longest_segment + 1
    for first in (seed, seed + episodes):
        # The decider declares hypotheses.
        options = {**vars(world), "actions": "all"}
        env = HybridTrackVectorEnv(episodes, trace_rows=rows, **options)
        decider = CalibratedAnchorDecider(world, prior, FITTED_ALPHA, robust)
        running = np.ones(episodes, np.bool_)
        errors = []
        types = []
        correct = []
        truth = np.empty(0)
        for now in rollout(env, decider, first):
            if now.step:
                running &= ~now.terminated
                decided = np.flatnonzero(running & now.info.get("_decided_mode", False))
                if decided.size:
                    modes = now.info["decided_mode"][decided]
                    errors.append(anchor_errors(env, decided, truth[decided]))
                    types.append(mode_types(world.hypotheses)[modes])
                    correct.append(modes == now.info["decided_true_mode"][decided])
            if not running.any():
                break
            truth = env.world.field("truth")
        prior = fit_anchor_prior(*(np.concatenate(found) for found in (errors, types, correct)))
    assert prior is not None
    return prior
