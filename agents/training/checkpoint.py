"""Checkpoints: the whole state of a run in one safetensors file, so that it is always consistent.

Tensors are weights, optimizer state, tracks and hidden states; values are counters and random
generators, as JSON. Nothing is unpickled. The checkpoint before the last is kept, in case the last
one is damaged.
"""

import hashlib
import json
import math
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors.torch
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from torch import Tensor
from torch.optim import Optimizer

from agents.interface.output_files import atomic_file
from agents.learned.policy_file import LARGEST_WEIGHT, check_tensor_file, first_line
from hybrid_env.checks import ArgumentError, check_integer, check_positive, reject
from hybrid_env.vector_env import TrackVectorEnv

# Of the Mersenne twister.
WORDS = 624
CHECKPOINT = "checkpoint.safetensors"
PREVIOUS = "checkpoint-previous.safetensors"
# Bytes.
LARGEST_CHECKPOINT = 2**29
DAMAGE = (
    OSError,
    ArithmeticError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
    RuntimeError,
    SafetensorError,
)
"""Exceptions that reading a damaged checkpoint can raise."""


def track_arrays(env: TrackVectorEnv) -> dict[str, NDArray[Any]]:
    """Return all arrays that determine the next steps; writing into them changes the tracks."""
    world = env.world
    arrays = {"observations": world.observations, "terminated": world.terminated}
    for name, records in ({"blocks": world.blocks} | world.bank._asdict()).items():
        arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names}
    return arrays


def check_tracks(env: TrackVectorEnv) -> None:
    """Check restored arrays; see `hybrid_env.world.World.check_blocks`."""
    env.world.check_blocks(env.world.blocks, env.world.seeded)


def restore_generator(generator: np.random.Generator, state: Any) -> None:
    """Set the state of a generator; `ValueError` or the like if it is invalid."""
    generator.bit_generator.state = state
    # NumPy rounds fractions.
    if generator.bit_generator.state != state:
        raise ValueError("the state of a generator is invalid")


def random_state() -> dict[str, Any]:
    """Return the state of both global generators."""
    _, key, position, has_normal, normal = np.random.get_state()  # noqa: NPY002
    return {
        "torch": torch.get_rng_state().numpy().tobytes().hex(),
        "numpy": [np.asarray(key).tolist(), position, has_normal, normal],
    }


def parse_random_state(state: dict[str, Any]) -> tuple[Tensor, tuple[Any, ...]]:
    """Return what `torch.set_rng_state` and `numpy.random.set_state` take; raise an exception if
    it is invalid.
    """
    key, position, has_normal, normal = state["numpy"]
    # Numpy does not check the position.
    if len(key) != WORDS or not 0 <= position <= WORDS:
        raise ValueError("the state of NumPy's generator is invalid")
    of_numpy = "MT19937", np.array(key, np.uint32), int(position), int(has_normal), float(normal)
    of_torch = torch.frombuffer(bytearray.fromhex(state["torch"]), dtype=torch.uint8)
    torch.Generator().set_state(of_torch)
    np.random.RandomState().set_state(of_numpy)
    return of_torch, of_numpy


class Checkpoint(NamedTuple):
    """State of a run."""

    tensors: dict[str, Tensor]
    # Plain ones, with `steps` and `seconds` so far.
    values: dict[str, Any]
    # Of the file that it was read from.
    path: Path


def has_checkpoint(folder: Path) -> bool:
    """Return whether a folder contains a checkpoint."""
    return any((folder / name).exists() for name in (CHECKPOINT, PREVIOUS))


def write_checkpoint(
    folder: Path,
    tensors: Mapping[str, Tensor],
    values: Mapping[str, Any],
) -> None:
    """Write a checkpoint atomically; the one before becomes the previous one."""
    tensors = {name: tensor.contiguous() for name, tensor in tensors.items()}
    text = json.dumps(values)
    content = safetensors.torch.save(tensors, {"values": text, "sha256": digest(tensors, text)})
    # At the start of a training: a checkpoint is saved before it.
    if len(content) > LARGEST_CHECKPOINT:
        raise reject(
            "checkpoint",
            len(content),
            f"at most {LARGEST_CHECKPOINT:,} bytes: use fewer n_envs",
        )
    with atomic_file(folder / CHECKPOINT) as part:
        part.write_bytes(content)
        with suppress(FileNotFoundError):
            os.replace(folder / CHECKPOINT, folder / PREVIOUS)


def read_checkpoint(folder: Path) -> Checkpoint:
    """Read the last checkpoint, or the one before if the last is missing or damaged."""
    errors = []
    for name in (CHECKPOINT, PREVIOUS):
        try:
            return _read(folder / name)
        except DAMAGE as error:
            errors.append(error)
    raise incomplete_checkpoint(folder, errors[0])


def digest(tensors: Mapping[str, Tensor], text: str) -> str:
    """Return a digest of the content of a checkpoint, with which damage is detected."""
    found = hashlib.sha256(text.encode())
    for name, tensor in sorted(tensors.items()):
        found.update(name.encode())
        found.update(tensor.numpy().tobytes())
    return found.hexdigest()


def _read(path: Path) -> Checkpoint:
    check_tensor_file(path, LARGEST_CHECKPOINT)
    with safe_open(path, framework="pt") as file:
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        metadata = file.metadata()
    if metadata["sha256"] != digest(tensors, metadata["values"]):
        raise ValueError(f"{path.name} is damaged")
    values = json.loads(metadata["values"])
    check_integer("steps", values["steps"], minimum=0)
    check_positive("seconds", values["seconds"], allow_zero=True)
    for name, tensor in tensors.items():
        largest = LARGEST_WEIGHT if name.startswith("network.") else math.inf
        if tensor.is_floating_point() and not (tensor.isfinite() & (tensor.abs() <= largest)).all():
            raise ValueError(f"{name} is not finite or too large")
    return Checkpoint(tensors, values, path)


def incomplete_checkpoint(folder: Path, error: Exception) -> ArgumentError:
    """Return the error for a checkpoint that does not fit its run."""
    return reject(
        "resume",
        str(folder),
        f"a run folder with a complete {CHECKPOINT} ({first_line(error)})",
    )


def optimizer_tensors(optimizer: Optimizer) -> dict[str, Tensor]:
    """Return the state of an optimizer by name; writing into the tensors changes the optimizer."""
    states = optimizer.state_dict()["state"]
    return {
        f"{index}.{name}": tensor
        for index, state in states.items()
        for name, tensor in state.items()
    }


def allocate_optimizer_state(optimizer: Optimizer) -> None:
    """Create the state that an optimizer has after its first step, to be overwritten."""
    for group in optimizer.param_groups:
        for parameter in group["params"]:
            parameter.grad = torch.zeros_like(parameter)
    optimizer.step()
    optimizer.zero_grad()


@torch.no_grad()
def copy_tensors(saved: Mapping[str, Tensor], live: Mapping[str, Tensor]) -> None:
    """Copy the tensors of a checkpoint into those of a run.

    `ValueError` if names, shapes or types differ, or a second moment of the optimizer is negative.
    """
    different = sorted(saved.keys() ^ live.keys())
    if different:
        raise ValueError(f"{different[0]} is {'missing' if different[0] in live else 'unknown'}")
    for name, tensor in live.items():
        found = saved[name]
        kinds = [f"{one.dtype} {tuple(one.shape)}" for one in (found, tensor)]
        if kinds[0] != kinds[1]:
            raise ValueError(f"{name} is {kinds[0]}, not {kinds[1]}")
        if name.endswith(".exp_avg_sq") and bool((found < 0).any()):
            raise ValueError(f"{name} is negative")
    for name, tensor in live.items():
        tensor.copy_(saved[name])


def check_scalars(values: Mapping[str, Any]) -> dict[str, float]:
    """Return a mapping whose values are finite numbers or NaN; `ValueError` or the like if one
    is not.
    """
    for name, value in values.items():
        if math.isinf(value):
            raise ValueError(f"{name} is infinite")
    return dict(values)
