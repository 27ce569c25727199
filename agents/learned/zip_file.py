"""The zip files of Stable-Baselines3 and sb3-contrib, read without unpickling anything but plain
tensors.

Everything is bounded before it is built, because a file of a few kilobytes can ask for gigabytes.
"""

import io
import json
import pickletools
import re
import zipfile
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from agents.learned.policy_file import LARGEST_FILE, check_finite

# Bytes of the JSON about a model.
LARGEST_DATA = 2**22
# Bytes of the pickle about its tensors.
LARGEST_PICKLE = 2**16
# Files in a zip file.
MOST_RECORDS = 1000
MOST_TENSORS = 128
# Characters.
LONGEST_NAME = 100
# Of the directory of a zip file.
ENTRY = b"PK\1\2"
# Of a zip file that PyTorch does not take for a pickle.
START = b"PK\3\4"
TYPES = torch.float16, torch.bfloat16, torch.float32, torch.float64
STORAGES = "HalfStorage", "BFloat16Storage", "FloatStorage", "DoubleStorage"
GLOBALS = (
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
    *(f"torch {name}" for name in STORAGES),
)
"""What the pickle of plain tensors calls."""


def read_model(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return what a zip file says about its model, and the weights of the policy as float32 on
    the CPU.

    Raises:
        Exception: of any kind with one line, if the file is damaged, too large, or not of plain,
            finite tensors.
    """
    with _opened(path.read_bytes()) as file:
        data = json.loads(_content(file, "data", LARGEST_DATA))
        content = _content(file, "policy.pth", LARGEST_FILE)
    if not isinstance(data, dict):
        raise ValueError("its data are not a mapping")
    return data, _tensors(content)


def _opened(content: bytes) -> zipfile.ZipFile:
    if content.count(ENTRY) > MOST_RECORDS:
        raise ValueError(f"it contains more than {MOST_RECORDS} files")
    return zipfile.ZipFile(io.BytesIO(content))


def _content(file: zipfile.ZipFile, name: str, largest: int) -> bytes:
    if file.getinfo(name).file_size > largest:
        raise ValueError(f"{name} is larger than {largest:,} bytes")
    return file.read(name)


def _tensors(content: bytes) -> dict[str, Tensor]:
    """Return the tensors of "policy.pth", which `torch.save` wrote."""
    if not content.startswith(START):
        raise ValueError("policy.pth is not a zip file of PyTorch")
    with _opened(content) as file:
        records = {info.filename: info.file_size for info in file.infolist()}
        if sum(records.values()) > LARGEST_FILE:
            raise ValueError(f"policy.pth is larger than {LARGEST_FILE:,} bytes")
        for name in records:
            if name.endswith("data.pkl"):
                _check_pickle(_content(file, name, LARGEST_PICKLE))
    weights = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    if not isinstance(weights, dict) or not 0 < len(weights) <= MOST_TENSORS:
        raise ValueError(f"policy.pth is not of 1 to {MOST_TENSORS} tensors")
    for name, tensor in weights.items():
        if not isinstance(name, str) or not re.fullmatch(rf"[\w.]{{1,{LONGEST_NAME}}}", name):
            raise ValueError("policy.pth has names that are no names of weights")
        if not isinstance(tensor, Tensor) or tensor.dtype not in TYPES:
            raise ValueError(f"{name} in policy.pth is not of float numbers")
    # A tensor with strides can repeat few numbers, and tensors can share them.
    if sum(tensor.numel() * tensor.element_size() for tensor in weights.values()) > sum(
        records.values()
    ):
        raise ValueError("the tensors in policy.pth are larger than what it stores")
    return {
        name: check_finite(f"{name} in policy.pth", tensor.detach().float().contiguous())
        for name, tensor in weights.items()
    }


def _check_pickle(content: bytes) -> None:
    """Raise `ValueError` if a pickle calls other functions than those of plain tensors, or too
    many.
    """
    calls = 0
    for opcode, argument, _ in pickletools.genops(content):
        if opcode.name in ("STACK_GLOBAL", "INST") or (
            opcode.name == "GLOBAL" and argument not in GLOBALS
        ):
            raise ValueError(
                f"policy.pth calls {str(argument)[:LONGEST_NAME]!r}, which plain tensors do not"
                " need"
            )
        calls += opcode.name in ("REDUCE", "NEWOBJ", "OBJ")
    if calls > 3 * MOST_TENSORS:
        raise ValueError(f"policy.pth is not of 1 to {MOST_TENSORS} tensors")
