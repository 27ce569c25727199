"""The options of a world as command-line flags, shared by every command that makes one."""

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

CARD = "policy.json"
DEFAULT_ENV = "hybrid_env:HybridTrack-v0"


@dataclass(kw_only=True)
class WorldArguments:
    """Flags of the world; what is not given stays as the environment's id has it."""

    env: str | None = None
    """Registered id; default hybrid_env:HybridTrack-v0, or the one that a run folder was trained on."""
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
    outliers: float | None = None
    """Share of measurements with five times the deviation, of which the bank does not know."""
    delay_cost: float | None = None
    """Cost of a tick, in units of the reward of a right decision."""
    correctness: Literal["exact", "type"] | None = None
    """What must be right: the hypothesis, or straight / left / right only."""
    undecided: Literal["likeliest", "keep"] | None = None
    """A segment that ends undecided takes the likeliest hypothesis, or keeps the mode decided last."""
    bank: Literal["published", "anchor_aware", "oracle"] | None = None
    """Filters: published, with the anchor's uncertainty in the turns, or (a bound) anchored at the truth."""
    reset_covariance: bool | None = None
    """Start every segment with P := I, as published; not the default of the other banks."""

    @property
    def env_id(self) -> str:
        """The id that was given, or the default."""
        return DEFAULT_ENV if self.env is None else self.env

    def world_options(self) -> dict[str, Any]:
        """The options that were given, as keywords of `gym.make`."""
        names = [field.name for field in dataclasses.fields(WorldArguments) if field.name != "env"]
        return {name: getattr(self, name) for name in names if getattr(self, name) is not None}

    def world_of(self, decider: str) -> tuple[str, dict[str, Any]]:
        """Id and options to see a decider in: those given, over those that a run folder was trained with."""
        card = read_card(decider)
        if card is None or self.env not in (None, card["environment"]):
            return self.env_id, self.world_options()
        trained = {name: value for name, value in card["options"].items() if name != "actions"}
        return card["environment"], trained | self.world_options()


def read_card(decider: str) -> dict[str, Any] | None:
    """The card of a run folder, with an optional threshold behind its name; None for any other decider."""
    names = (decider, decider.rpartition(":")[0])
    for path in (Path(name) / CARD for name in names if name):
        if path.is_file():
            try:
                card = json.loads(path.read_text(encoding="utf-8"))
                return {"environment": str(card["environment"]), "options": dict(card["options"])}
            except (OSError, ValueError, KeyError, TypeError):
                return None  # `load_policy` says what is wrong with it
    return None
