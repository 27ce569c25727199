"""A trained actor of Stable-Baselines3 that states the present mode at every tick."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from scipy.special import softmax

from agents.learned.policy import ActorDecider
from baselines.rules.decider import UNKNOWN, Actions, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel


class StatementPolicyDecider(ActorDecider):
    """Changes its statement to the policy's most probable mode if the log-odds exceed a margin.

    At margin 0 it states the policy's most probable mode. A larger margin changes the statement later and
    less often to a wrong mode. The first statement of an episode is the most probable mode.

    Args:
        policy: actor whose action i states mode i, for M modes; with or without an LSTM.
        threshold: margin on ln p(another mode) - ln p(the stated mode); a negative one has no effect.
    """

    task = UNKNOWN

    @property
    def hypotheses(self) -> int:
        """Number M of hypotheses that the policy was trained for."""
        assert isinstance(self.policy.action_space, spaces.Discrete)
        return int(self.policy.action_space.n)

    def choose(self, logits: NDArray[np.float64], observation: Observations, deterministic: bool) -> Actions:
        """See `ActorDecider.choose`; action i states mode i."""
        if not deterministic:
            return self.sample(logits).argmax(1)
        best = logits.argmax(1)
        stated, started = read_statement(observation)
        tracks = np.arange(len(logits))
        odds = logits[tracks, best] - logits[tracks, stated]
        return np.where((odds > self.threshold) | ~started, best, stated)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`."""
        return probability_panel("policy")

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: NDArray[np.bool_] | None = None
    ) -> NDArray[np.float64]:
        """Return the probabilities of the modes by the policy, (N, M)."""
        return np.asarray(softmax(self.logits(observation, state, episode_start)[0], axis=-1))
