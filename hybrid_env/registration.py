"""Registration of the environments with Gymnasium. Their files are imported when one is made."""

from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
from gymnasium.envs.registration import load_env_creator, register, registry

from hybrid_env.checks import unknown

if TYPE_CHECKING:
    from hybrid_env.model_options import ModelOptions
    from hybrid_env.vector_env import HybridTrackVectorEnv, TrackVectorEnv

# [m]
BANK_RADII = tuple(float(radius) for radius in range(1, 11))
# With 21 hypotheses the type is rewarded.
TYPES = {"radii": BANK_RADII, "correctness": "type", "delay_cost": 0.01}
# Evidence grows as the fourth power of time: at first one more tick of waiting does not pay.
AWARE = {"bank": "anchor_aware", "decide_every": 8}
ENVIRONMENTS: dict[str, dict[str, object]] = {
    "HybridTrack-v0": AWARE,
    "HybridTrackRaw-v0": {**AWARE, "observation": "raw"},
    "HybridTrackBank-v0": {**AWARE, **TYPES, "actions": "types", "follow": "bank"},
    # The object has other radii and process noise, heavy tails and an unknown velocity. The bank is
    # the smallest one among the best for the MSPRT of types, see `studies/road`.
    "HybridTrackRoad-v0": {
        **AWARE,
        "radii": (2.5, 5.0, 10.0),
        "process_variance": 0.01,
        "likelihood": "student_t 50",
        "scheme": "random 6x50-100 radii 2.5 3.2 4 5 6.3 8 10",
        "object_variance": (1e-4, 3e-2),
        "noise": "student_t 2",
        "initial_error": (0.3, 4.0),
        "correctness": "type",
    },
    "HybridTrackPublished-v0": {},
    "HybridTrackPublishedBank-v0": TYPES,
    "HybridTrackQuickest-v0": {},
    "HybridTrackQuickestBank-v0": {"radii": BANK_RADII},
    # Bank and likelihood are those that earn most for the rule `steady`, see `studies/road`.
    "HybridTrackQuickestRoad-v0": {
        "process_variance": 0.01,
        "likelihood": "student_t 8",
        "object_variance": (1e-4, 3e-2),
        "noise": "student_t 2",
    },
}
"""Registered ids and their options that differ from the defaults."""


def register_environments() -> None:
    """Register every id that is not registered yet."""
    # Mean returns of an episode of the best known rule.
    thresholds = {
        "HybridTrack-v0": 3.56,
        "HybridTrackRaw-v0": 3.56,
        "HybridTrackBank-v0": 4.85,
        "HybridTrackRoad-v0": 2.3,
        "HybridTrackPublished-v0": 3.83,
        "HybridTrackPublishedBank-v0": 4.80,
        "HybridTrackQuickest-v0": 485.0,
        "HybridTrackQuickestBank-v0": 285.0,
        "HybridTrackQuickestRoad-v0": 431.0,
    }
    for env_id, options in ENVIRONMENTS.items():
        if env_id not in registry:
            kind = "Quickest" if "Quickest" in env_id else ""
            module = "quickest_env" if kind else "env"
            register(
                id=env_id,
                entry_point=f"hybrid_env.{module}:HybridTrack{kind}Env",
                vector_entry_point=f"hybrid_env.vector_env:HybridTrack{kind}VectorEnv",
                kwargs=options,
                # Some libraries need a limit.
                max_episode_steps=10_000,
                reward_threshold=thresholds[env_id],
            )


def make_track_vector_env(env_id: str, num_envs: int, **options: Any) -> "TrackVectorEnv":
    """Create the vector environment of a registered id, for episodes of any length; `options`
    override its options.
    """
    vector_class(env_id)
    given = {"vectorization_mode": "vector_entry_point", "max_episode_steps": -1, **options}
    return cast("TrackVectorEnv", gym.make_vec(env_id, num_envs, **given))


def make_vector_env(env_id: str, num_envs: int, **options: Any) -> "HybridTrackVectorEnv":
    """Create the vector environment of an id of `HybridTrackEnv`, as `make_track_vector_env`."""
    vector_class(env_id, "HybridTrackVectorEnv")
    return cast("HybridTrackVectorEnv", make_track_vector_env(env_id, num_envs, **options))


def environment_options(env_id: str) -> "type[ModelOptions]":
    """Return the class of the options of a registered id: `WorldOptions` or `QuickestOptions`."""
    return vector_class(env_id).options_class


def vector_class(env_id: str, kind: str = "TrackVectorEnv") -> Any:
    """Return the class of the vector environment of an id, which must be of this package and of
    a kind.
    """
    from hybrid_env import vector_env

    spec = registry.get(env_id.removeprefix("hybrid_env:"))
    entry = str(spec and spec.vector_entry_point)
    environment: Any = load_env_creator(entry) if entry.startswith("hybrid_env.") else None
    if environment is None or not issubclass(environment, getattr(vector_env, kind)):
        raise unknown("env", env_id.removeprefix("hybrid_env:"), ENVIRONMENTS)
    return environment
