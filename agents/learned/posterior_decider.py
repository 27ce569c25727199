"""Base class of the learned deciders that compare an error probability with a threshold."""

import copy
import functools
from abc import abstractmethod
from typing import Any, ClassVar

import numpy as np

from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.decider import Actions, DeciderFamily, Observations
from baselines.rules.msprt import FEW_ALPHAS, mode_types, posterior_of
from hybrid_env.checks import FloatArray, IntArray, reject
from hybrid_env.observation import Layout
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.evidence import EvidencePanel, posterior_panel


class PosteriorDecider(NetworkDecider):
    """Declares the best hypothesis once the expected loss of the declaration is at most alpha.

    The threshold alpha is in units of a wrong declaration, in (0, 1].
    """

    symbol = "alpha"
    thresholds: ClassVar[tuple[float, ...]] = FEW_ALPHAS
    default = 0.02
    label: ClassVar[str]
    """Of the posterior in figures."""

    def __init__(self, net: Any, world: WorldOptions, alpha: float = 0.02):
        if not 0.0 < alpha <= 1.0:
            raise reject("alpha", alpha, "a number above 0, at most 1")
        self.net, self.world, self.alpha = net, world, alpha
        self.by_type = world.correctness == "type"
        self.layout = Layout(world.hypotheses)

    @classmethod
    def trained(cls, name: str, net: Any, options: WorldOptions) -> DeciderFamily:
        """Return a network at any threshold, for the options of an environment."""
        return DeciderFamily(
            name,
            cls.symbol,
            cls.thresholds,
            cls.default,
            functools.partial(cls, net, options),
        )

    @abstractmethod
    def posterior(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[FloatArray, Any]:
        """Return the posterior (N, M) after one tick, and the state."""

    @abstractmethod
    def errors(
        self,
        observation: Observations,
        posterior: FloatArray,
        state: Any,
    ) -> tuple[FloatArray, IntArray]:
        """Return the expected loss of a declaration (N,) and the hypothesis to declare (N,)."""

    def decide(
        self,
        observation: Observations,
        state: Any,
        episode_start: Any,
    ) -> tuple[Actions, Any]:
        """See `Decider.decide`. The state is that of `posterior`."""
        posterior, state = self.posterior(observation, state, episode_start)
        error, best = self.errors(observation, posterior, state)
        return np.where(error <= self.alpha, best + 1, 0), state

    def panel(self) -> EvidencePanel:
        return posterior_panel(self.label, self.by_type, np.array([self.alpha]))

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
