"""The state of the tracks of an environment as plain arrays, with which an interrupted training continues."""

from typing import Any

from numpy.typing import NDArray

from hybrid_env.worlds.track_vector_env import TrackVectorEnv


def track_arrays(env: TrackVectorEnv) -> dict[str, NDArray[Any]]:
    """Return all arrays that determine the next steps; writing into them changes the tracks."""
    world = env.world
    arrays = {"observations": world.observations, "terminated": world.terminated}
    for name, records in ({"blocks": world.blocks} | world.bank._asdict()).items():
        arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names}
    return arrays


def check_tracks(env: TrackVectorEnv) -> None:
    """Check restored arrays; see `hybrid_env.tracks.Tracks.check_blocks`."""
    env.world.check_blocks(env.world.blocks, env.world.seeded)
