"""What was found on a recording, for a tracker on a live sensor."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.projection import Projection
from hybrid_env.checks import ArgumentError, reject
from hybrid_env.modes import parse_modes
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar


class TrackerSettings(NamedTuple):
    """Arguments of an `OnlineTracker`."""

    # In the units of the recording.
    model: TrackModel
    # The same in those of an environment.
    options: QuickestOptions
    # Name of the decider, with its threshold.
    decider: str
    # [time unit of the recording]
    gap: float
    projection: Projection | None
    # (4,) [x, vx, y, vy] where the options have 0.
    origin: tuple[float, float, float, float]


def read_settings(recording: Any) -> TrackerSettings:
    """Return the settings of a tracked recording, or of the file `track.json` of one.

    Raises:
        ArgumentError: the file cannot be read, or the switches of the recording were known.
    """
    if hasattr(recording, "settings"):
        values = recording.settings()
    else:
        path = Path(os.fspath(recording))
        try:
            values = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise reject(
                "recording", str(path), f"a track.json of hybridtrack track: {error}"
            ) from None
    try:
        return _settings(values)
    except (KeyError, TypeError) as error:
        raise ArgumentError(f"recording: no track.json of hybridtrack track: {error!r}") from None


def _settings(values: Mapping[str, Any]) -> TrackerSettings:
    if values["known_switches"]:
        raise reject("recording", values["object"], "one whose switches were not known")
    radar = None if values["radar"] is None else Radar(**values["radar"])
    x, y = (0.0, 0.0) if radar is None else radar.position
    model = TrackModel(
        tuple(values["radii"]),
        values["measurement_variance"],
        values["process_variance"],
        values["duration"],
        values["speed"],
        values["tick"],
        modes=parse_modes(values.get("modes") or None) or (),
    )
    place = values["projection"]
    return TrackerSettings(
        model,
        model.unknown_switches(values["durations"], values["ticks"], radar),
        values["decider"],
        values["gap"],
        None if place is None else Projection(place["latitude"], place["longitude"]),
        (x, 0.0, y, 0.0),
    )
