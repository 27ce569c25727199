"""A recurrent network that learns the likelihood, as a decider, and its file.

The bank takes its anchor as exact, so its likelihoods are wrong in a way that innovations, displacement and
the covariance of the anchor give away over a segment. A gated recurrent unit reads them for every hypothesis
with the same weights and corrects the log-likelihood ratio; the decider stops on the posterior that results.
Since weights are shared over hypotheses, and a turn is seen from its own side, one network reads any bank.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from agents.writing import whole_file, write_json
from baselines.decider import Actions, Observations
from hybrid_env.checks import reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, LOG_SCALE, TICK_SCALE, TRACK_FEATURES, Layout

WEIGHTS = "sequence.safetensors"
CARD = "sequence.json"
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
        shared = torch.where(_is(SINGLES, "displacement_across"), shared * side, shared)
        encoded = torch.tanh(self.encoder(torch.cat([own, shared, (curvature == 0).float()], dim=-1)))
        return torch.cat([encoded, encoded.mean(-2, keepdim=True).expand_as(encoded)], dim=-1)

    def remember(self, features: Tensor, memory: Tensor) -> Tensor:
        """The next memory, (N, M, hidden), from features (N, M, 2 hidden)."""
        return self.memory(features.flatten(0, 1), memory.flatten(0, 1)).unflatten(0, memory.shape[:2])

    def log_posterior(self, rows: Tensor, memory: Tensor) -> Tensor:
        """(..., M) from rows and the memories after them."""
        ratio = rows[..., : memory.shape[-2]] / LOG_SCALE
        return torch.log_softmax(self.score(memory).squeeze(-1) + self.trust * ratio, dim=-1)


def _is(names: list[str], *wanted: str) -> Tensor:
    return torch.tensor([name in wanted for name in names])


def first_ticks(rows: Tensor) -> Tensor:
    """(...) True where a segment begins, and memory with it."""
    return rows[..., -len(SINGLES) + SINGLES.index("ticks")] < 1.5 * TICK_SCALE


class SequenceDecider:
    """Declares the hypothesis that the network finds likeliest when all others have at most alpha.

    Args:
        net: trained.
        alpha: posterior of all others.
        by: "type" counts other radii of the likeliest type as right, as where only the type is rewarded.
    """

    def __init__(self, net: SequenceNet, alpha: float = 0.02, by: str = "hypothesis"):
        if not 0.0 < alpha <= 1.0:
            raise reject("alpha", alpha, "a number above 0, at most 1")
        self.net, self.alpha, self.by = net, alpha, by

    @torch.no_grad()
    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Tensor]:
        """See `Decider.predict`; the state is the memory of every hypothesis, (N, M, hidden)."""
        layout = Layout.of_rows(observation)
        rows = torch.as_tensor(observation)
        if state is None:
            state = torch.zeros(len(rows), layout.hypotheses, self.net.hidden)
        state = self.net.remember(self.net.features(rows), state * ~first_ticks(rows)[:, None, None])
        posterior = self.net.log_posterior(rows, state).exp().numpy()
        sure = posterior
        if self.by == "type":
            n = layout.hypotheses // 2
            kind = np.repeat([0, 1, 2], [1, n, n])
            types = np.stack([posterior[:, kind == k].sum(-1) for k in range(3)], axis=-1)
            sure = types
            posterior = np.where(kind == types.argmax(-1)[:, None], posterior, -1.0)
        doubt = np.sort(sure, axis=-1)[:, :-1].sum(-1)
        return np.where(doubt <= self.alpha, posterior.argmax(-1) + 1, 0), state


def save_sequence(folder: Path, net: SequenceNet, card: dict[str, Any]) -> None:
    """Write weights and card, each whole or not at all."""
    with whole_file(folder / WEIGHTS) as part:
        save_file({name: tensor.contiguous() for name, tensor in net.state_dict().items()}, part)
    scales = HYPOTHESIS_FEATURES | TRACK_FEATURES
    write_json(folder / CARD, card | {"hidden": net.hidden, "observation_scales": scales})


def load_sequence(folder: Path) -> tuple[SequenceNet, dict[str, Any]]:
    """Read a network and its card; nothing is unpickled.

    Raises:
        ValueError: the folder holds none, or a damaged one.
    """
    try:
        card = json.loads((folder / CARD).read_text(encoding="utf-8"))
        net = SequenceNet(int(card["hidden"]))
        net.load_state_dict(load_file(folder / WEIGHTS))
        scales = card["observation_scales"]
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason})") from None
    if scales != HYPOTHESIS_FEATURES | TRACK_FEATURES:
        raise reject(
            "run", str(folder), "a network trained on today's observation; this one read other scales"
        )
    return net.eval(), card
