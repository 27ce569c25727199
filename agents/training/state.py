"""States of tracks and of random generators as plain values, with which an interrupted training goes on.

Stable-Baselines3 uses the global generators of PyTorch and NumPy.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from hybrid_env.vector_env import TrackVectorEnv

WORDS = 624  # of the Mersenne twister


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
    """Set the state of a generator.

    Raises:
        ValueError: the state is invalid.
    """
    generator.bit_generator.state = state
    if generator.bit_generator.state != state:  # NumPy rounds fractions
        raise ValueError("the state of a generator is invalid")


def random_state() -> dict[str, Any]:
    """Return the state of both global generators."""
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
    """Set both global generators."""
    torch.set_rng_state(_torch_state(state))
    np.random.set_state(_numpy_state(state))  # noqa: NPY002


def _torch_state(state: dict[str, Any]) -> torch.Tensor:
    return torch.frombuffer(bytearray.fromhex(state["torch"]), dtype=torch.uint8)


def _numpy_state(state: dict[str, Any]) -> tuple[Any, ...]:
    key, position, has_normal, normal = state["numpy"]
    if len(key) != WORDS or not 0 <= position <= WORDS:  # numpy does not check the position
        raise ValueError("the state of NumPy's generator is invalid")
    return "MT19937", np.array(key, np.uint32), int(position), int(has_normal), float(normal)
