"""What was found on a recording, for a tracker on a live sensor."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from baselines.recordings.imm_pass import FoundOrZero, TrackModel
from baselines.recordings.projection import Projection
from baselines.rules.decider import UNKNOWN, Decider, rules
from hybrid_env.checks import ArgumentError, Checked, Count, Positive, declared_fields, reject
from hybrid_env.json_files import read_json
from hybrid_env.modes import Mode, planar_modes
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar


def _modes(value: Any, name: str) -> tuple[Mode, ...]:
    return () if value in ([], ()) else planar_modes(value, name) or ()


@dataclass(frozen=True, kw_only=True)
class TrackerSettings(TrackModel, Checked):
    """What a tracker needs of a recording with unknown switches, in its units: its model, and other
    fields of track.json.
    """

    gap: Positive
    # Law; None is geometric.
    durations: str | None
    # Of the longest piece.
    ticks: Count
    # Name of the rule, with its threshold.
    decider: str
    known_switches: bool
    projection: Projection | None
    radar: Radar | None
    modes: Annotated[tuple[Mode, ...], _modes]
    # Velocity of the medium.
    wind: tuple[float, float] = (0.0, 0.0)
    # Of measured heights; 0 is that of positions.
    height_variance: FoundOrZero = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.known_switches:
            raise reject("known_switches", True, "a recording whose switches were not known")

    @property
    def environment(self) -> QuickestOptions:
        """The model in the units of an environment."""
        options = self.live.unknown_switches(self.durations, self.ticks, self.radar)
        variance = self.height_variance * self.scales.item(0) ** 2 or options.height_variance
        # As in the default options.
        return replace(options, height_variance=variance, climb_variance=0.01 * variance)

    @property
    def origin(self) -> tuple[float, float, float, float]:
        """[x, vx, y, vy] at time 0 where the options have 0."""
        x, y = (0.0, 0.0) if self.radar is None else self.radar.position
        return x, self.wind[0], y, self.wind[1]

    def rule(self) -> Decider:
        """Return the decider of the recording; `ArgumentError` for one that is no rule."""
        name, _, text = self.decider.partition(":")
        if name not in rules(UNKNOWN):
            allowed = f"one for its options: the recording was tracked by {name}"
            raise reject("decider", None, allowed)
        decider = rules(UNKNOWN)[name].create(self.environment)
        try:
            return decider.at(float(text)) if text else decider
        except ValueError:
            raise reject("decider", self.decider, "a rule with its threshold") from None


def read_settings(recording: Any) -> TrackerSettings:
    """Return the settings of a tracked recording, or of the file `track.json` of one.

    Raises:
        ArgumentError: the file cannot be read, or the switches of the recording were known.
    """
    if hasattr(recording, "settings"):
        return _settings(recording.settings())
    # Bytes of track.json. A thousand modes need less, a hundred with matrices too.
    largest_file = 2**20
    try:
        path = Path(recording)
        return _settings(read_json(path, largest_file))
    except ArgumentError as error:
        raise ArgumentError(f"{path.name}: {error}") from None
    except (OSError, ValueError, TypeError) as error:
        allowed = f"a track.json of hybridtrack track: {error}"
        raise reject("recording", str(recording), allowed) from None


def _settings(values: Any) -> TrackerSettings:
    try:
        known = values.keys() & declared_fields(TrackerSettings)
        return TrackerSettings(**{name: values[name] for name in known})
    except (AttributeError, TypeError) as error:
        raise ArgumentError(f"no track.json of hybridtrack track: {error}") from None
