"""Policies that other libraries write: the zip files of Stable-Baselines3 and sb3-contrib, and ONNX files."""

import io
import json
import re
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor, nn

from agents.interface.world_arguments import trusted
from agents.learned.policy import ACTORS, LARGEST_WIDTH, VALUE_THRESHOLDS, check_actions, make_policy
from agents.learned.policy_file import LARGEST_FILE, LAYOUTS, first_line, load_weights
from baselines.rules.decider import DeciderFamily
from baselines.rules.own import own_family
from hybrid_env.checks import ArgumentError, reject

HOW_TO_TRUST = "--trust unpickles it, which runs the code in the file"
QUANTILES = 200  # of QR-DQN, by default
ACTIVATIONS = {kind.__name__: kind for kind in (nn.Tanh, nn.ReLU, nn.ELU, nn.LeakyReLU, nn.SiLU, nn.GELU)}
HEADS = {"pi": "policy_net", "vf": "value_net"}
VALUE_NETS = {"q_net.q_net": "DQN", "quantile_net.quantile_net": "QR-DQN"}


class RowNetwork(nn.Module):
    """A network from rows (N, width) to one number for each action (N, A), in place of the policy of an actor."""

    def __init__(self, network: Callable[[Tensor], Tensor], width: int, actions: int):
        super().__init__()
        self.network = network
        self.observation_space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
        self.action_space = spaces.Discrete(actions)

    def forward(self, rows: Tensor) -> Tensor:
        """Return the numbers."""
        return self.network(rows)


def exchanged_family(path: Path, options: Any) -> DeciderFamily:
    """Return the policy of a file at any threshold.

    An actor has thresholds on its log-odds, a network of action values on their differences; an ONNX file
    that returns actions has none. Nothing is unpickled but tensors, unless policies are `trusted`. The
    input of "policy.onnx" are rows (N, width), its first output logits (N, A) or actions (N,).
    """
    if not path.is_file() or path.stat().st_size > LARGEST_FILE:
        raise reject("decider", str(path), f"a file of at most {LARGEST_FILE:,} bytes")
    try:
        family = (_from_zip if path.suffix == ".zip" else _from_onnx)(path, options)
    except ArgumentError as error:
        raise ArgumentError(f"{path.name}: {error}") from error
    except ImportError as error:
        raise reject("decider", str(path), f"an installed package {error.name}") from None
    except Exception as error:
        raise reject("decider", str(path), f"a policy that can be read ({first_line(error)})") from error
    if family.hypotheses not in (None, options.hypotheses):
        allowed = f"a policy for {options.hypotheses} hypotheses; this one is for {family.hypotheses}"
        raise reject("decider", str(path), allowed)
    return family


def _from_zip(path: Path, options: Any) -> DeciderFamily:
    """Return the policy that a model of Stable-Baselines3 or sb3-contrib saved."""
    if trusted():
        return _unpickled(path, options)
    with zipfile.ZipFile(path) as file:
        if sum(file.getinfo(name).file_size for name in ("data", "policy.pth")) > LARGEST_FILE:
            raise ValueError(f"its policy is larger than {LARGEST_FILE:,} bytes")
        data = json.loads(file.read("data"))
        weights = torch.load(io.BytesIO(file.read("policy.pth")), map_location="cpu", weights_only=True)
    kwargs = data.get("policy_kwargs") or {}
    for name, kind in VALUE_NETS.items():
        if f"{name}.0.weight" in weights:
            values = _value_network(weights, name, kwargs, quantiles=kind == "QR-DQN")
            family = _actor(values, path, options)
            return replace(family, symbol="value difference", thresholds=VALUE_THRESHOLDS)
    layers = {head: _layers(weights, f"mlp_extractor.{net}") for head, net in HEADS.items()}
    widths = {head: [len(weights[f"{layer}.bias"]) for layer in each] for head, each in layers.items()}
    settings: dict[str, Any] = {"net_arch": widths, "ortho_init": False, "activation_fn": _activation(kwargs, nn.Tanh)}
    lstm = weights.get("lstm_actor.weight_ih_l0")
    if lstm is not None:
        settings |= {
            "lstm_hidden_size": lstm.shape[0] // 4,
            "n_lstm_layers": sum(name.startswith("lstm_actor.weight_ih") for name in weights),
            "enable_critic_lstm": "lstm_critic.weight_ih_l0" in weights,
            "shared_lstm": "lstm_critic.weight_ih_l0" not in weights and "critic.weight" not in weights,
        }
    if "action_net.weight" not in weights:
        raise ValueError(f"it has no actor or value network of the usual names; {HOW_TO_TRUST}")
    first = weights[f"{(*layers['pi'], 'action_net')[0]}.weight"] if lstm is None else lstm
    width, actions = first.shape[1], len(weights["action_net.bias"])
    if max(width, actions, settings.get("lstm_hidden_size", 0), *widths["pi"], *widths["vf"]) > LARGEST_WIDTH:
        raise ValueError(f"it is wider than {LARGEST_WIDTH}")
    space = spaces.Box(-np.inf, np.inf, (width,), np.float32)
    policy = make_policy(space, spaces.Discrete(actions), settings, algo="ppo" if lstm is None else "recurrent_ppo")
    try:
        load_weights(policy, weights)
    except ValueError as error:
        raise ValueError(f"{error}; {HOW_TO_TRUST}") from None
    return _actor(policy, path, options)


def _actor(policy: Any, path: Path, options: Any) -> DeciderFamily:
    task, (width,) = options.switches, policy.observation_space.shape
    check_actions(int(policy.action_space.n), LAYOUTS[task].of_width(width).hypotheses, task)
    policy.eval()
    return ACTORS[task](policy).trained(path.stem)


def _layers(weights: dict[str, Tensor], name: str) -> list[str]:
    """Return the names of the linear layers of a network, from its input on."""
    found = [key.removesuffix(".bias") for key in weights if re.fullmatch(rf"{name}\.\d+\.bias", key)]
    return sorted(found, key=lambda one: int(one.split(".")[-1]))


def _value_network(weights: dict[str, Tensor], name: str, kwargs: Any, quantiles: bool) -> RowNetwork:
    """Return the network of the action values of DQN, or of the means of the quantiles of QR-DQN."""
    layers: list[nn.Module] = []
    for key in _layers(weights, name):
        own = {part: weights[f"{key}.{part}"] for part in ("weight", "bias")}
        outputs, inputs = own["weight"].shape
        layer = nn.Linear(inputs, outputs)
        load_weights(layer, own)
        layers += [layer, _activation(kwargs, nn.ReLU)()]
    network, width = nn.Sequential(*layers[:-1]), weights[f"{name}.0.weight"].shape[1]
    if not quantiles:
        return RowNetwork(network, width, outputs)
    given = re.search(r"\d+", str(kwargs.get("n_quantiles", QUANTILES)))
    count = int(given[0]) if given else QUANTILES
    return RowNetwork(lambda rows: network(rows).view(len(rows), count, -1).mean(1), width, outputs // count)


def _activation(kwargs: Any, default: type[nn.Module]) -> type[nn.Module]:
    """Return the activation function that is named in the plain text of the keyword arguments."""
    name = re.sub(r".*\.|['>]", "", str(kwargs.get("activation_fn", default.__name__)))
    if name not in ACTIVATIONS:
        raise ValueError(f"its activation function is {name}; {HOW_TO_TRUST}")
    return ACTIVATIONS[name]


def _unpickled(path: Path, options: Any) -> DeciderFamily:
    """Return the policy of a zip file as the library makes it, with the classes in the file."""
    from stable_baselines3.common.save_util import load_from_zip_file

    data, params, _ = load_from_zip_file(path, device="cpu")
    assert data is not None
    both = data["observation_space"], data["action_space"]
    policy = data["policy_class"](*both, lambda _: 0.0, **data["policy_kwargs"])
    policy.load_state_dict(params["policy"])
    policy.set_training_mode(False)
    if hasattr(policy, "action_net") and hasattr(policy, "mlp_extractor"):
        return _actor(policy, path, options)
    return replace(own_family(policy, str(path), options), name=path.stem)


def _from_onnx(path: Path, options: Any) -> DeciderFamily:
    """Return the policy of an ONNX file: logits as an actor, actions as they are."""
    import onnxruntime

    settings = onnxruntime.SessionOptions()
    settings.intra_op_num_threads = settings.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(path, settings, providers=["CPUExecutionProvider"])
    given, out = session.get_inputs(), session.get_outputs()[0]
    if len(given) != 1 or given[0].type != "tensor(float)" or len(given[0].shape) != 2:
        raise ValueError("its input is not float32 rows (N, width)")
    tracks, width = given[0].shape
    if isinstance(tracks, int):
        raise ValueError(f"it is for {tracks} rows: export it with a free first dimension")

    def run(rows: Any) -> Any:
        return session.run([out.name], {given[0].name: np.asarray(rows, np.float32)})[0]

    shape: Sequence[Any] = np.shape(run(np.zeros((1, width), np.float32)))
    if len(shape) == 1:
        return replace(own_family(run, str(path), options), name=path.stem)
    network = RowNetwork(lambda rows: torch.from_numpy(run(rows.numpy())), width, shape[1])
    return _actor(network, path, options)
