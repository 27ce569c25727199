"""Registration of the environments with Gymnasium. Their files are imported when one is made."""

from typing import TYPE_CHECKING, Any

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator, register, registry

from hybrid_env.checks import reject

if TYPE_CHECKING:
    from hybrid_env.options import ModelOptions
    from hybrid_env.vector_env import HybridTrackVectorEnv, TrackVectorEnv

BANK_RADII = tuple(float(radius) for radius in range(1, 11))  # [m]
ENVIRONMENTS: dict[str, dict[str, object]] = {
    "HybridTrack-v0": {},
    "HybridTrackBank-v0": {"radii": BANK_RADII, "correctness": "type", "delay_cost": 0.01},
    "HybridTrackEasy-v0": {},
    "HybridTrackQuickest-v0": {},
    "HybridTrackQuickestBank-v0": {"radii": BANK_RADII},
}
"""Registered ids and their options that differ from the defaults."""

_CLASSES = (
    dict.fromkeys(ENVIRONMENTS, ("env:HybridTrackEnv", "vector_env:HybridTrackVectorEnv"))
    | {"HybridTrackEasy-v0": ("easy_env:HybridTrackEasyEnv", "easy_env:HybridTrackEasyVectorEnv")}
    | dict.fromkeys(
        ("HybridTrackQuickest-v0", "HybridTrackQuickestBank-v0"),
        ("quickest_env:HybridTrackQuickestEnv", "vector_env:HybridTrackQuickestVectorEnv"),
    )
)
"""Module and class of the single and of the vector environment of each id."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    for env_id, options in ENVIRONMENTS.items():
        if env_id not in registry:
            single, vector = (f"hybrid_env.{name}" for name in _CLASSES[env_id])
            register(id=env_id, entry_point=single, vector_entry_point=vector, kwargs=options)


def make_track_vector_env(env_id: str, num_envs: int, **options: Any) -> "TrackVectorEnv":
    """Create the vector environment of a registered id; `options` override the options of the id."""
    from hybrid_env.vector_env import TrackVectorEnv

    _check_env_id(env_id, TrackVectorEnv)
    env = gym.make_vec(env_id, num_envs, vectorization_mode="vector_entry_point", **options)
    assert isinstance(env, TrackVectorEnv)
    return env


def make_vector_env(env_id: str, num_envs: int, **options: Any) -> "HybridTrackVectorEnv":
    """Create the vector environment of an id of `HybridTrackEnv`, as `make_track_vector_env`."""
    from hybrid_env.vector_env import HybridTrackVectorEnv

    _check_env_id(env_id, HybridTrackVectorEnv)
    env = make_track_vector_env(env_id, num_envs, **options)
    assert isinstance(env, HybridTrackVectorEnv)
    return env


def environment_options(env_id: str) -> "type[ModelOptions]":
    """Return the class of the options of a registered id: `WorldOptions` or `QuickestOptions`."""
    from hybrid_env.vector_env import TrackVectorEnv

    _check_env_id(env_id, TrackVectorEnv)
    entry_point = gym.spec(env_id.removeprefix("hybrid_env:")).vector_entry_point
    assert isinstance(entry_point, str)
    vector_class: Any = load_env_creator(entry_point)
    found: type[ModelOptions] = vector_class.options_class
    return found


def _check_env_id(env_id: str, kind: type) -> None:
    """Raise `ArgumentError` for an id of another package, or whose vector environment is of another kind."""
    entries = {name: spec.vector_entry_point for name, spec in gym.registry.items()}
    own = {name: entry for name, entry in entries.items() if isinstance(entry, str) and entry.startswith("hybrid_env.")}
    classes: dict[str, Any] = {name: load_env_creator(entry) for name, entry in own.items()}
    known = [name for name, vector_class in classes.items() if issubclass(vector_class, kind)]
    if env_id.removeprefix("hybrid_env:") not in known:
        raise reject("env", env_id, "one of " + ", ".join(known))
