"""Base class of the learned deciders that compare an error probability with a threshold."""

import copy
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.decider import Actions, Observations
from baselines.rules.msprt import FEW_ALPHAS, error_and_best, mode_types, posterior_of
from hybrid_env.checks import FloatArray, IntArray
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel


class PosteriorDecider(NetworkDecider):
    """Declares the best hypothesis once the expected loss of the declaration is at most alpha.

    The threshold alpha is in units of a wrong declaration, in (0, 1].
    """

    symbol = "alpha"
    thresholds: tuple[float, ...] = FEW_ALPHAS
    default = 0.02
    bounds = 1e-300, 1.0
    label: ClassVar[str]
    """Of the posterior in figures."""

    def __init__(self, net: Any, world: WorldOptions, threshold: float | None = None):
        super().__init__(threshold)
        self.net, self.world = net, world
        self.by_type = world.correctness == "type"
        self.layout = Layout(world.hypotheses)

    @abstractmethod
    def posterior(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[FloatArray, Any]:
        """Return the posterior (N, M) after one tick, and the state."""

    def errors(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: Any,
    ) -> tuple[FloatArray, IntArray]:
        """Return the expected loss of a declaration (N,) and the hypothesis to declare (N,): by
        default the likeliest one, or the best one of the likeliest type.
        """
        return error_and_best(posterior, self.by_type)

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state is that of `posterior`."""
        posterior, state = self.posterior(observation, state, episode_start)
        error, best = self.errors(observation, posterior, state)
        return np.where(error <= self.threshold, best + 1, 0), state

    def panel(self) -> EvidencePanel:
        return posterior_panel(self.label, self.by_type, self.threshold)

    def evidence(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the posterior of each hypothesis or type, (N, M), for the best one 1 - expected
        loss.
        """
        # A copy, because `posterior` may change the state in place.
        posterior, state = self.posterior(observation, copy.deepcopy(state), episode_start)
        error, best = self.errors(observation, posterior, state)
        kinds = mode_types(posterior.shape[1]) if self.by_type else np.arange(posterior.shape[1])
        values = posterior_of(posterior, self.by_type)
        return np.where(kinds == kinds[best][:, None], 1.0 - error[:, None], values)
