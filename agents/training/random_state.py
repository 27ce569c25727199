"""The global random generators of PyTorch and NumPy, which Stable-Baselines3 uses, as plain values."""

from typing import Any

import numpy as np
import torch

WORDS = 624  # of the Mersenne twister


def random_state() -> dict[str, Any]:
    """Return the state of both generators."""
    _, key, position, has_normal, normal = np.random.get_state()  # noqa: NPY002
    return {
        "torch": torch.get_rng_state().numpy().tobytes().hex(),
        "numpy": [np.asarray(key).tolist(), position, has_normal, normal],
    }


def check_random_state(state: dict[str, Any]) -> None:
    """Raise an exception if a state is invalid; the generators stay as they are."""
    torch.Generator().set_state(_torch_state(state))
    np.random.RandomState().set_state(_numpy_state(state))


def set_random_state(state: dict[str, Any]) -> None:
    """Set both generators."""
    torch.set_rng_state(_torch_state(state))
    np.random.set_state(_numpy_state(state))  # noqa: NPY002


def _torch_state(state: dict[str, Any]) -> torch.Tensor:
    return torch.frombuffer(bytearray.fromhex(state["torch"]), dtype=torch.uint8)


def _numpy_state(state: dict[str, Any]) -> tuple[Any, ...]:
    key, position, has_normal, normal = state["numpy"]
    if len(key) != WORDS or not 0 <= position <= WORDS:  # numpy does not check the position
        raise ValueError("the state of NumPy's generator is invalid")
    return "MT19937", np.array(key, np.uint32), int(position), int(has_normal), float(normal)
