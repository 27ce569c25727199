"""The state of the tracks of an environment as plain arrays, with which an interrupted training continues."""

from typing import Any

from numpy.typing import NDArray

from hybrid_env.vector_env import HybridTrackVectorEnv


def track_arrays(env: HybridTrackVectorEnv) -> dict[str, NDArray[Any]]:
    """Return all arrays that determine the next steps; writing into them changes the tracks."""
    world = env.world
    arrays = {"observations": world.observations, "terminated": world.terminated}
    for name, records in ({"blocks": world.blocks} | world.bank._asdict()).items():
        arrays |= {f"{name}.{field}": records[field] for field in records.dtype.names}
    return arrays


def check_tracks(env: HybridTrackVectorEnv) -> None:
    """Check the fields that the compiled core uses as indices or as lengths of loops.

    Raises:
        ValueError: a field is out of range, which the core would not notice.
    """
    world, options = env.world, env.options
    blocks = world.blocks
    last = {
        "segment": options.segments - 1, "true_mode": options.hypotheses - 1,
        "active_mode": options.hypotheses - 1, "length": options.longest_segment,
        "tick": blocks["length"], "trace_length": world.trace.shape[1],
    }  # fmt: skip
    for name, largest in last.items():
        if (blocks[name] < 0).any() or (blocks[name] > largest).any():
            raise ValueError(f"{name} of a track is out of range")
    if not world.field("random_state").any(1).all():
        raise ValueError("random_state of a track is zero")
