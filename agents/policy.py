"""A trained policy as a decider, and its file: safetensors with a JSON card beside it."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.writing import whole_file, write_json
from baselines.decider import Actions, Observations
from hybrid_env.checks import reject
from hybrid_env.observation import HYPOTHESIS_FEATURES, TRACK_FEATURES, Layout

WEIGHTS = "policy.safetensors"
CARD = "policy.json"


def make_policy(
    observation_space: spaces.Space[Any], action_space: spaces.Space[Any], hidden: tuple[int, ...]
) -> ActorCriticPolicy:
    """Stable-Baselines3's actor and critic with the given hidden layers, untrained."""
    return ActorCriticPolicy(observation_space, action_space, lambda _: 0.0, net_arch=list(hidden))


class PolicyDecider:
    """Declares the likeliest hypothesis once the policy's log-odds of declaring pass a threshold.

    At threshold 0 this is the policy's own most probable action; other thresholds trade time for accuracy.
    A policy with a declaration for every hypothesis declares the one that it prefers.

    Args:
        policy: actor with 2 actions (wait, declare the likeliest) or M + 1.
        threshold: on ln p(the declaration) - ln p(wait).
    """

    def __init__(self, policy: ActorCriticPolicy, threshold: float = 0.0):
        self.policy = policy
        self.threshold = threshold
        self.generator = np.random.default_rng(0)

    def with_threshold(self, threshold: float) -> "PolicyDecider":
        """The same policy at another threshold."""
        return PolicyDecider(self.policy, threshold)

    @property
    def hypotheses(self) -> int:
        """M of the bank that it was trained on."""
        shape = self.policy.observation_space.shape
        assert shape is not None
        return Layout.of_width(shape[0]).hypotheses

    @torch.no_grad()
    def logits(self, observation: Observations) -> NDArray[np.float64]:
        """(N, actions) log-probabilities up to a constant."""
        hidden = self.policy.mlp_extractor.forward_actor(torch.as_tensor(observation))
        return self.policy.action_net(hidden).numpy().astype(np.float64)

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, None]:
        """See `baselines.Decider.predict`; there is no state. Sampling ignores the threshold."""
        expected = self.policy.observation_space.shape
        if observation.shape[1:] != expected:
            raise reject("observation shape", observation.shape, f"(N, *{expected}), of the bank trained on")
        logits = self.logits(observation)
        declare = logits[:, 1:].argmax(1)
        odds = logits[np.arange(len(logits)), declare + 1] - logits[:, 0]
        if deterministic:
            declared = odds > self.threshold
        else:
            gumbel = logits + self.generator.gumbel(size=logits.shape)
            declared = gumbel.argmax(1) > 0
            declare = gumbel[:, 1:].argmax(1)
        if logits.shape[1] == 2:
            layout = Layout.of_rows(observation)
            declare = layout.read(observation, "log_ratio").argmax(-1)
        return np.where(declared, declare + 1, 0), None


def save_policy(folder: Path, policy: ActorCriticPolicy, card: dict[str, Any]) -> None:
    """Write weights and card, each whole or not at all."""
    weights = {name: tensor.contiguous() for name, tensor in policy.state_dict().items()}
    shape = policy.observation_space.shape
    assert shape is not None
    assert isinstance(policy.action_space, spaces.Discrete)
    card = card | {
        "observation_width": shape[0],
        "observation_scales": HYPOTHESIS_FEATURES | TRACK_FEATURES,
        "actions": int(policy.action_space.n),
        "hidden": list(policy.net_arch),
    }
    with whole_file(folder / WEIGHTS) as part:
        save_file(weights, part)
    write_json(folder / CARD, card)


def load_policy(folder: Path) -> tuple[ActorCriticPolicy, dict[str, Any]]:
    """Read a policy and its card; nothing is unpickled.

    Raises:
        ValueError: the folder holds no policy, or a damaged one.
    """
    try:
        card = json.loads((folder / CARD).read_text(encoding="utf-8"))
        space = spaces.Box(-np.inf, np.inf, (int(card["observation_width"]),), np.float32)
        policy = make_policy(space, spaces.Discrete(int(card["actions"])), tuple(card["hidden"]))
        policy.load_state_dict(load_file(folder / WEIGHTS))
        scales = card["observation_scales"]
    except (OSError, ValueError, KeyError, TypeError, RuntimeError, SafetensorError) as error:
        reason = str(error).splitlines()[0]
        raise reject("run", str(folder), f"a run folder with {WEIGHTS} and {CARD} ({reason})") from None
    if scales != HYPOTHESIS_FEATURES | TRACK_FEATURES:
        raise reject(
            "run", str(folder), "a policy trained on today's observation; this one read other scales"
        )
    policy.set_training_mode(False)
    return policy, card
