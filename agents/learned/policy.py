"""A trained actor as a decider, and its file."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor

from agents.learned.features import policy_keywords
from agents.learned.policy_file import save_policy, unreadable
from agents.learned.sequence import SequenceNet
from baselines.deciders.decider import Actions, Observations
from hybrid_env.checks import reject
from hybrid_env.observation import Layout


def make_policy(
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
    policy_kwargs: dict[str, Any],
    observe: tuple[str, ...] = (),
    recurrent: bool = False,
) -> ActorCriticPolicy:
    """An untrained actor and critic of Stable-Baselines3 or of sb3-contrib.

    Args:
        policy_kwargs: of the policy, such as net_arch.
        observe: quantities that it sees, all if empty.
        recurrent: with an LSTM.
    """
    kind: Any = ActorCriticPolicy
    if recurrent:
        from sb3_contrib.ppo_recurrent import MlpLstmPolicy

        kind = MlpLstmPolicy
    policy: ActorCriticPolicy = kind(
        observation_space, action_space, lambda _: 0.0, **policy_keywords(policy_kwargs, observe)
    )
    return policy


def beliefs_of(policy: ActorCriticPolicy) -> SequenceNet | None:
    """The network whose beliefs a policy sees, see `agents.stopping`; None sees the rows."""
    return getattr(policy, "beliefs", None)


class PolicyDecider:
    """Declares the likeliest hypothesis once the policy's log-odds of declaring pass a threshold.

    At threshold 0 this is the policy's own most probable action; other thresholds trade time for accuracy.
    A policy with a declaration for every hypothesis declares the one that it prefers.

    Args:
        policy: actor with 2 actions (wait, declare the likeliest) or M + 1; with or without an LSTM.
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
    def hypotheses(self) -> int | None:
        """M of the bank that it was trained on; None reads any."""
        shape = self.policy.observation_space.shape
        assert shape is not None
        return Layout.of_width(shape[0]).hypotheses

    @torch.no_grad()
    def logits(
        self, observation: Observations, state: Any = None, episode_start: NDArray[np.bool_] | None = None
    ) -> tuple[NDArray[np.float64], Any]:
        """(N, actions) log-probabilities up to a constant, and an LSTM's state, (layers, N, hidden) twice."""
        rows = torch.as_tensor(observation)
        lstm: Any = getattr(self.policy, "lstm_actor", None)
        features: Tensor = self.policy.pi_features_extractor(rows)
        if lstm is not None:
            if state is None:
                zeros = torch.zeros(lstm.num_layers, len(rows), lstm.hidden_size)
                state = (zeros, zeros)
            starts = (
                torch.zeros(len(rows)) if episode_start is None else torch.as_tensor(episode_start).float()
            )
            features, state = self.policy._process_sequence(features, state, starts, lstm)  # type: ignore[operator]
        hidden = self.policy.mlp_extractor.forward_actor(features)
        return self.policy.action_net(hidden).numpy().astype(np.float64), state

    def choose(
        self, logits: NDArray[np.float64], deterministic: bool
    ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Whether to declare, (N,), and which of the declarations, (N,), from logits (N, actions)."""
        if not deterministic:
            logits = logits + self.generator.gumbel(size=logits.shape)
        declare = logits[:, 1:].argmax(1)
        odds = logits[np.arange(len(logits)), declare + 1] - logits[:, 0]
        return odds > (self.threshold if deterministic else 0.0), declare

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """See `baselines.Decider.predict`; only an LSTM has a state. Sampling ignores the threshold."""
        expected = self.policy.observation_space.shape
        if observation.shape[1:] != expected:
            raise reject("observation shape", observation.shape, f"(N, *{expected}), of the bank trained on")
        logits, state = self.logits(observation, state, episode_start)
        declared, declare = self.choose(logits, deterministic)
        if logits.shape[1] == 2:
            layout = Layout.of_rows(observation)
            declare = layout.read(observation, "log_ratio").argmax(-1)
        return np.where(declared, declare + 1, 0), state

    def keep(self, state: Any, tracks: NDArray[np.bool_]) -> Any:
        """The state of some of its tracks, (N,) bool: `evaluate` leaves out those that have finished."""
        return None if state is None else tuple(part[:, torch.from_numpy(tracks)] for part in state)


def save_actor(folder: Path, policy: ActorCriticPolicy, card: dict[str, Any]) -> None:
    """Write weights and card, each whole or not at all."""
    shape = policy.observation_space.shape
    assert shape is not None
    assert isinstance(policy.action_space, spaces.Discrete)
    card = card | {"observation_width": shape[0], "actions": int(policy.action_space.n)}
    beliefs = beliefs_of(policy)
    if beliefs is not None:
        card["beliefs_hidden"] = beliefs.hidden
    save_policy(folder, policy.state_dict(), card)


def load_actor(folder: Path, weights: dict[str, Tensor], card: dict[str, Any]) -> ActorCriticPolicy:
    """The policy of the weights and card that `run_folder.load_policy` read in a folder.

    Raises:
        ArgumentError: they do not fit together.
    """
    try:
        space = spaces.Box(-np.inf, np.inf, (int(card["observation_width"]),), np.float32)
        entry = card["recipe"]["entry"]
        policy = make_policy(
            space, spaces.Discrete(int(card["actions"])), entry["policy_kwargs"],
            tuple(entry.get("observe", ())), entry["algo"] == "recurrent_ppo",
        )  # fmt: skip
        if "beliefs_hidden" in card:
            policy.beliefs = SequenceNet(int(card["beliefs_hidden"]))
        policy.load_state_dict(weights)
    except ImportError:
        raise reject("run", str(folder), 'sb3-contrib: pip install "hybrid-track[recurrent]"') from None
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable(folder, error) from None
    policy.set_training_mode(False)
    return policy
