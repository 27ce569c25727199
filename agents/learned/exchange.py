"""Policies that other libraries write: the zip files of Stable-Baselines3 and sb3-contrib, and
ONNX files.
"""

import pickle
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from agents.interface.world_arguments import trusted
from agents.learned.onnx_file import read_network
from agents.learned.policy import VALUE_THRESHOLDS, actor_decider, check_actions, make_policy
from agents.learned.policy_file import (
    LARGEST_FILE,
    LARGEST_WIDTH,
    check_finite,
    first_line,
    load_weights,
)
from agents.learned.torch_defaults import own_defaults
from agents.learned.zip_file import read_model
from baselines.rules.decider import Decider
from baselines.rules.external import external_decider
from hybrid_env.checks import ArgumentError, reject

HOW_TO_TRUST = "--trust unpickles it, which runs the code in the file"
ACTIVATIONS = {
    kind.__name__: kind for kind in (nn.Tanh, nn.ReLU, nn.ELU, nn.LeakyReLU, nn.SiLU, nn.GELU)
}
STATISTICS = "vecnormalize.pkl", "vec_normalize.pkl"
"""Usual names of the file of `VecNormalize`."""


class RowNetwork(nn.Module):
    """A network from rows (N, width) to one number for each action (N, A), in place of the
    policy of an actor.
    """

    def __init__(self, network: Callable[[Tensor], Tensor], width: int, actions: int):
        super().__init__()
        self.network = network
        self.observation_space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        self.action_space = spaces.Discrete(actions)

    def forward(self, rows: Tensor) -> Tensor:
        """Return the numbers."""
        return self.network(rows)


@own_defaults()
def exchanged_decider(path: Path, options: Any) -> Decider:
    """Return the policy of a file as a decider.

    An actor has thresholds on its log-odds, a network of action values on their differences; an
    ONNX file that returns actions has none. Nothing is unpickled but tensors, unless policies are
    `trusted`. The input of "policy.onnx" are rows (N, width), its first output logits (N, A) or
    actions (N,).
    """
    if not path.is_file() or path.stat().st_size > LARGEST_FILE:
        raise reject("decider", str(path), f"a file of at most {LARGEST_FILE:,} bytes")
    try:
        decider: Decider = (_from_zip if path.suffix == ".zip" else _from_onnx)(path, options)
    except ArgumentError as error:
        raise ArgumentError(f"{path.name}: {error}") from error
    except ImportError as error:
        raise reject("decider", str(path), f"an installed package {error.name}") from None
    except Exception as error:
        raise reject(
            "decider",
            str(path),
            f"a policy that can be read ({first_line(error)})",
        ) from error
    return decider


def _from_zip(path: Path, options: Any) -> Decider:
    """Return the policy that a model of Stable-Baselines3 or sb3-contrib saved."""
    if trusted():
        return _unpickled(path, options)
    data, weights = read_model(path)
    if data.get("_last_original_obs") is not None:
        where = _statistics_file(path) or f"a {STATISTICS[0]} beside it"
        _warn_of_raw_rows(path, f"--trust unpickles their statistics from {where}")
    kwargs = data.get("policy_kwargs") or {}
    for name in ("q_net.q_net", "quantile_net.quantile_net"):
        if f"{name}.0.weight" in weights:
            values = _value_network(weights, name, kwargs)
            actor = _actor(values, path, options)
            return actor.changed(symbol="value difference", thresholds=VALUE_THRESHOLDS)
    layers = {
        head: _layers(weights, f"mlp_extractor.{net}")
        for head, net in (("pi", "policy_net"), ("vf", "value_net"))
    }
    widths = {
        head: [len(weights[f"{layer}.bias"]) for layer in each] for head, each in layers.items()
    }
    settings: dict[str, Any] = {
        "net_arch": widths,
        "ortho_init": False,
        "activation_fn": _activation(kwargs, nn.Tanh),
    }
    lstm = weights.get("lstm_actor.weight_ih_l0")
    kind: Any = ActorCriticPolicy
    if lstm is not None:
        from sb3_contrib.ppo_recurrent import MlpLstmPolicy

        kind = MlpLstmPolicy
        settings |= {
            "lstm_hidden_size": lstm.shape[0] // 4,
            "n_lstm_layers": sum(name.startswith("lstm_actor.weight_ih") for name in weights),
            "enable_critic_lstm": "lstm_critic.weight_ih_l0" in weights,
            "shared_lstm": "lstm_critic.weight_ih_l0" not in weights
            and "critic.weight" not in weights,
        }
    if "action_net.weight" not in weights:
        raise ValueError(f"it has no actor or value network of the usual names; {HOW_TO_TRUST}")
    first = weights[f"{(*layers['pi'], 'action_net')[0]}.weight"] if lstm is None else lstm
    width = first.shape[1]
    actions = len(weights["action_net.bias"])
    sizes = [width, actions, settings.get("lstm_hidden_size", 0), *widths["pi"], *widths["vf"]]
    # Its layers are created before they are compared with the weights.
    if max(sizes) > LARGEST_WIDTH or len(sizes) > 20 or settings.get("n_lstm_layers", 0) > 4:
        raise ValueError(f"it is wider than {LARGEST_WIDTH}, or has too many layers")
    space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
    policy = make_policy(space, spaces.Discrete(actions), settings, kind=kind)
    try:
        load_weights(policy, weights)
    except ValueError as error:
        raise ValueError(f"{error}; {HOW_TO_TRUST}") from None
    return _actor(policy, path, options)


def _actor(policy: Any, path: Path, options: Any) -> Decider:
    """Return a policy as a decider, after a call with two rows."""
    (width,) = policy.observation_space.shape
    actions = int(policy.action_space.n)
    check_actions(actions, width, options.switches)
    policy.eval()
    decider = actor_decider(policy, options.switches)
    logits, _ = decider.logits(np.zeros((2, width), np.float32))
    if logits.shape != (2, actions) or not np.isfinite(logits).all():
        raise ValueError(
            f"it returns {logits.shape} numbers for two rows, or some that are not finite"
        )
    return decider.changed(title=path.stem)


def _layers(weights: dict[str, Tensor], name: str) -> list[str]:
    """Return the names of the linear layers of a network, from its input on."""
    layers = [
        key.removesuffix(".bias") for key in weights if re.fullmatch(rf"{name}\.\d+\.bias", key)
    ]
    return sorted(layers, key=lambda layer: int(layer.split(".")[-1]))


def _value_network(
    weights: dict[str, Tensor],
    name: str,
    kwargs: Any,
) -> RowNetwork:
    """Return the network of the action values of DQN, or of the means of the quantiles of
    QR-DQN.
    """
    layers: list[nn.Module] = []
    for key in _layers(weights, name):
        parts = {part: weights[f"{key}.{part}"] for part in ("weight", "bias")}
        outputs, inputs = parts["weight"].shape
        layer = nn.Linear(inputs, outputs, device="meta")
        load_weights(layer, parts)
        layers += [layer, _activation(kwargs, nn.ReLU)()]
    network = nn.Sequential(*layers[:-1])
    width = weights[f"{name}.0.weight"].shape[1]
    if not name.startswith("quantile"):
        return RowNetwork(network, width, outputs)
    count = int(kwargs.get("n_quantiles", 200))
    return RowNetwork(
        lambda rows: network(rows).view(len(rows), count, -1).mean(1),
        width,
        outputs // count,
    )


def _activation(kwargs: Any, default: type[nn.Module]) -> type[nn.Module]:
    """Return the activation function that is named in the plain text of the keyword arguments."""
    name = re.sub(r".*\.|['>]", "", str(kwargs.get("activation_fn", default.__name__)))
    if name not in ACTIVATIONS:
        raise ValueError(f"its activation function is {name}; {HOW_TO_TRUST}")
    return ACTIVATIONS[name]


def _unpickled(path: Path, options: Any) -> Decider:
    """Return the policy of a zip file as the library makes it, with the classes in the file."""
    from stable_baselines3.common.save_util import load_from_zip_file

    data, params, _ = load_from_zip_file(path, device="cpu")
    assert data is not None
    both = data["observation_space"], data["action_space"]
    policy = data["policy_class"](*both, lambda _: 0.0, **data["policy_kwargs"])
    policy.load_state_dict(params["policy"])
    for name, weights in policy.state_dict().items():
        check_finite(name, weights)
    policy.set_training_mode(False)
    if data.get("_last_original_obs") is not None:
        _normalise(policy, path)
    if hasattr(policy, "action_net") and hasattr(policy, "mlp_extractor"):
        return _actor(policy, path, options)
    return external_decider(policy, str(path), options).changed(title=path.stem)


def _from_onnx(path: Path, options: Any) -> Decider:
    """Return the policy of an ONNX file: logits as an actor, actions as they are."""
    network, (width, *actions) = read_network(path)
    if not actions:
        return external_decider(network, str(path), options).changed(title=path.stem)
    return _actor(
        RowNetwork(lambda rows: torch.from_numpy(network(rows.numpy())), width, *actions),
        path,
        options,
    )


def _statistics_file(path: Path) -> Path | None:
    """Return the file of the statistics that belong to a model, as Stable-Baselines3 and its zoo
    name it, or None.
    """
    of_checkpoint = re.sub(r"(\d+_steps)$", r"vecnormalize_\1", path.stem)
    names = (f"{of_checkpoint}.pkl", f"{path.stem}/{STATISTICS[0]}", *STATISTICS)
    files = (path.parent / name for name in names)
    return next((file for file in files if file.is_file()), None)


def _normalise(policy: nn.Module, path: Path) -> None:
    """Let a policy see normalised observations, by the statistics in the file beside its own,
    which is unpickled.
    """
    from stable_baselines3.common.vec_env import VecNormalize

    file = _statistics_file(path)
    if file is None:
        _warn_of_raw_rows(path, f"there is no {STATISTICS[0]} beside it")
        return
    statistics = pickle.loads(file.read_bytes())
    if not isinstance(statistics, VecNormalize):
        raise ValueError(f"{file.name} is not of VecNormalize but of {type(statistics).__name__}")

    def normalised(_: nn.Module, given: tuple[Tensor]) -> tuple[Tensor]:
        return (
            torch.from_numpy(np.asarray(statistics.normalize_obs(given[0].numpy()), np.float32)),
        )

    for part in policy.modules():
        if isinstance(part, BaseFeaturesExtractor):
            part.register_forward_pre_hook(normalised)


def _warn_of_raw_rows(path: Path, remedy: str) -> None:
    warnings.warn(
        f"{path.name} was trained on normalised observations and sees others: {remedy}",
        stacklevel=2,
    )
