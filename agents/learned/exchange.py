"""Policies that another library writes: the zip files of Stable-Baselines3 and sb3-contrib."""

import pickle
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import Tensor, nn

from agents.interface.world_arguments import trusted
from agents.learned.policy import Actor, actor_decider, read_actor
from agents.learned.policy_file import LARGEST_POLICY, check_finite, short_message
from agents.learned.torch_defaults import torch_defaults
from agents.learned.zip_file import read_model
from baselines.rules.decider import Decider
from baselines.rules.external import external_decider
from hybrid_env.checks import ArgumentError, reject
from hybrid_env.extras import explained


@torch_defaults()
def exchanged_decider(path: Path, options: Any) -> Decider:
    """Return the policy of a file as a decider.

    An actor has thresholds on its log-odds, a network of action values on their differences.
    Nothing is unpickled but tensors, unless policies are `trusted`.
    """
    if not path.is_file() or path.stat().st_size > LARGEST_POLICY:
        raise reject(
            "decider", str(path), f"a file that exists, of at most {LARGEST_POLICY:,} bytes"
        )
    try:
        with explained():
            return _from_zip(path, options)
    except ArgumentError as error:
        raise ArgumentError(f"{path.name}: {error}") from error
    except Exception as error:
        raise reject(
            "decider", str(path), f"a policy that can be read ({short_message(error)})"
        ) from error


def _from_zip(path: Path, options: Any) -> Decider:
    """Return the policy that a model of Stable-Baselines3 or sb3-contrib saved."""
    data, weights = read_model(path)
    kwargs = data.get("policy_kwargs") or {}
    normalised = data.get("_last_original_obs") is not None
    try:
        # Named in plain text.
        name = re.sub(r".*\.|['>]", "", str(kwargs.get("activation_fn", "")))
        if name not in ("", "Tanh", "ReLU", "ELU", "LeakyReLU", "SiLU", "GELU"):
            raise ValueError(f"its activation function is {name}")
        policy: Any = read_actor(
            weights,
            activation=getattr(nn, name) if name else None,
            quantiles=int(kwargs.get("n_quantiles", 200)),
        )
    except (KeyError, ValueError, RuntimeError) as error:
        if not trusted():
            remedy = "--trust unpickles it, which runs the code in the file"
            raise ValueError(f"{short_message(error)}; {remedy}") from None
        policy = _unpickled(path)
    if normalised:
        _normalise(policy, path)
    space = data.get("observation_space")
    # Numbers of the environments have bounds; Gymnasium's statistics are not in the file.
    if isinstance(space, dict) and "False" in str(space.get("bounded_below")):
        warnings.warn(
            f"{path.name} was trained on observations without bounds, as of NormalizeObservation,"
            " and sees others: train with VecNormalize, or without a wrapper",
            stacklevel=2,
        )
    if not isinstance(policy, Actor):
        _check_width(policy.observation_space.shape[0], options)
        return external_decider(policy, str(path), options).changed(title=path.stem)
    _check_width(policy.width, options)
    decider = actor_decider(policy, options)
    # Layers that do not fit together are refused here, not in an episode.
    decider.logits(np.zeros((2, policy.width), np.float32))
    return decider.changed(title=path.stem)


def _check_width(width: int, options: Any) -> None:
    """Refuse a policy that reads several rows at once."""
    usual = options.layout_class(options.hypotheses).width
    if width > usual and width % usual == 0:
        rows = f"{width // usual} stacked rows of {usual} numbers, as of VecFrameStack"
        raise ArgumentError(f"the policy reads {rows}: expected one row")


def _unpickled(path: Path) -> nn.Module:
    """Return the policy of a zip file as the library makes it, with the classes in the file."""
    from stable_baselines3.common.save_util import load_from_zip_file

    data, params, _ = load_from_zip_file(path, device="cpu")
    assert data is not None
    both = data["observation_space"], data["action_space"]
    policy: Any = data["policy_class"](*both, lambda _: 0.0, **data["policy_kwargs"])
    policy.load_state_dict(params["policy"])
    for name, weights in policy.state_dict().items():
        check_finite(name, weights)
    policy.set_training_mode(False)
    return policy


def _normalise(policy: nn.Module, path: Path) -> None:
    """Let a policy see normalised observations, by the statistics in the file beside its own, which
    is unpickled; warn if there is none, or policies are not `trusted`.

    The file is named as by Stable-Baselines3 and its zoo.
    """
    from stable_baselines3.common.vec_env import VecNormalize

    usual = "vecnormalize.pkl"
    of_checkpoint = re.sub(r"(\d+_steps)$", r"vecnormalize_\1", path.stem)
    names = f"{of_checkpoint}.pkl", f"{path.stem}/{usual}", usual, "vec_normalize.pkl"
    file = next((path.parent / name for name in names if (path.parent / name).is_file()), None)
    if file is None or not trusted():
        remedy = f"--trust unpickles their statistics from {file or f'a {usual} beside it'}"
        warnings.warn(
            f"{path.name} was trained on normalised observations and sees others: {remedy}",
            stacklevel=2,
        )
        return
    statistics = pickle.loads(file.read_bytes())
    if not isinstance(statistics, VecNormalize):
        raise ValueError(f"{file.name} is not of VecNormalize but of {type(statistics).__name__}")

    def normalised(_: nn.Module, given: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
        rows = np.asarray(statistics.normalize_obs(given[0].numpy()), np.float32)
        return torch.from_numpy(rows), *given[1:]

    for part in policy.modules():
        if isinstance(part, (Actor, BaseFeaturesExtractor)):
            part.register_forward_pre_hook(normalised)
