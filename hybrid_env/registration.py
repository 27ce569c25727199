"""Registration of the environments with Gymnasium."""

from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import register, registry

from hybrid_env.checks import reject
from hybrid_env.vector_env import HybridTrackVectorEnv

ENVIRONMENTS: dict[str, dict[str, object]] = {
    "HybridTrack-v0": {},
    "HybridTrackBank-v0": {
        "radii": tuple(float(radius) for radius in range(1, 11)),
        "correctness": "type",
        "delay_cost": 0.01,
    },
}
"""Registered ids and their options that differ from the defaults."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    for env_id, options in ENVIRONMENTS.items():
        if env_id not in registry:
            register(
                id=env_id,
                entry_point="hybrid_env.env:HybridTrackEnv",
                vector_entry_point="hybrid_env.vector_env:HybridTrackVectorEnv",
                kwargs=options,
            )


def make_vector_env(env_id: str, num_envs: int, **options: Any) -> HybridTrackVectorEnv:
    """Create the vector environment of a registered id; `options` override the options of the id.

    Raises:
        ArgumentError: the id is not one of this package, or an option is not allowed.
    """
    check_env_id(env_id)
    env = gym.make_vec(env_id, num_envs, vectorization_mode="vector_entry_point", **options)
    assert isinstance(env, HybridTrackVectorEnv)
    return env


def check_env_id(env_id: str) -> None:
    """Raise `ArgumentError` for an id that does not belong to an environment of this package."""
    known = [
        name
        for name, spec in gym.registry.items()
        if isinstance(spec.vector_entry_point, str) and spec.vector_entry_point.startswith("hybrid_env.")
    ]
    if env_id.removeprefix("hybrid_env:") not in known:
        raise reject("env", env_id, "one of " + ", ".join(known))
