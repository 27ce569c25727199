"""Distribution of the error of the anchor, the estimate at a switch, as found in simulated
episodes. After a correct and after a wrong declaration it is a mixture of two normal distributions
each, because most anchors are accurate, but an error can last for several segments. It is in the
heading frame of the anchor, by the declared type of motion; left and right turns are mirror images.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from hybrid_env.checks import BoolArray, FloatArray, IntArray
from hybrid_env.compiled import TRACE_COLUMNS
from hybrid_env.vector_env import HybridTrackVectorEnv

TRUTH = [TRACE_COLUMNS.index(name) for name in ("x", "vx", "y", "vy")]
# Signs of [x, vx, y, vy] in a frame whose across axis points to the right.
MIRROR = np.array([1.0, 1.0, -1.0, -1.0])


@dataclass(frozen=True)
class AnchorPrior:
    """Mixtures of (true state - anchor) in the heading frame, [x, vx, y, vy] [m, m/s]; after right
    turns mirrored. Axes: declared type (straight, turn), outcome of the declaration (correct,
    wrong), component.
    """

    # (2, 2, 2), the sum over components is 1.
    weight: FloatArray
    # (2, 2, 2, 4)
    mean: FloatArray
    # (2, 2, 2, 4, 4)
    covariance: FloatArray

    def after(
        self,
        types: IntArray,
        correct: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return weights (N, 4), means (N, 4, 4) and covariances (N, 4, 4, 4) of both outcomes,
        correct first, after declarations of `mode_types`, (N,), correct with probabilities (N,).
        """
        turn = np.minimum(types, 1)
        signs = np.where((types == 2)[:, None], MIRROR, 1.0)[:, None]
        outcome = np.stack([correct, 1.0 - correct], axis=1)
        mean = self.mean[turn].reshape(-1, 4, 4) * signs
        covariance = self.covariance[turn].reshape(-1, 4, 4, 4)
        weight = (self.weight[turn] * outcome[..., None]).reshape(-1, 4)
        return weight, mean, covariance * signs[..., None] * signs[..., None, :]


def anchor_errors(env: HybridTrackVectorEnv, tracks: IntArray, before: FloatArray) -> FloatArray:
    """Return (true state - anchor) of tracks that have just been switched, (n, 4), in the heading
    frame. `env` has a trace longer than the longest segment; `before` are the true states before
    the step, (n, 4).
    """
    # The last tick of the segment.
    last = env.world.field("trace_length")[tracks] - 2
    anchor = env.world.field("anchor")[tracks]
    truth = np.where((last < 0)[:, None], before, env.world.trace[tracks, last][:, TRUTH])
    errors = truth - anchor
    along = anchor[:, [1, 3]] / np.maximum(np.hypot(anchor[:, 1], anchor[:, 3]), 1e-300)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=-1)
    position = errors[:, [0, 2]]
    velocity = errors[:, [1, 3]]
    return np.stack(
        [(part * axis).sum(-1) for axis in (along, across) for part in (position, velocity)],
        axis=-1,
    )


def fit_anchor_prior(
    errors: FloatArray,
    types: IntArray,
    correct: BoolArray,
) -> AnchorPrior:
    """Fit the mixtures to errors (n, 4) in the heading frame, by declared types (n,) and their
    correctness (n,).

    With fewer than 100 errors for a mixture, types and then outcomes are pooled.
    """
    mirrored = errors * np.where((types == 2)[:, None], MIRROR, 1.0)
    fits = []
    for turn, outcome in itertools.product((False, True), (True, False)):
        chosen = (correct == outcome) & ((types > 0) == turn)
        for pooled in (correct == outcome, np.ones_like(correct)):
            chosen = chosen if chosen.sum() >= 100 else pooled
        values = mirrored[chosen]
        # Straight: symmetric.
        fits.append(_fit_mixture(values if turn else np.concatenate([values, values * MIRROR])))
    weight, mean, covariance = (
        np.array(part).reshape(2, 2, *np.shape(part)[1:]) for part in zip(*fits, strict=True)
    )
    return AnchorPrior(weight, mean, covariance)


def _fit_mixture(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit a mixture to (n, 4) values by the EM algorithm, from the tenth that is largest as one
    component.
    """
    pooled = np.diag(np.median(values**2, axis=0) + 1e-300)
    size = (values**2 / np.diag(pooled)).sum(-1)
    large = size > np.quantile(size, 0.9)
    share = np.stack([~large, large], axis=-1).astype(float)
    for _ in range(50):
        count = share.sum(0)
        weight = count / len(values)
        mean = share.T @ values / count[:, None]
        centred = values[:, None] - mean
        covariance = np.einsum("nc,nci,ncj->cij", share, centred, centred) / count[:, None, None]
        # A component of a few values has no smaller variances.
        covariance += 1e-6 * pooled
        white = np.linalg.solve(np.linalg.cholesky(covariance), centred[..., None])[..., 0]
        log_density = np.log(weight) - 0.5 * (np.linalg.slogdet(covariance)[1] + (white**2).sum(-1))
        share = np.exp(log_density - log_density.max(-1, keepdims=True))
        share = np.maximum(share / share.sum(-1, keepdims=True), 1e-12)
    return weight, mean, covariance
