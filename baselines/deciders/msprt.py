"""Tests between all hypotheses at once, not only against the mode decided last.

With equal priors the posterior of a hypothesis is its likelihood over the sum of all. The MSPRT declares
when it is large (Baum & Veeravalli 1994, "A sequential procedure for multihypothesis testing"); the gap rule
when the best beats every other by a ratio (Armitage 1950). Where only straight, left or right counts, the
posterior of the type is what should be large: neighbouring radii share it.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from baselines.deciders.decider import Actions, Observations
from hybrid_env.checks import check_choice, check_number, check_positive, reject
from hybrid_env.observation import LOG_FLOOR, Layout

FloatArray = NDArray[np.float64]
CLIPPED = LOG_FLOOR + 1e-3  # ratios here are the observation's floor, not likelihoods


def mode_types(hypotheses: int) -> NDArray[np.int64]:
    """(M,) type of each hypothesis: 0 straight, 1 left, 2 right."""
    n = hypotheses // 2
    return np.repeat([0, 1, 2], [1, n, n])


def type_sums(values: NDArray[Any]) -> FloatArray:
    """(..., 3) sums over straight, left and right of values (..., M)."""
    n = values.shape[-1] // 2
    parts = (values[..., :1], values[..., 1 : n + 1], values[..., n + 1 :])
    return np.stack([part.sum(-1, dtype=np.float64) for part in parts], axis=-1)


def type_posteriors(log_ratio: FloatArray) -> FloatArray:
    """Posterior of straight, left and right, (..., 3), from log-likelihood ratios (..., M); equal priors."""
    types = type_sums(np.where(log_ratio <= CLIPPED, 0.0, np.exp(log_ratio)))
    return np.asarray(types / types.sum(-1, keepdims=True))


def likeliest_of_type(types: FloatArray, values: NDArray[Any]) -> NDArray[np.int64]:
    """(N,) the hypothesis of the largest value, (N, M), within the type of the largest sum, (N, 3)."""
    of_type = mode_types(values.shape[-1]) == types.argmax(-1)[:, None]
    return np.where(of_type, values, -np.inf).argmax(-1)


def other_types(types: FloatArray, chosen: NDArray[np.int64]) -> FloatArray:
    """(N,) sum over all types, (N, 3), but the chosen, (N,): 1 - p would lose the digits of a small doubt."""
    return np.asarray(np.where(np.arange(3) == chosen[:, None], 0.0, types).sum(-1))


def read_error_probability(
    observation: Observations, by: Literal["hypothesis", "type"]
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Log-posterior of all that would make a declaration wrong, and the hypothesis to declare, (N,) each."""
    layout = Layout.of_rows(observation)
    log_ratio = layout.read(observation, "log_ratio")
    if by == "hypothesis":
        return layout.read(observation, "log_error_probability"), log_ratio.argmax(-1)
    posterior = type_posteriors(log_ratio)
    others = other_types(posterior, posterior.argmax(-1))
    doubt = np.log(np.maximum(others, np.exp(LOG_FLOOR)))
    return doubt, likeliest_of_type(posterior, log_ratio)


class MSPRTDecider:
    """Declares when the posterior of all that would make it wrong has fallen to alpha.

    Args:
        alpha: that posterior, between 1e-13 (the observation's resolution) and 1.
        by: "hypothesis", or "type": then the likeliest hypothesis of the likeliest type is declared, and
            other radii of that type do not count as doubt.
    """

    def __init__(self, alpha: float = 0.02, by: Literal["hypothesis", "type"] = "hypothesis"):
        self.alpha = check_number("alpha", alpha, "a number from 1e-13 to 1")
        if not np.exp(LOG_FLOOR) < alpha <= 1.0:
            raise reject("alpha", alpha, "a number from 1e-13 to 1")
        check_choice("by", by, ("hypothesis", "type"))
        self.by: Literal["hypothesis", "type"] = by

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `Decider.predict`; there is no state."""
        doubt, best = read_error_probability(observation, self.by)
        return np.where(doubt <= np.log(self.alpha), best + 1, 0), None


class GapDecider:
    """Declares when the likeliest hypothesis beats every other by a log-likelihood ratio.

    Args:
        gap: that ratio, ln A, above 0 and below 30, where the observation ends.
    """

    def __init__(self, gap: float = 4.6):
        self.gap = check_positive("gap", gap)
        if gap >= -LOG_FLOOR:
            raise reject("gap", gap, f"a number between 0 and {-LOG_FLOOR:g}")

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `Decider.predict`; there is no state."""
        log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
        second = np.partition(log_ratio, -2, axis=-1)[:, -2]
        return np.where(second <= -self.gap, log_ratio.argmax(-1) + 1, 0), None
