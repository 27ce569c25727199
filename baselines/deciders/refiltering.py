"""Deciders that run filters of their own on the measurements, which they recover from the observation.

The environment reports the measurement relative to the anchor, in the heading frame of the anchor. In this
frame the anchor is at the origin and its velocity is (speed, 0), so that the observation determines
everything that a filter needs except the model, which is that of the world.

`KeptCovarianceDecider` starts the filters of the published bank from the covariance of the estimate at the
switch, not from the identity. `CalibratedAnchorDecider` starts extended Kalman filters, which include the
uncertainty of the anchor in the state (see `hybrid_env.core.anchor_aware_bank`), from the distribution of the
anchor error that was found in simulated episodes (see `anchor_prior`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.anchor_prior import AnchorPrior, fit_anchor_prior
from baselines.deciders.decider import Actions, Observations
from baselines.deciders.msprt import likeliest_of_type, mode_types, other_types_sum, type_sums
from hybrid_env.checks import check_number, reject
from hybrid_env.core import bank_operations
from hybrid_env.core.compilation import compiled, prepare
from hybrid_env.core.kernels import BANKS
from hybrid_env.core.published_bank import FilterModel
from hybrid_env.core.records import LANES, TRACE_COLUMNS
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.vector_env import HybridTrackVectorEnv

FloatArray = NDArray[np.float64]
TRIANGLE = np.triu_indices(4)


@compiled
def _filter_tick(
    banks: Any,
    begins: NDArray[np.bool_],
    anchors: FloatArray,
    measurements: FloatArray,
    radii: FloatArray,
    model: FilterModel,
    log_likelihood: FloatArray,
) -> None:
    """Start the filters of some tracks, then advance all by one tick.

    Args:
        banks: banks of all blocks of tracks.
        begins: (N,) tracks whose filters start.
        anchors: (N, 14) initial estimate and upper triangle of its covariance.
        measurements: (N, 2) [m].
        radii: (n,) [m].
        model: model of the filters.
        log_likelihood: (N, M), written in place.
    """
    measurement = np.zeros((2, LANES))
    for b in range(banks.hypotheses.shape[0]):
        bank = bank_operations.bank_of_block(banks, b)
        lanes = min(LANES, begins.size - b * LANES)
        for lane in range(lanes):
            i = b * LANES + lane
            if begins[i]:
                a = anchors[i]
                anchor = (a[0], a[1], a[2], a[3])
                covariance = (a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11], a[12], a[13])
                bank_operations.begin(bank, lane, anchor, covariance, radii, model)
            measurement[0, lane], measurement[1, lane] = measurements[i, 0], measurements[i, 1]
        bank_operations.step(bank, 0, lanes, measurement, model)
        for lane in range(lanes):
            for h in range(bank.hypotheses.size):
                log_likelihood[b * LANES + lane, h] = bank.hypotheses[h].log_likelihood[lane]


class _Filters:
    """One bank per track, and the log-likelihood of every hypothesis."""

    def __init__(self, bank: str, tracks: int, world: WorldOptions):
        self.radii = np.array(world.radii)
        variance = float(np.exp(np.log(world.variances).mean()))
        self.model = FilterModel(world.tau, world.process_variance, variance, variance)
        self.banks = BANKS[bank](self.radii.size, 1, -(-tracks // LANES))
        self.log_likelihood = np.zeros((tracks, world.hypotheses))
        none = np.zeros(0, np.bool_), np.zeros((0, 14)), np.zeros((0, 2))
        prepare(_filter_tick, self.banks, *none, self.radii, self.model, self.log_likelihood)

    def advance(self, begins: NDArray[np.bool_], anchors: FloatArray, measurements: FloatArray) -> None:
        """See `_filter_tick`."""
        _filter_tick(self.banks, begins, anchors, measurements, self.radii, self.model, self.log_likelihood)


@dataclass
class _State:
    """Filters of N tracks, one for each component of the distribution of the anchor.

    Attributes:
        components: the filters.
        log_weights: (N, C) logarithm of the weight of each component.
        posterior: (N, M) posterior of the last row.
    """

    components: list[_Filters]
    log_weights: FloatArray
    posterior: FloatArray


class RefilteringDecider:
    """Base class: declares when the posterior error probability of the filters falls to alpha.

    Args:
        world: options of the world; the filters use its model.
        alpha: threshold of the error probability, above 0 and at most 1.

    Raises:
        ArgumentError: an argument has a value that is not allowed.
    """

    bank: str
    components: int

    def __init__(self, world: WorldOptions, alpha: float = 0.02):
        self.world = world
        self.alpha = check_number("alpha", alpha)
        if not 0.0 < self.alpha <= 1.0:
            raise reject("alpha", alpha, "a number > 0 and <= 1")
        self.by_type = world.correctness == "type"
        self.layout = Layout(world.hypotheses)

    def anchors(
        self, rows: Observations, first: NDArray[np.bool_], correct: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return initial estimates with covariances, (C, N, 14), and weights, (N, C).

        Args:
            rows: (N, width) first rows of a segment.
            first: (N,) True for the first segment of an episode.
            correct: (N,) probability that the last declaration was correct.
        """
        raise NotImplementedError

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """See `Decider.predict`. The state holds the filters and is changed in place."""
        rows = np.asarray(observation)
        tracks, layout = len(rows), self.layout
        ticks = np.rint(layout.read(rows, "ticks")).astype(np.int64)
        begins = ticks == 1
        if state is None:
            filters = [_Filters(self.bank, tracks, self.world) for _ in range(self.components)]
            shape = (tracks, self.world.hypotheses)
            state = _State(filters, np.zeros((tracks, self.components)), np.full(shape, 1.0 / shape[1]))
            begins[:] = True
        first = np.zeros(tracks, np.bool_) if episode_start is None else np.asarray(episode_start)
        anchors = np.zeros((self.components, tracks, 14))
        if begins.any():
            decided = layout.read(rows[begins], "previous").argmax(-1)
            correct = np.take_along_axis(state.posterior[begins], decided[:, None], 1)[:, 0]
            anchors[:, begins], weights = self.anchors(rows[begins], first[begins], correct)
            state.log_weights[begins] = np.log(np.maximum(weights, 1e-300))
        deviation = np.exp(0.5 * layout.read(rows, "log_noise"))[:, None]
        names = ("displacement_along", "displacement_across")
        measurements = deviation * np.stack([layout.read(rows, name) for name in names], axis=-1)
        for filters, anchor in zip(state.components, anchors, strict=True):
            filters.advance(begins, anchor, measurements)
        joint = np.stack([filters.log_likelihood for filters in state.components], axis=1)
        joint += state.log_weights[..., None]
        likelihood = np.exp(joint - joint.max((1, 2), keepdims=True)).sum(1)
        state.posterior = likelihood / likelihood.sum(-1, keepdims=True)
        return self._declare(state.posterior), state

    def _declare(self, posterior: FloatArray) -> Actions:
        if self.by_type:
            types = type_sums(posterior)
            error, best = other_types_sum(types, types.argmax(-1)), likeliest_of_type(types, posterior)
        else:
            best = posterior.argmax(-1)
            error = np.where(np.arange(posterior.shape[1]) == best[:, None], 0.0, posterior).sum(-1)
        return np.where(error <= self.alpha, best + 1, 0)


def _anchor_rows(
    layout: Layout, rows: Observations, mean: FloatArray | float, covariance: FloatArray
) -> FloatArray:
    """Return the estimate in the heading frame with its covariance, (N, 14).

    Args:
        layout: layout of the rows.
        rows: (N, width).
        mean: (N, 4) mean error.
        covariance: (N, 4, 4).
    """
    anchors = np.zeros((len(rows), 14))
    anchors[:, 1] = layout.read(rows, "speed")
    anchors[:, :4] += mean
    anchors[:, 4:] = covariance[:, TRIANGLE[0], TRIANGLE[1]]
    return anchors


def stated_covariance(layout: Layout, rows: Observations) -> FloatArray:
    """Return the covariance of the anchor as stated by the bank, (N, 4, 4), the mean over the axes."""
    noise = np.exp(layout.read(rows, "log_noise"))
    xx, xv, vv = (noise * layout.read(rows, name) for name in ("anchor_xx", "anchor_xv", "anchor_vv"))
    covariance = np.zeros((len(rows), 4, 4))
    for k in (0, 2):
        covariance[:, k, k], covariance[:, k + 1, k + 1] = xx, vv
        covariance[:, k, k + 1] = covariance[:, k + 1, k] = xv
    return covariance


class KeptCovarianceDecider(RefilteringDecider):
    """MSPRT of the published bank started from the covariance of the estimate at the switch."""

    bank = "published"
    components = 1

    def anchors(
        self, rows: Observations, first: NDArray[np.bool_], correct: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `RefilteringDecider.anchors`."""
        covariance = stated_covariance(self.layout, rows)
        return _anchor_rows(self.layout, rows, 0.0, covariance)[None], np.ones((len(rows), 1))


class CalibratedAnchorDecider(RefilteringDecider):
    """MSPRT of extended Kalman filters, one bank per component of the distribution of the anchor error.

    Args:
        world: see `RefilteringDecider`.
        prior: distribution of the anchor error after correct and after wrong declarations; None uses the
            covariance that the bank states.
        alpha: see `RefilteringDecider`.
    """

    bank = "anchor_aware"
    components = 4

    def __init__(self, world: WorldOptions, prior: AnchorPrior | None, alpha: float = 0.02):
        super().__init__(world, alpha)
        self.prior = prior

    def anchors(
        self, rows: Observations, first: NDArray[np.bool_], correct: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """See `RefilteringDecider.anchors`."""
        tracks = len(rows)
        weight = np.tile([1.0, 0.0, 0.0, 0.0], (tracks, 1))
        mean = np.zeros((tracks, 4, 4))
        covariance = np.repeat(stated_covariance(self.layout, rows)[:, None], 4, axis=1)
        later = np.flatnonzero(~first)
        if self.prior is not None and later.size:
            decided = self.layout.read(rows[later], "previous").argmax(-1)
            weights, means, covariances = self.prior.after(mode_types(self.world.hypotheses)[decided])
            outcome = np.stack([correct[later], 1.0 - correct[later]], axis=1)
            weight[later] = (weights * outcome[..., None]).reshape(-1, 4)
            mean[later] = means.reshape(-1, 4, 4)
            covariance[later] = covariances.reshape(-1, 4, 4, 4)
        anchors = [_anchor_rows(self.layout, rows, mean[:, k], covariance[:, k]) for k in range(4)]
        return np.stack(anchors), weight


def fit_calibrated_anchor(
    world: WorldOptions,
    episodes: int,
    seed: int,
    rounds: int = 2,
    alpha: float = 0.05,
    on_progress: Callable[[float], None] | None = None,
) -> AnchorPrior:
    """Fit the distribution of the anchor error to simulated episodes, in which the decider itself declares.

    Args:
        world: options of the world.
        episodes: simulated episodes per round.
        seed: of the first episode.
        rounds: the first round declares with the stated covariance, later rounds with the last fit.
        alpha: error probability at which the decider declares.
        on_progress: called with the finished share.
    """
    prior: AnchorPrior | None = None
    for k in range(rounds):
        decider = CalibratedAnchorDecider(world, prior, alpha)
        prior = fit_anchor_prior(*_anchor_errors(decider, episodes, seed + k * episodes))
        if on_progress is not None:
            on_progress((k + 1) / rounds)
    assert prior is not None
    return prior


def _anchor_errors(
    decider: RefilteringDecider, episodes: int, seed: int
) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.bool_]]:
    """Return the errors at the switches of simulated episodes; see `fit_anchor_prior`."""
    world = decider.world
    rows = world.longest_segment + 1  # a segment decided at once, and the first tick of the next
    env = HybridTrackVectorEnv(episodes, tick_info=False, trace_rows=rows, **vars(world))
    columns = [TRACE_COLUMNS.index(name) for name in ("x", "vx", "y", "vy")]
    observation, _ = env.reset(seed=seed)
    state: Any = None
    start = np.ones(episodes, np.bool_)
    running = np.ones(episodes, np.bool_)
    errors, types, correct = [], [], []
    while running.any():
        actions, state = decider.predict(observation, state, start)
        observation, _, start, _, info = env.step(actions)
        running &= ~start
        decided = np.flatnonzero(running & info.get("_decided_mode", False))
        if decided.size:
            last = env.world.field("trace_length")[decided] - 2  # the last tick of the segment
            anchor = env.world.field("anchor")[decided]
            errors.append(_in_heading_frame(env.world.trace[decided, last][:, columns] - anchor, anchor))
            types.append(mode_types(world.hypotheses)[info["decided_mode"][decided]])
            correct.append(info["decided_mode"][decided] == info["decided_true_mode"][decided])
    return np.concatenate(errors), np.concatenate(types), np.concatenate(correct)


def _in_heading_frame(errors: FloatArray, anchor: FloatArray) -> FloatArray:
    """Return the components of errors [x, vx, y, vy] along and across the heading of the anchor, (n, 4)."""
    along = anchor[:, [1, 3]] / np.maximum(np.hypot(anchor[:, 1], anchor[:, 3]), 1e-300)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    position, velocity = errors[:, [0, 2]], errors[:, [1, 3]]
    return np.stack(
        [(part * axis).sum(-1) for axis in (along, across) for part in (position, velocity)], axis=-1
    )
