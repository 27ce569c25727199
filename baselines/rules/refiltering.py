"""A decider that filters the measurements again, see `component_filters`, from a better start: the
covariance of the estimate at the switch, or the distribution of the anchor error.
"""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from baselines.rules import component_filters
from baselines.rules.anchor_prior import AnchorPrior, anchor_errors, fit_anchor_prior
from baselines.rules.component_filters import ComponentFilters, anchor_rows, stated_covariance
from baselines.rules.decider import Answer, Decider, Observations, Variants
from baselines.rules.measurements import observe_sensed, split_sensed
from baselines.rules.msprt import ALPHAS, error_and_best, mode_types
from baselines.rules.rollout import rollout
from baselines.rules.seeds import FITTING
from hybrid_env.checks import AnyArray, BoolArray, FloatArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

CALIBRATION_EPISODES = 2000


@dataclass
class _State:
    """What is known of N tracks with C components each."""

    filters: ComponentFilters
    # (N, C) logarithms of the weights of the components.
    log_weights: FloatArray
    # (N, M) of the last tick.
    posterior: FloatArray


class RefilteringDecider(Decider):
    """MSPRT of filters that start from the distribution of the anchor error.

    Args:
        world: options of the world, whose model the filters use.
        alpha: threshold of the posterior error probability, above 0 and at most 1.
        robust: the filters reject outliers, learn whether tails are heavy and allow for axes of
            different variances.
        bank: their kind, extended Kalman filters or those of the published bank.
        prior: the distribution after correct and after wrong declarations; "fitted" fits it to
            simulated episodes at the first use, None uses the covariance that the bank states.
    """

    name = "calibrated"
    title = "calibrated anchor"
    symbol = "alpha"
    thresholds = ALPHAS
    default = 0.02
    bounds = 1e-300, 1.0
    every_tick = True
    reads_options = True
    variants: ClassVar[Variants] = {
        "calibrated-robust": {
            "title": "calibrated anchor, robust",
            "arguments": lambda options: {"robust": True},
        },
        "msprt-kept": {
            "title": "MSPRT, kept P",
            "arguments": lambda options: {"bank": "published", "prior": None},
        },
    }

    def __init__(
        self,
        world: WorldOptions,
        alpha: float = 0.02,
        robust: bool = False,
        bank: Literal["anchor_aware", "published"] = "anchor_aware",
        prior: AnchorPrior | Literal["fitted"] | None = "fitted",
    ):
        super().__init__(alpha)
        self.world = world
        self.robust = robust
        self.bank = bank
        self.prior = prior
        self.components = 1 if prior is None else 4
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
        tracks = len(rows)
        C = self.components
        weight = np.zeros((tracks, C))
        weight[:, 0] = 1.0
        mean = np.zeros((tracks, C, 4))
        covariance = np.repeat(stated_covariance(self.layout, rows)[:, None], C, axis=1)
        later = np.flatnonzero(~first)
        if self.prior is not None and later.size:
            prior = self.prior
            if prior == "fitted":
                prior = fit_calibrated_anchor(
                    self.world, CALIBRATION_EPISODES, FITTING, self.robust
                )
            decided = self.layout.read(rows[later], "previous").argmax(-1)
            types = mode_types(self.world.hypotheses)[decided]
            weight[later], mean[later], covariance[later] = prior.after(types, correct[later])
        return anchor_rows(self.layout, rows, mean, covariance), weight

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> Answer:
        """See `Decider.decide`. The state holds the filters and is changed in place."""
        layout = self.layout
        rows, sensed = split_sensed(layout, observation)
        tracks = len(rows)
        begins = np.rint(layout.read(rows, "ticks")) == 1
        if state is None:
            M = self.world.hypotheses
            state = _State(
                ComponentFilters(self.bank, self.components, tracks, self.world, self.robust),
                np.zeros((tracks, self.components)),
                np.full((tracks, M), 1.0 / M),
            )
            begins[:] = True
        first = np.zeros(tracks, bool) if episode_start is None else np.asarray(episode_start)
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
        return np.where(error <= self.threshold, best + 1, 0), state

    def select_tracks(self, state: _State, tracks: BoolArray) -> _State:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished
        tracks.
        """
        return _State(
            state.filters.select_tracks(tracks),
            state.log_weights[tracks],
            state.posterior[tracks],
        )


@functools.lru_cache(8)
def fit_calibrated_anchor(
    world: WorldOptions,
    episodes: int,
    seed: int,
    robust: bool = False,
    alpha: float = 0.05,
) -> AnchorPrior:
    """Fit the distribution of the anchor error to simulated episodes, in which the decider
    itself declares at an error probability alpha.

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
        decider = RefilteringDecider(world, alpha, robust, prior=prior)
        running = np.ones(episodes, bool)
        declared: list[tuple[AnyArray, ...]] = []
        truth = np.empty(0)
        for now in rollout(env, decider, first):
            if now.step:
                running &= ~now.terminated
                decided = np.flatnonzero(running & now.info.get("_decided_mode", False))
                if decided.size:
                    modes = now.info["decided_mode"][decided]
                    errors = anchor_errors(env, decided, truth[decided])
                    correct = modes == now.info["decided_true_mode"][decided]
                    declared.append((errors, mode_types(world.hypotheses)[modes], correct))
            if not running.any():
                break
            truth = env.world.field("truth")
        prior = fit_anchor_prior(*map(np.concatenate, zip(*declared, strict=True)))
    assert prior is not None
    return prior
