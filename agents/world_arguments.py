"""The options of a world as command-line flags, shared by every command that makes one."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(kw_only=True)
class WorldArguments:
    """Flags of the world; what is not given stays as the environment's id has it."""

    env: str = "hybrid_env:HybridTrack-v0"
    """Registered id of the environment."""
    scheme: str | None = None
    """'random', 'random 6x50-100', 'L50r3 R75r5 S50', or golubkov2018, tsyganov2019, golubkov2020."""
    radii: tuple[float, ...] | None = None
    """Turn radii of the bank [m]."""
    speed: float | None = None
    """Speed of the object at the start [m/s]."""
    heading: float | None = None
    """Heading of the object at the start [rad]; drawn if not given."""
    tau: float | None = None
    """Length of a tick [s]."""
    process_variance: float | None = None
    """Q, variance added to each velocity every tick [m^2/s^2]."""
    measurement_variance: float | None = None
    """R, variance of a measured coordinate [m^2]."""
    delay_cost: float | None = None
    """Cost of a tick, in units of the reward of a right decision."""
    correctness: Literal["exact", "type"] | None = None
    """What must be right: the hypothesis, or straight / left / right only."""
    undecided: Literal["likeliest", "keep"] | None = None
    """A segment that ends undecided takes the likeliest hypothesis, or keeps the mode decided last."""
    reset_covariance: bool | None = None
    """Start every segment with P := I, as published."""

    def world_options(self) -> dict[str, Any]:
        """The options that were given, as keywords of `gym.make`."""
        names = [field.name for field in dataclasses.fields(WorldArguments) if field.name != "env"]
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}
