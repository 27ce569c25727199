"""Checkpoints: the whole state of a run in one file of PyTorch, which is replaced as a whole.

It holds network, optimizer, tracks, counters and random generators. It is read with `weights_only`:
nothing in it is run.
"""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from agents.interface.output_files import atomic_file
from agents.learned.policy_file import short_message
from agents.learned.zip_file import read_plain
from hybrid_env.checks import reject

CHECKPOINT = "checkpoint.pt"
# Bytes.
LARGEST_CHECKPOINT = 2**29


def random_state() -> dict[str, Any]:
    """Return the state of both global generators."""
    _, key, *others = np.random.get_state()  # noqa: NPY002
    words = torch.from_numpy(np.asarray(key, np.int64))
    return {"torch": torch.get_rng_state(), "numpy": [words, *others]}


def set_random_state(state: Mapping[str, Any]) -> None:
    """Set both global generators to a state of `random_state`."""
    words, position, *others = state["numpy"]
    key = words.numpy().astype(np.uint32)
    # NumPy does not check it.
    if not 0 <= position <= key.size:
        raise ValueError("the state of NumPy's generator is invalid")
    np.random.set_state(("MT19937", key, position, *others))  # noqa: NPY002
    torch.set_rng_state(state["torch"])


def has_checkpoint(folder: Path) -> bool:
    """Return whether a folder contains a checkpoint."""
    return (folder / CHECKPOINT).exists()


def write_checkpoint(folder: Path, state: Mapping[str, Any]) -> None:
    """Write a state of tensors and plain values in place of the one before.

    Raises:
        ArgumentError: the file cannot be written, or it would be too large to be read.
    """
    content = io.BytesIO()
    torch.save(state, content)
    # At the start of a training: a checkpoint is saved before it.
    if content.tell() > LARGEST_CHECKPOINT:
        allowed = f"at most {LARGEST_CHECKPOINT:,} bytes: use fewer n_envs"
        raise reject("checkpoint", content.tell(), allowed)
    with atomic_file(folder / CHECKPOINT) as part:
        part.write_bytes(content.getbuffer())


def read_checkpoint(folder: Path) -> Any:
    """Return the state in a folder; `ArgumentError` if it cannot be read."""
    try:
        return read_plain(folder / CHECKPOINT, LARGEST_CHECKPOINT)
    except Exception as error:
        raise incomplete_checkpoint(folder, error) from None


def incomplete_checkpoint(folder: Path, error: Exception) -> ValueError:
    """Return the error for a checkpoint that does not fit its run."""
    allowed = f"a run folder with a complete {CHECKPOINT} ({short_message(error)})"
    return reject("resume", str(folder), allowed)


@torch.no_grad()
def copy_tensors(saved: Mapping[str, Tensor], live: Mapping[str, Tensor]) -> None:
    """Copy the tensors of a checkpoint into those of a run; `ValueError` if they differ in name,
    shape or type.
    """
    kinds = [
        {name: (tensor.dtype, tensor.shape) for name, tensor in tensors.items()}
        for tensors in (saved, live)
    ]
    if kinds[0] != kinds[1]:
        raise ValueError("its tracks are not those of the run")
    for name, tensor in live.items():
        tensor.copy_(saved[name])
