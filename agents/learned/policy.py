"""A trained actor of Stable-Baselines3 as a decider, and its file."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from scipy.special import softmax
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor

from agents.learned.policy_file import (
    LARGEST_WIDTH,
    LAYOUTS,
    SavedPolicy,
    load_weights,
    unreadable_policy,
)
from agents.learned.torch_defaults import NetworkDecider, own_defaults
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Actions, Observations
from baselines.rules.msprt import mode_types
from baselines.rules.threshold import read_statement
from hybrid_env.checks import BoolArray, FloatArray, check_integer, reject
from hybrid_env.observation import Layout
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel

# Wait, straight, left, right.
TYPE_ACTIONS = 4
# In place of a quantity that is observed.
POSTERIOR = "posterior"
VALUE_THRESHOLDS = (
    -1.0,
    -0.5,
    -0.3,
    -0.2,
    -0.1,
    -0.05,
    -0.02,
    -0.01,
    0.0,
    0.01,
    0.02,
    0.05,
    0.1,
    0.2,
    0.5,
)
"""On the differences of action values, in units of the reward."""


class ObservationFeatures(BaseFeaturesExtractor):
    """Features extractor that selects quantities of an observation row by name.

    `observe` has keys of the layout, or "posterior": the posterior of each hypothesis, under equal
    priors where the observation has no probabilities.
    """

    def __init__(
        self,
        observation_space: spaces.Box,
        observe: tuple[str, ...],
        layout: type[Layout] = Layout,
    ):
        rows = layout.of_width(observation_space.shape[0])
        known = (*rows.slices, POSTERIOR)
        for name in observe:
            if name not in known:
                raise reject("observe", name, ", ".join(known))
        columns = [
            k for name in observe if name != POSTERIOR for k in range(rows.width)[rows.slices[name]]
        ]
        hypotheses = rows.hypotheses if POSTERIOR in observe else 0
        super().__init__(observation_space, len(columns) + hypotheses)
        self.columns = torch.tensor(columns, dtype=torch.int64)
        logarithms = "log_probability" if "log_probability" in rows.slices else "log_ratio"
        first = rows.slices[logarithms].start
        self.logarithms, self.log_scale = slice(first, first + hypotheses), rows.scales[logarithms]

    def forward(self, rows: Tensor) -> Tensor:
        """Return features (N, features) of observation rows (N, width)."""
        posterior = torch.softmax(rows[:, self.logarithms] / self.log_scale, dim=-1)
        return torch.cat([posterior, rows[:, self.columns]], dim=-1)


def policy_kwargs_with_features(
    policy_kwargs: Mapping[str, Any],
    observe: tuple[str, ...],
    layout: type[Layout],
) -> dict[str, Any]:
    """Return `policy_kwargs` with the features extractor added; unchanged if `observe` is empty."""
    if not observe:
        return dict(policy_kwargs)
    keywords = {"observe": observe, "layout": layout}
    return {
        **policy_kwargs,
        "features_extractor_class": ObservationFeatures,
        "features_extractor_kwargs": keywords,
    }


def make_policy(
    observation_space: spaces.Space[Any],
    action_space: spaces.Space[Any],
    policy_kwargs: dict[str, Any],
    observe: tuple[str, ...] = (),
    kind: Any = ActorCriticPolicy,
    layout: type[Layout] = Layout,
) -> BasePolicy:
    """Create an untrained policy of a class for one track, which observes some quantities of the
    layout, or all if there are none.
    """
    keywords = policy_kwargs_with_features(policy_kwargs, observe, layout)
    policy: BasePolicy = kind(observation_space, action_space, lambda _: 0.0, **keywords)
    return policy


def value_network(policy: Any) -> Any:
    """Return the network of the action values of DQN, or of their quantiles of QR-DQN; None of
    other policies.
    """
    return getattr(policy, "q_net", getattr(policy, "quantile_net", None))


class ActorDecider(NetworkDecider):
    """Base class of the deciders of a trained actor; the subclasses choose actions from its logits.

    Action values of DQN and QR-DQN take the place of logits, and their differences that of
    log-odds. A network from rows to one number for each action may take the place of the policy.
    """

    symbol = "log-odds"

    def __init__(self, policy: Any, threshold: float = 0.0):
        super().__init__(threshold)
        self.policy = policy
        width = policy.observation_space.shape[0]
        self.hypotheses: int = LAYOUTS[self.task].of_width(width).hypotheses
        self.generator = np.random.default_rng(0)
        if value_network(policy) is not None:
            self.symbol = "value difference"
            self.thresholds = VALUE_THRESHOLDS

    @torch.no_grad()
    def logits(
        self,
        rows: Observations,
        state: Any = None,
        episode_start: Any = None,
    ) -> tuple[FloatArray, Any]:
        """Return logits (N, actions) and the LSTM state: None, or two tensors (layers, N,
        hidden).
        """
        inputs = torch.as_tensor(rows)
        if not isinstance(self.policy, ActorCriticPolicy):
            values = (value_network(self.policy) or self.policy)(inputs)
            return (values.mean(1) if values.ndim == 3 else values).numpy().astype(np.float64), None
        lstm: Any = getattr(self.policy, "lstm_actor", None)
        features: Tensor = self.policy.pi_features_extractor(inputs)
        if lstm is not None:
            if state is None:
                state = (torch.zeros(lstm.num_layers, len(rows), lstm.hidden_size),) * 2
            starts = (
                torch.zeros(len(rows))
                if episode_start is None
                else torch.as_tensor(episode_start).float()
            )
            features, state = self.policy._process_sequence(features, state, starts, lstm)  # type: ignore[operator]
        hidden = self.policy.mlp_extractor.forward_actor(features)
        return self.policy.action_net(hidden).numpy().astype(np.float64), state

    def sample(self, logits: FloatArray) -> FloatArray:
        """Return logits (N, actions) with noise, the largest of which is a sample of the policy."""
        return logits + self.generator.gumbel(size=logits.shape)

    def choose(self, logits: FloatArray, observation: Observations, deterministic: bool) -> Actions:
        """Return the actions (N,), from logits (N, actions) and observation rows (N, width)."""
        raise NotImplementedError

    def predict(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Actions, Any]:
        """See `Decider.predict`. Only an LSTM policy has a state. Sampling ignores the
        threshold.
        """
        expected = self.policy.observation_space.shape
        if observation.shape[1:] != expected:
            raise reject(
                "observation shape",
                observation.shape,
                f"(N, *{expected}), as in training",
            )
        logits, state = self.logits(observation, state, episode_start)
        return self.choose(logits, observation, deterministic), state

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        return None if state is None else tuple(part[:, torch.from_numpy(tracks)] for part in state)


class PolicyDecider(ActorDecider):
    """Declares a hypothesis once the policy's log-odds of declaring exceed a threshold.

    At threshold 0 this is the policy's most probable action; other thresholds trade decision time
    against accuracy. A policy with M + 1 actions declares the hypothesis with the largest logit,
    one with 4 actions the most likely hypothesis of the type (straight, left or right) with the
    largest logit, and one with 2 actions the most likely hypothesis of the bank. The threshold is
    on ln p(the declaration) - ln p(wait).
    """

    task = ANNOUNCED
    thresholds = (
        -10.0,
        -8.0,
        -6.0,
        -5.0,
        -4.0,
        -3.0,
        -2.0,
        -1.5,
        -1.0,
        -0.5,
        0.0,
        0.5,
        1.0,
        1.5,
        2.0,
        2.5,
        3.0,
        4.0,
    )

    def choose(self, logits: FloatArray, observation: Observations, deterministic: bool) -> Actions:
        if not deterministic:
            logits = self.sample(logits)
        declare = logits[:, 1:].argmax(1)
        odds = logits[np.arange(len(logits)), declare + 1] - logits[:, 0]
        log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
        if logits.shape[1] == 2:
            declare = log_ratio.argmax(-1)
        elif logits.shape[1] == TYPE_ACTIONS:
            of_type = mode_types(log_ratio.shape[1]) == declare[:, None]
            declare = np.where(of_type, log_ratio, -np.inf).argmax(-1)
        return np.where(odds > (self.threshold if deterministic else 0.0), declare + 1, 0)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`; one curve for all hypotheses if the bank chooses the
        one.
        """
        single = self.policy.action_space == spaces.Discrete(2)
        return self.log_odds_panel(15.0, 5.0, "single" if single else "hypothesis")

    def evidence(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the log-odds of declaring each hypothesis against waiting, (N, M)."""
        logits = self.logits(observation, state, episode_start)[0]
        odds = logits[:, 1:] - logits[:, :1]
        if logits.shape[1] == TYPE_ACTIONS:
            return odds[:, mode_types(self.hypotheses)]
        return np.broadcast_to(odds, (len(logits), self.hypotheses))


class StatementPolicyDecider(ActorDecider):
    """Changes its statement to the policy's most probable mode if the log-odds exceed a margin.

    At margin 0 it states the policy's most probable mode. A larger margin changes the statement
    later and less often to a wrong mode. The first statement of an episode is the most probable
    mode. The threshold is a margin on ln p(another mode) - ln p(the stated mode); a negative one
    has no effect.
    """

    task = UNKNOWN
    thresholds = 0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 13.0, 16.0, 20.0

    def choose(self, logits: FloatArray, observation: Observations, deterministic: bool) -> Actions:
        """See `ActorDecider.choose`; action i states mode i."""
        if not deterministic:
            return self.sample(logits).argmax(1)
        best = logits.argmax(1)
        stated, started = read_statement(observation)
        tracks = np.arange(len(logits))
        odds = logits[tracks, best] - logits[tracks, stated]
        return np.where((odds > self.threshold) | ~started, best, stated)

    def panel(self) -> EvidencePanel:
        return probability_panel("policy")

    def evidence(
        self,
        observation: Observations,
        state: Any = None,
        episode_start: Any = None,
    ) -> FloatArray:
        """Return the probabilities of the modes by the policy, (N, M)."""
        return np.asarray(softmax(self.logits(observation, state, episode_start)[0], axis=-1))


def actor_decider(policy: Any, task: str) -> ActorDecider:
    """Return the decider of an actor for a task."""
    kind = next(kind for kind in ActorDecider.__subclasses__() if kind.task == task)
    return kind(policy)


@own_defaults()
def load_actor(
    saved: SavedPolicy,
    kind: Any,
    check_network: Callable[[Any], None],
) -> BasePolicy:
    """Return the policy of weights and card; refuse them if they differ.

    Args:
        saved: weights and card.
        kind: class of the policy.
        check_network: raises `ArgumentError` for keyword arguments that are not allowed.
    """
    try:
        entry, task, card = saved.entry, saved.task, saved.card
        keywords = entry["policy_kwargs"]
        check_network(keywords)
        if issubclass(kind, ActorCriticPolicy):
            # Slow, and the weights are replaced.
            keywords = keywords | {"ortho_init": False}
        width = check_integer("observation_width", card["observation_width"], maximum=LARGEST_WIDTH)
        actions = check_integer("actions", card["actions"], maximum=LARGEST_WIDTH)
        check_actions(actions, width, task)
        space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        observe = tuple(entry.get("observe", ()))
        # The limits on widths and layers keep this below 200 MB, whatever the card says.
        policy = make_policy(
            space,
            spaces.Discrete(actions),
            keywords,
            observe,
            kind,
            LAYOUTS[task],
        )
        load_weights(policy, saved.weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise unreadable_policy(saved.folder, error) from None
    policy.set_training_mode(False)
    return policy


def check_actions(actions: int, width: int, task: str) -> None:
    """Raise `ArgumentError` if an actor cannot have this number of actions for rows (N, width)."""
    hypotheses = LAYOUTS[task].of_width(width).hypotheses
    allowed = (hypotheses,) if task == UNKNOWN else (2, TYPE_ACTIONS, hypotheses + 1)
    if actions not in allowed:
        raise reject("actions", actions, " or ".join(map(str, allowed)))
