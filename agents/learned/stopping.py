"""Optimal stopping learned by PPO on the belief state of a sequence network.

Waiting has two benefits: the declaration of this segment is more accurate, and the next segment starts from a
better anchor. A threshold on the posterior error probability accounts only for the first. A policy that is
rewarded over the whole episode accounts for both.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor

from agents.learned.network_settings import belief_width
from agents.learned.policy import PolicyDecider, sequence_net_of
from agents.learned.sequence import TRACK_NAMES, SequenceNet, error_probabilities_and_best
from baselines.deciders.decider import Actions, Observations

MIN_PROBABILITY = 1e-8  # smaller error probabilities are clipped here
LOG_PROBABILITY_SCALE = 0.25  # scale of their logarithms
TRACK_FEATURE_LIMIT = 5.0  # track features are clipped here


class BeliefEncoder:
    """Encodes the belief state of a sequence network as one feature row per track.

    A row holds the logarithms of two error probabilities (wrong type; wrong radius given the right type),
    whether the best hypothesis is straight, the track features of the observation, and the hidden state of
    the best hypothesis.

    Args:
        net: trained network; its weights stay fixed.
        by_type: the best hypothesis is the most likely one of the most likely type, instead of the most
            likely one.
    """

    def __init__(self, net: SequenceNet, by_type: bool):
        self.net, self.by_type = net, by_type
        self.width = belief_width(net.hidden)

    def encode(
        self, observation: Observations, hidden_state: Tensor | None
    ) -> tuple[NDArray[np.float32], NDArray[np.int64], Tensor]:
        """Process one tick of N tracks.

        Args:
            observation: (N, 6 M + 10).
            hidden_state: (N, M, hidden) after the previous tick; None before the first.

        Returns:
            Belief rows (N, width), best hypothesis of each track (N,), and hidden state (N, M, hidden).
        """
        posterior, hidden_state = self.net.predict_posterior(observation, hidden_state)
        wrong_type, wrong_radius, best = error_probabilities_and_best(posterior, self.by_type)
        error_probabilities = np.stack([wrong_type, wrong_radius / (1.0 - wrong_type)])
        rows = np.concatenate(
            [
                LOG_PROBABILITY_SCALE * np.log(np.maximum(error_probabilities, MIN_PROBABILITY)).T,
                best[:, None] == 0,
                np.clip(observation[:, -len(TRACK_NAMES) :], -TRACK_FEATURE_LIMIT, TRACK_FEATURE_LIMIT),
                hidden_state[torch.arange(len(best)), torch.from_numpy(best)].numpy(),
            ],
            axis=1,
        )
        return rows.astype(np.float32), best, hidden_state


class StoppingDecider(PolicyDecider):
    """Declares the best hypothesis of a sequence network once the log-odds of stopping exceed a threshold.

    Args:
        policy: actor with 2 actions, with the sequence network as its submodule `beliefs`.
        by_type: only the type is rewarded.
        threshold: on ln p(stop) - ln p(wait).
    """

    def __init__(self, policy: ActorCriticPolicy, by_type: bool, threshold: float = 0.0):
        super().__init__(policy, threshold)
        net = sequence_net_of(policy)
        assert net is not None
        self.encoder = BeliefEncoder(net, by_type)

    def with_threshold(self, threshold: float) -> "StoppingDecider":
        """Return the same policy at another threshold."""
        return StoppingDecider(self.policy, self.encoder.by_type, threshold)

    @property
    def hypotheses(self) -> None:
        """None: the policy applies to a bank of any size, as the sequence network does."""
        return None

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Tensor]:
        """See `Decider.predict`. The state is the hidden state of every hypothesis, (N, M, hidden)."""
        rows, best, state = self.encoder.encode(observation, state)
        declared, _ = self.choose(self.logits(rows)[0], deterministic)
        return np.where(declared, best + 1, 0), state

    def select_tracks(self, state: Tensor, tracks: NDArray[np.bool_]) -> Tensor:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished tracks."""
        return state[torch.from_numpy(tracks)]
