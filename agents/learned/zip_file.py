"""Zip files of PyTorch and of Stable-Baselines3, read without running anything in them.

Everything is bounded before it is built, because a file of a few kilobytes can ask for gigabytes.
"""

import io
import json
import pickletools
import zipfile
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from agents.learned.policy_file import LARGEST_POLICY, check_finite

# Files in a zip file, and tensors.
MOST_PARTS = 20_000


def read_plain(source: Path | bytes, largest: int) -> Any:
    """Return the tensors and plain values that `torch.save` wrote.

    Args:
        source: a file, or its content.
        largest: bytes of the file and of all that it stores.

    Raises:
        Exception: of any kind, if it is damaged, too large, or holds anything else.
    """
    if isinstance(source, Path):
        # A named pipe would wait for its writer.
        if not source.is_file() or source.stat().st_size > largest:
            raise ValueError(f"{source.name} is missing or larger than {largest:,} bytes")
        source = source.read_bytes()
    with _opened(source, largest) as file:
        damaged = file.testzip()
        if damaged is not None:
            raise ValueError(f"{damaged} in it is damaged")
        for name in file.namelist():
            if name.endswith("data.pkl"):
                _check_calls(file.read(name))
    return torch.load(io.BytesIO(source), map_location="cpu", weights_only=True)


def read_model(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return what a zip file of Stable-Baselines3 says about its model, and the weights of the
    policy as float32.

    Raises:
        Exception: of any kind, if the file is damaged, too large, or not of plain, finite tensors.
    """
    with _opened(path.read_bytes(), LARGEST_POLICY) as file:
        # What a model says about itself; as values it needs some thirty times as many bytes.
        if file.getinfo("data").file_size > 10**7:
            raise ValueError("data in it is larger than 10,000,000 bytes")
        data, content = json.loads(file.read("data")), file.read("policy.pth")
    weights = read_plain(content, LARGEST_POLICY)
    # A tensor with strides can repeat few numbers, and tensors can share them.
    if sum(tensor.numel() for tensor in weights.values()) > len(content):
        raise ValueError("the tensors in policy.pth are larger than what it stores")
    return data, {
        name: check_finite(f"{name} in policy.pth", tensor.detach().float().contiguous())
        for name, tensor in weights.items()
    }


def _opened(content: bytes, largest: int) -> zipfile.ZipFile:
    """Return a zip file; `ValueError` if it has too many files, or what it stores is too large."""
    # Its directory is counted before it is read.
    if content.count(b"PK\1\2") > MOST_PARTS:
        raise ValueError(f"it contains more than {MOST_PARTS} files")
    file = zipfile.ZipFile(io.BytesIO(content))
    if sum(info.file_size for info in file.infolist()) > largest:
        raise ValueError(f"it stores more than {largest:,} bytes")
    return file


def _check_calls(content: bytes) -> None:
    """Raise `ValueError` if a pickle calls something that plain tensors do not need, or too often.

    PyTorch refuses all but harmless calls, of which some would fill the memory.
    """
    calls = 0
    for opcode, argument, _ in pickletools.genops(content):
        plain = str(argument).startswith(("collections OrderedDict", "torch"))
        if opcode.name in ("STACK_GLOBAL", "INST") or (opcode.name == "GLOBAL" and not plain):
            raise ValueError(f"it calls {str(argument)[:100]!r}, which plain tensors do not need")
        calls += opcode.name in ("REDUCE", "NEWOBJ", "OBJ")
    if calls > MOST_PARTS:
        raise ValueError(f"it is of more than {MOST_PARTS} tensors")
