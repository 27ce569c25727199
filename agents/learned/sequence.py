"""A recurrent network that learns the likelihood, as a decider, and its file.

The bank takes its anchor as exact, so its likelihoods are wrong in a way that innovations, displacement and
the covariance of the anchor give away over a segment. A gated recurrent unit reads them for every hypothesis
with the same weights and corrects the log-likelihood ratio; the decider stops on the posterior that results.
Since weights are shared over hypotheses, and a turn is seen from its own side, one network reads any bank.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.learned.policy_file import save_policy, unreadable
from baselines.deciders.decider import Actions, Observations
from baselines.deciders.msprt import likeliest_of_type, mode_types, other_types_sum, type_sums
from hybrid_env.checks import check_between, reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, LOG_SCALE, TICK_SCALE, TRACK_FEATURES, Layout
from hybrid_env.options import WorldOptions

SINGLES, BLOCKS = list(TRACK_FEATURES), list(HYPOTHESIS_FEATURES)


class SequenceNet(nn.Module):
    """Scores of the hypotheses, tick by tick; the same weights for each.

    Args:
        hidden: width of the recurrent state of a hypothesis.
    """

    def __init__(self, hidden: int = 40):
        super().__init__()
        self.hidden = hidden
        self.encoder = nn.Linear(len(BLOCKS) + len(SINGLES) + 1, hidden)
        self.memory = nn.GRUCell(2 * hidden, hidden)
        self.mix = nn.Linear(2 * hidden, hidden)
        self.score = nn.Linear(hidden, 1)
        self.trust = nn.Parameter(torch.tensor(0.5))  # in the bank's own log-likelihood ratio
        nn.init.zeros_(self.score.weight)
        nn.init.zeros_(self.score.bias)

    def features(self, rows: Tensor) -> Tensor:
        """What each hypothesis is told, (..., M, hidden * 2), of rows (..., 6 M + 10).

        "Across" is turned to the side that the hypothesis turns to, so that left and right are alike. The
        mean over hypotheses stands beside each.
        """
        count = (rows.shape[-1] - len(SINGLES)) // len(BLOCKS)
        own = rows[..., : len(BLOCKS) * count].unflatten(-1, (len(BLOCKS), count)).transpose(-1, -2)
        shared = rows[..., len(BLOCKS) * count :].unsqueeze(-2).expand(*own.shape[:-1], len(SINGLES))
        curvature = own[..., BLOCKS.index("curvature")].unsqueeze(-1)
        side = torch.where(curvature < 0, -1.0, 1.0)
        own = torch.where(_is(BLOCKS, "innovation_across", "curvature"), own * side, own)
        own = torch.where(_is(BLOCKS, "innovation_across", "innovation_along"), torch.asinh(own), own)
        shared = torch.where(_is(SINGLES, "displacement_across"), shared * side, shared)
        return _beside_mean(
            torch.tanh(self.encoder(torch.cat([own, shared, (curvature == 0).float()], dim=-1)))
        )

    def remember(self, features: Tensor, memory: Tensor) -> Tensor:
        """The next memory, (N, M, hidden), from features (N, M, 2 hidden)."""
        return self.memory(features.flatten(0, 1), memory.flatten(0, 1)).unflatten(0, memory.shape[:2])

    def log_posterior(self, rows: Tensor, memory: Tensor) -> Tensor:
        """(..., M) from rows and the memories after them."""
        ratio = rows[..., : memory.shape[-2]] / LOG_SCALE
        score = self.score(torch.tanh(self.mix(_beside_mean(memory)))).squeeze(-1)
        return torch.log_softmax(score + self.trust * ratio, dim=-1)

    @torch.no_grad()
    def believe(self, observation: Observations, memory: Tensor | None) -> tuple[NDArray[np.float32], Tensor]:
        """Posterior (N, M) and memory (N, M, hidden) after a tick; memory is None before the first."""
        rows = torch.as_tensor(observation)
        if memory is None:
            memory = torch.zeros(len(rows), Layout.of_rows(observation).hypotheses, self.hidden)
        memory = self.remember(self.features(rows), memory * ~first_ticks(rows)[:, None, None])
        return self.log_posterior(rows, memory).exp().numpy(), memory


def _beside_mean(values: Tensor) -> Tensor:
    """(..., M, 2 F): the values of each hypothesis, and the mean over hypotheses."""
    return torch.cat([values, values.mean(-2, keepdim=True).expand_as(values)], dim=-1)


def _is(names: list[str], *wanted: str) -> Tensor:
    return torch.tensor([name in wanted for name in names])


def first_ticks(rows: Tensor) -> Tensor:
    """(...) True where a segment begins, and memory with it."""
    return rows[..., -len(SINGLES) + SINGLES.index("ticks")] < 1.5 * TICK_SCALE


def doubts_and_best(
    posterior: NDArray[np.floating], by_type: bool | NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """How probable a wrong declaration is, and what to declare.

    Args:
        posterior: (N, M).
        by_type: declare the likeliest of the likeliest type, not the likeliest of all; for all or (N,).

    Returns:
        Posterior of other types and of other radii of that type, and the hypothesis; (N,) each.
    """
    types = type_sums(posterior)
    best = np.where(by_type, likeliest_of_type(types, posterior), posterior.argmax(1))
    kind = mode_types(posterior.shape[1])
    same_type = kind == kind[best][:, None]
    same_type[np.arange(len(best)), best] = False
    return other_types_sum(types, kind[best]), np.where(same_type, posterior, 0.0).sum(1), best


def doubt_and_best(
    posterior: NDArray[np.floating], radius: float | NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The doubt and what to declare, (N,) each.

    Args:
        posterior: (N, M).
        radius: how much a wrong radius of the right type counts, from 0 (not at all) to 1 (as the wrong
            type), for all or (N,).
    """
    type_doubt, radius_doubt, best = doubts_and_best(posterior, np.asarray(radius) < 1.0)
    return type_doubt + radius * radius_doubt, best


class SequenceDecider:
    """Declares what the network finds likeliest, when all that would be wrong has at most alpha.

    Args:
        net: trained.
        alpha: posterior of all that would be wrong.
        radius: how much a wrong radius of the right type counts as wrong, from 0 to 1. Where only the type is
            rewarded it spoils the next anchor all the same.
    """

    def __init__(self, net: SequenceNet, alpha: float = 0.02, radius: float = 1.0):
        if not 0.0 < alpha <= 1.0:
            raise reject("alpha", alpha, "a number above 0, at most 1")
        if radius not in (0.0, 1.0):
            check_between("radius", radius, 0.0, 1.0)
        self.net, self.alpha, self.radius = net, alpha, radius

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Tensor]:
        """See `Decider.predict`; the state is the memory of every hypothesis, (N, M, hidden)."""
        posterior, state = self.net.believe(observation, state)
        doubt, best = doubt_and_best(posterior, self.radius)
        return np.where(doubt <= self.alpha, best + 1, 0), state

    def keep(self, state: Tensor, tracks: NDArray[np.bool_]) -> Tensor:
        """The state of some of its tracks, (N,) bool: `evaluate` leaves out those that have finished."""
        return state[torch.from_numpy(tracks)]


def check_declares_hypotheses(world: WorldOptions) -> None:
    """Refuse a world in which only the likeliest hypothesis of the bank can be declared."""
    if world.actions != "all":
        raise reject("actions", world.actions, "'all' for an agent that declares hypotheses")


def save_sequence(folder: Path, net: SequenceNet, card: dict[str, Any]) -> None:
    """Write weights and card, each whole or not at all."""
    save_policy(folder, net.state_dict(), card)


def load_sequence(folder: Path, weights: dict[str, Tensor], card: dict[str, Any]) -> SequenceNet:
    """The network of the weights and card that `run_folder.load_policy` read in a folder.

    Raises:
        ArgumentError: they do not fit together.
    """
    try:
        net = SequenceNet(int(card["recipe"]["entry"]["hidden"]))
        net.load_state_dict(weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable(folder, error) from None
    return net.eval()
