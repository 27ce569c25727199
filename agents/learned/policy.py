"""A trained actor of Stable-Baselines3 as a decider, read from its weights."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from scipy.special import softmax
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from agents.learned.policy_file import LAYOUTS
from agents.learned.torch_defaults import NetworkDecider
from baselines.rules.decider import ANNOUNCED, UNKNOWN, Actions, Observations
from baselines.rules.threshold import read_statement
from hybrid_env.checks import BoolArray, FloatArray, IntArray, reject
from hybrid_env.model_options import ModelOptions
from hybrid_env.observation import Layout
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel


class ObservationFeatures(BaseFeaturesExtractor):
    """Features extractor that selects quantities of an observation row by name.

    `observe` has keys of the layout, or "posterior": the posterior of each hypothesis, under equal
    priors where the observation has no probabilities. With modes of the user, whose rows have
    numbers of any size, PPO learns much better from the posterior and the time alone:

        keywords = {
            "features_extractor_class": ObservationFeatures,
            "features_extractor_kwargs": {"observe": ("posterior", "ticks", "ticks_left")},
        }
        model = PPO("MlpPolicy", gym.make(id, modes=modes), policy_kwargs=keywords)
    """

    def __init__(
        self, observation_space: spaces.Box, observe: tuple[str, ...], layout: type[Layout] = Layout
    ):
        rows = layout.of_width(observation_space.shape[0])
        posterior = "posterior"
        known = (*rows.slices, posterior)
        for name in observe:
            if name not in known:
                raise reject("observe", name, ", ".join(known))
        columns = [
            k for name in observe if name != posterior for k in range(rows.width)[rows.slices[name]]
        ]
        hypotheses = rows.hypotheses if posterior in observe else 0
        super().__init__(observation_space, len(columns) + hypotheses)
        self.columns = torch.tensor(columns, dtype=torch.int64)
        logarithms = "log_probability" if "log_probability" in rows.slices else "log_ratio"
        first = rows.slices[logarithms].start
        self.logarithms, self.log_scale = slice(first, first + hypotheses), rows.scales[logarithms]

    def forward(self, rows: Tensor) -> Tensor:
        """Return features (N, features) of observation rows (N, width)."""
        posterior = torch.softmax(rows[:, self.logarithms] / self.log_scale, dim=-1)
        return torch.cat([posterior, rows[:, self.columns]], dim=-1)


class Actor(nn.Module):
    """The network of a policy, from rows (N, width) to one number for each action (N, A): a logit,
    or with `values` an action value.

    Args:
        network: from features, or from the outputs of an LSTM, to these numbers.
        width, actions: of the rows, and A.
        lstm: between features and network, or None.
        features: from rows; None for the rows themselves.
        values: see above.
        quantiles: outputs of the network for each action, whose mean is its value.
    """

    def __init__(
        self,
        network: Callable[[Tensor], Tensor],
        width: int,
        actions: int,
        lstm: nn.LSTM | None = None,
        features: nn.Module | None = None,
        values: bool = False,
        quantiles: int = 1,
    ):
        super().__init__()
        self.network, self.lstm, self.features = network, lstm, features or nn.Identity()
        self.width, self.actions, self.values = width, actions, values
        self.quantiles = quantiles

    def forward(self, rows: Tensor, state: Any = None, starts: Any = None) -> tuple[Tensor, Any]:
        """Return the numbers and the state of the LSTM: None, or two tensors (layers, N, hidden).
        `starts` (N,) is True where an episode begins.
        """
        hidden = self.features(rows)
        if self.lstm is not None:
            if state is None:
                zeros = torch.zeros(self.lstm.num_layers, len(rows), self.lstm.hidden_size)
                state = zeros, zeros
            elif starts is not None:
                going_on = 1.0 - torch.as_tensor(starts).float()[None, :, None]
                state = tuple(part * going_on for part in state)
            outputs, state = self.lstm(hidden[None], state)
            hidden = outputs[0]
        numbers = self.network(hidden).unflatten(-1, (self.quantiles, -1))
        return numbers.mean(1), state


def read_actor(
    weights: Mapping[str, Tensor],
    features: nn.Module | None = None,
    width: int | None = None,
    activation: type[nn.Module] | None = None,
    quantiles: int = 200,
) -> Actor:
    """Return the actor of weights with the usual names of Stable-Baselines3 and sb3-contrib.

    Args:
        weights: of a policy of PPO, A2C, RecurrentPPO, DQN or QR-DQN.
        features: of rows; None for the rows themselves.
        width: of the rows; None is the number of inputs.
        activation: function between layers; None is that of the library.
        quantiles: of QR-DQN for each action.

    Raises:
        ValueError: there are weights of other names.
        RuntimeError: there are weights of other shapes.
        KeyError: there is a weight too few.
    """
    heads = ("q_net.q_net", "quantile_net.quantile_net", "mlp_extractor.policy_net")
    head = next(
        (head for head in heads if any(name.startswith(f"{head}.") for name in weights)), heads[-1]
    )
    values = head != heads[-1]
    used: set[str] = set()

    def fill(kind: Callable[..., nn.Module], name: str, *shape: int) -> nn.Module:
        """Return a layer with the weights of a name."""
        parts = {part for part in weights if part.startswith(f"{name}.")}
        used.update(parts)
        layer = kind(*shape, device="meta")
        given = {part.removeprefix(f"{name}."): weights[part] for part in parts}
        layer.load_state_dict(given, assign=True)
        return layer

    pattern = rf"{re.escape(head)}\.(\d+)\.bias"
    indices = sorted(int(match[1]) for name in weights if (match := re.fullmatch(pattern, name)))
    between = activation or (nn.ReLU if values else nn.Tanh)
    layers: list[Any] = []
    for name in (*(f"{head}.{k}" for k in indices), *(() if values else ("action_net",))):
        outputs, inputs = weights[f"{name}.weight"].shape
        layers += [fill(nn.Linear, name, inputs, outputs), between()]
    network = nn.Sequential(*layers[:-1])
    lstm: Any = None
    inputs = layers[0].in_features
    if "lstm_actor.weight_hh_l0" in weights:
        inputs = weights["lstm_actor.weight_ih_l0"].shape[1]
        hidden = weights["lstm_actor.weight_hh_l0"].shape[1]
        count = sum(name.startswith("lstm_actor.weight_ih") for name in weights)
        lstm = fill(nn.LSTM, "lstm_actor", inputs, hidden, count)
    critics = "mlp_extractor.value_net.", "value_net.", "lstm_critic.", "critic."
    targets = "q_net_target.", "quantile_net_target."
    for name in weights:
        if name not in used and not name.startswith(critics + targets):
            raise ValueError(f"its weights {name[:40]!r} are not of a usual network")
    count = quantiles if head == "quantile_net.quantile_net" else 1
    if outputs % count:
        raise ValueError(f"its {outputs} outputs are not {count} quantiles of each action")
    actions = outputs // count
    return Actor(network, width or inputs, actions, lstm, features, values, count).eval()


class ActorDecider(NetworkDecider):
    """Base class of the deciders of a trained actor; the subclasses choose actions from its logits.

    Action values of DQN and QR-DQN take the place of logits, and their differences that of
    log-odds.
    """

    symbol = "log-odds"

    def __init__(self, actor: Actor, types: IntArray, threshold: float = 0.0):
        super().__init__(threshold)
        self.actor = actor
        M: int = LAYOUTS[self.task].of_width(actor.width).hypotheses
        self.hypotheses = M
        # By the number of actions: that of each hypothesis, besides the one that waits.
        choices = {2: np.zeros(M, np.int64), types.max() + 2: types, M + 1: np.arange(M)}
        if self.task == UNKNOWN:
            choices = {M: np.arange(M)}
        if actor.actions not in choices:
            raise reject("actions", actor.actions, f"those of {M} hypotheses")
        self.choices = choices[actor.actions]
        self.generator = np.random.default_rng(0)
        if actor.values:
            self.symbol = "value difference"
            # In units of the reward.
            positive = 0.01, 0.02, 0.05, 0.1, 0.2, 0.5
            negative = (-1.0, -0.5, -0.3, -0.2, -0.1, -0.05, -0.02, -0.01)
            self.thresholds = (*negative, 0.0, *positive)

    @torch.no_grad()
    def logits(
        self, rows: Observations, state: Any = None, episode_start: Any = None
    ) -> tuple[FloatArray, Any]:
        """Return logits (N, actions) and the state of the actor."""
        logits, state = self.actor(torch.as_tensor(rows), state, episode_start)
        return logits.numpy().astype(np.float64), state

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
        if observation.shape[1:] != (self.actor.width,):
            allowed = f"(N, {self.actor.width}), as in training"
            raise reject("observation shape", observation.shape, allowed)
        logits, state = self.logits(observation, state, episode_start)
        return self.choose(logits, observation, deterministic), state

    def select_tracks(self, state: Any, tracks: BoolArray) -> Any:
        return None if state is None else tuple(part[:, torch.from_numpy(tracks)] for part in state)


class PolicyDecider(ActorDecider):
    """Declares a hypothesis once the policy's log-odds of declaring exceed a threshold.

    At threshold 0 this is the policy's most probable action; other thresholds trade decision time
    against accuracy. A policy with M + 1 actions declares the hypothesis with the largest logit,
    one with an action for each type of modes the most likely hypothesis of the type with the
    largest logit, and one with 2 actions the most likely hypothesis of the bank. The threshold is
    on ln p(the declaration) - ln p(wait).
    """

    task = ANNOUNCED
    thresholds = (
        *(-10.0, -8.0, -6.0, -5.0, -4.0, -3.0, -2.0, -1.5, -1.0, -0.5),
        *(0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0),
    )

    def choose(self, logits: FloatArray, observation: Observations, deterministic: bool) -> Actions:
        if not deterministic:
            logits = self.sample(logits)
        best = logits[:, 1:].argmax(1)
        odds = logits[np.arange(len(logits)), best + 1] - logits[:, 0]
        log_ratio = Layout.of_rows(observation).read(observation, "log_ratio")
        declare = np.where(self.choices == best[:, None], log_ratio, -np.inf).argmax(-1)
        return np.where(odds > (self.threshold if deterministic else 0.0), declare + 1, 0)

    def panel(self) -> EvidencePanel:
        """Return the panel of `evidence`; one curve for all hypotheses if the bank chooses the
        one.
        """
        return self.log_odds_panel(15.0, 5.0, "single" if self.actor.actions == 2 else "hypothesis")

    def evidence(
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the log-odds of declaring each hypothesis against waiting, (N, M)."""
        logits = self.logits(observation, state, episode_start)[0]
        return (logits[:, 1:] - logits[:, :1])[:, self.choices]


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
        self, observation: Observations, state: Any = None, episode_start: Any = None
    ) -> FloatArray:
        """Return the probabilities of the modes by the policy, (N, M)."""
        return np.asarray(softmax(self.logits(observation, state, episode_start)[0], axis=-1))


def actor_decider(actor: Actor, options: ModelOptions) -> ActorDecider:
    """Return the decider of an actor for the options of an environment; `ArgumentError` if it has
    not the actions.
    """
    kind = StatementPolicyDecider if options.switches == UNKNOWN else PolicyDecider
    return kind(actor, options.types)
