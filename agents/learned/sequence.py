"""A recurrent network that corrects the bank's log-likelihood ratios, as a decider, and its file.

The bank treats its anchor as exact, so its likelihoods are biased. Over a segment the bias shows in the
innovations, the displacement and the covariance of the anchor. A gated recurrent unit (GRU) reads them for
every hypothesis with shared weights and corrects the log-likelihood ratio; the decider stops on the resulting
posterior. The weights are shared over hypotheses, and lateral features are mirrored to the side of the turn,
so one network applies to a bank of any size.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.network_settings import LARGEST_HIDDEN
from agents.learned.policy_file import load_weights, save_policy, unreadable_policy
from baselines.deciders.decider import Actions, Observations
from baselines.deciders.msprt import likeliest_of_type, mode_types, other_types_sum, type_sums
from hybrid_env.checks import check_between, check_integer, reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, LOG_SCALE, TICK_SCALE, TRACK_FEATURES, Layout
from hybrid_env.options import WorldOptions

HYPOTHESIS_NAMES, TRACK_NAMES = list(HYPOTHESIS_FEATURES), list(TRACK_FEATURES)


class SequenceNet(nn.Module):
    """Recurrent network that scores the hypotheses at every tick, with the same weights for each hypothesis.

    Args:
        hidden: size of the hidden state of one hypothesis.
    """

    def __init__(self, hidden: int = 40):
        super().__init__()
        self.hidden = hidden
        self.encoder = nn.Linear(len(HYPOTHESIS_NAMES) + len(TRACK_NAMES) + 1, hidden)
        self.memory = nn.GRUCell(2 * hidden, hidden)
        self.mix = nn.Linear(2 * hidden, hidden)
        self.score = nn.Linear(hidden, 1)
        self.trust = nn.Parameter(torch.tensor(0.5))  # weight of the bank's log-likelihood ratio
        nn.init.zeros_(self.score.weight)
        nn.init.zeros_(self.score.bias)

    def features(self, rows: Tensor) -> Tensor:
        """Return the features (..., M, 2 hidden) of each hypothesis from observation rows (..., 6 M + 10).

        Lateral quantities ("across") are mirrored to the side of the turn, so that left and right turns share
        one representation. The mean over hypotheses is appended to the features of each.
        """
        count = (rows.shape[-1] - len(TRACK_NAMES)) // len(HYPOTHESIS_NAMES)
        own = rows[..., : len(HYPOTHESIS_NAMES) * count]
        own = own.unflatten(-1, (len(HYPOTHESIS_NAMES), count)).transpose(-1, -2)
        shared = rows[..., len(HYPOTHESIS_NAMES) * count :].unsqueeze(-2)
        shared = shared.expand(*own.shape[:-1], len(TRACK_NAMES))
        curvature = own[..., HYPOTHESIS_NAMES.index("curvature")].unsqueeze(-1)
        side = torch.where(curvature < 0, -1.0, 1.0)
        own = torch.where(_mask(HYPOTHESIS_NAMES, "innovation_across", "curvature"), own * side, own)
        innovations = _mask(HYPOTHESIS_NAMES, "innovation_across", "innovation_along")
        own = torch.where(innovations, torch.asinh(own), own)
        shared = torch.where(_mask(TRACK_NAMES, "displacement_across"), shared * side, shared)
        return _with_mean(
            torch.tanh(self.encoder(torch.cat([own, shared, (curvature == 0).float()], dim=-1)))
        )

    def next_hidden_state(self, features: Tensor, hidden_state: Tensor) -> Tensor:
        """Return the next hidden state (N, M, hidden) from features (N, M, 2 hidden)."""
        flat = self.memory(features.flatten(0, 1), hidden_state.flatten(0, 1))
        return flat.unflatten(0, hidden_state.shape[:2])

    def log_posterior(self, rows: Tensor, hidden_state: Tensor) -> Tensor:
        """Return the log-posterior (..., M) from observation rows and the hidden state updated with them."""
        ratio = rows[..., : hidden_state.shape[-2]] / LOG_SCALE
        score = self.score(torch.tanh(self.mix(_with_mean(hidden_state)))).squeeze(-1)
        return torch.log_softmax(score + self.trust * ratio, dim=-1)

    @torch.no_grad()
    def predict_posterior(
        self, observation: Observations, hidden_state: Tensor | None
    ) -> tuple[NDArray[np.float32], Tensor]:
        """Process one tick of N tracks.

        Args:
            observation: (N, 6 M + 10).
            hidden_state: (N, M, hidden) after the previous tick; None before the first.

        Returns:
            Posterior (N, M) and hidden state (N, M, hidden) after the tick.
        """
        rows = torch.as_tensor(observation)
        if hidden_state is None:
            hidden_state = torch.zeros(len(rows), Layout.of_rows(observation).hypotheses, self.hidden)
        reset = first_ticks(rows)[:, None, None]
        hidden_state = self.next_hidden_state(self.features(rows), hidden_state * ~reset)
        return self.log_posterior(rows, hidden_state).exp().numpy(), hidden_state


def _with_mean(values: Tensor) -> Tensor:
    """Return (..., M, 2 F): the values (..., M, F) of each hypothesis and their mean over hypotheses."""
    return torch.cat([values, values.mean(-2, keepdim=True).expand_as(values)], dim=-1)


def _mask(names: list[str], *selected: str) -> Tensor:
    return torch.tensor([name in selected for name in names])


def first_ticks(rows: Tensor) -> Tensor:
    """Return (...) True at the first tick of a segment, where the hidden state is reset."""
    return rows[..., -len(TRACK_NAMES) + TRACK_NAMES.index("ticks")] < 1.5 * TICK_SCALE


def error_probabilities_and_best(
    posterior: NDArray[np.floating], by_type: bool | NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the hypothesis to declare and the posterior probabilities of a wrong type and a wrong radius.

    Args:
        posterior: (N, M).
        by_type: choose the most likely hypothesis of the most likely type instead of the most likely
            hypothesis; one value for all tracks, or (N,).

    Returns:
        Posterior of all other types, posterior of the other radii of the chosen type, and index of the chosen
        hypothesis, each (N,).
    """
    types = type_sums(posterior)
    best = np.where(by_type, likeliest_of_type(types, posterior), posterior.argmax(1))
    kind = mode_types(posterior.shape[1])
    same_type = kind == kind[best][:, None]
    same_type[np.arange(len(best)), best] = False
    return other_types_sum(types, kind[best]), np.where(same_type, posterior, 0.0).sum(1), best


def error_probability_and_best(
    posterior: NDArray[np.floating], radius_weight: float | NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the posterior error probability of a declaration and the hypothesis to declare, each (N,).

    Args:
        posterior: (N, M).
        radius_weight: weight of a wrong radius of the right type, from 0 (no error) to 1 (same as a wrong
            type); one value for all tracks, or (N,).
    """
    wrong_type, wrong_radius, best = error_probabilities_and_best(posterior, np.asarray(radius_weight) < 1.0)
    return wrong_type + radius_weight * wrong_radius, best


class SequenceDecider:
    """Declares the most likely hypothesis once its posterior error probability is at most alpha.

    Args:
        net: trained network.
        alpha: threshold on the posterior error probability, in (0, 1].
        radius_weight: weight of a wrong radius of the right type in the error probability, from 0 to 1. A
            wrong radius degrades the next anchor even where only the type is rewarded.

    Raises:
        ArgumentError: alpha or radius_weight is out of range.
    """

    def __init__(self, net: SequenceNet, alpha: float = 0.02, radius_weight: float = 1.0):
        if not 0.0 < alpha <= 1.0:
            raise reject("alpha", alpha, "a number above 0, at most 1")
        if radius_weight not in (0.0, 1.0):
            check_between("radius_weight", radius_weight, 0.0, 1.0)
        self.net, self.alpha, self.radius_weight = net, alpha, radius_weight

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Tensor]:
        """See `Decider.predict`. The state is the hidden state of every hypothesis, (N, M, hidden)."""
        posterior, state = self.net.predict_posterior(observation, state)
        error_probability, best = error_probability_and_best(posterior, self.radius_weight)
        return np.where(error_probability <= self.alpha, best + 1, 0), state

    def select_tracks(self, state: Tensor, tracks: NDArray[np.bool_]) -> Tensor:
        """Return the state of the tracks selected by a mask (N,); `evaluate` drops finished tracks."""
        return state[torch.from_numpy(tracks)]


def check_declares_hypotheses(world: WorldOptions) -> None:
    """Refuse an environment in which only the most likely hypothesis of the bank can be declared."""
    if world.actions != "all":
        raise reject("actions", world.actions, "'all' for an agent that declares hypotheses")


def save_sequence(folder: Path, net: SequenceNet, card: dict[str, Any]) -> None:
    """Write weights and card. Each file is written atomically."""
    save_policy(folder, net.state_dict(), card)


def load_sequence(folder: Path, weights: dict[str, Tensor], card: dict[str, Any]) -> SequenceNet:
    """Return the network for the weights and card that `policy_file.load_policy` read from a folder.

    Raises:
        ArgumentError: weights and card do not match.
    """
    try:
        hidden = check_integer("hidden", card["recipe"]["entry"]["hidden"], maximum=LARGEST_HIDDEN)
        with torch.device("meta"):
            net = SequenceNet(hidden)
        load_weights(net, weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable_policy(folder, error) from None
    return net.eval()
