"""The data set of the study: flights, radars and measurements with both noises."""

import json
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hybrid_env import ArgumentError
from studies.arrays import FloatArray
from studies.radar import radars
from studies.radar.flights import FLIGHTS, RECORD_STEP, Flight, point_mass_flights
from studies.radar.radars import NOISE_NAMES, Noise, Tracks, draw_noise, scan_flight

CARD = """# Radar tracks of flights

{flights} simulated flights past two radars, after A. Novospaskyi, "Analysis of the efficiency of
GH and Kalman filters for tracking moving objects under different noise models", master's thesis (in
Ukrainian), National University of Kyiv-Mohyla Academy, 2025. Made by HybridTrack {version} with
seed {seed}; the same version and seed give the same files.

| file | rows | columns |
|---|---|---|
| flights.parquet | states every {step:g} s | flight; time [s]; x, y, z [m]; vx, vy, vz [m/s] |
| radars.parquet | radars | flight; radar; x, y, z [m] |
| measurements.parquet | measurements | flight; split; radar; time [s]; gaussian_x ... levy_z [m] |

- A radar measures the position once every {radars.PERIOD:g} s while the object is within
  {radars.RANGE:g} m; elsewhere the track has a gap.
- Noise on each axis: normal with a deviation of {radars.SIGMA:g} m, or symmetric alpha-stable
  (Lévy) with index {radars.STABILITY:g} and scale {radars.SIGMA:g} m, clipped at {radars.CLIP:g} m,
  in columns of their own.
- Split: `training` are the first {training} flights, `test` the others. Choose nothing on the
  latter.
- Departures from the thesis: a point mass in place of its quadrotor; the radars scan half a period
  apart; clipped noise. What the thesis does not state was inferred from its tables.
- Load: `studies.radar.dataset.load_radar_data(folder)`, or any reader of Parquet.
- Score of filters: `python -m studies.radar scores --out FOLDER`.
- Licence: that of HybridTrack.
"""


@dataclass(frozen=True, eq=False)
class RadarData:
    """The data set."""

    # It was made with.
    seed: int
    # By split ("training", "test").
    flights: dict[str, list[Flight]]
    # By split and noise ("gaussian", "levy").
    tracks: dict[str, dict[Noise, Tracks]]


def write_radar_data(folder: Path, seed: int = 0, flights: int = FLIGHTS) -> None:
    """Write the data set of at least 4 flights into an existing folder."""
    training = round(0.3 * flights)
    tables: dict[str, list[dict[str, Any]]] = {"flights": [], "radars": [], "measurements": []}
    for k, flight in enumerate(point_mass_flights(flights, seed)):
        states = {**_axes("", flight.positions), **_axes("v", flight.velocities)}
        tables["flights"].append({"time": flight.times, **states})
        places, times, numbers = scan_flight(flight, np.random.default_rng((seed, 1, k)))
        tables["radars"].append({"radar": np.arange(2), **_axes("", places)})
        split, stream = ("training", (2, k)) if k < training else ("test", (3, 0, k - training))
        measured: dict[str, Any] = {"split": split, "radar": numbers, "time": times}
        for noise in NOISE_NAMES:
            errors = draw_noise(noise, len(times), np.random.default_rng((seed, *stream)))
            measured |= _axes(f"{noise}_", flight.states_at(times)[0] + errors)
        tables["measurements"].append(measured)
    for name, parts in tables.items():
        numbered = (pd.DataFrame({"flight": k} | part) for k, part in enumerate(parts))
        table = pd.concat(numbered, ignore_index=True)
        table.to_parquet(folder / f"{name}.parquet", index=False, compression="zstd")
    about = {"seed": seed, "flights": flights, "training": training}
    (folder / "dataset.json").write_text(json.dumps(about) + "\n", encoding="utf-8")
    made_by = version("hybrid-track")
    card = CARD.format(**about, version=made_by, step=RECORD_STEP, radars=radars)
    (folder / "README.md").write_text(card, encoding="utf-8")


def load_radar_data(folder: str | Path) -> RadarData:
    """Load the data set that `write_radar_data` has written into a folder.

    Raises:
        ArgumentError: the folder has no such data set, or a file is damaged.
    """
    folder = Path(folder)
    try:
        about = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        states, seen = (
            pd.read_parquet(folder / f"{name}.parquet") for name in ("flights", "measurements")
        )
    except (OSError, ValueError) as error:
        raise ArgumentError(f"{folder} has no radar data set: {error}") from None
    flown = [Flight(_joined(part, ""), _joined(part, "v")) for _, part in states.groupby("flight")]
    parts = [part for _, part in seen.groupby("flight")]
    splits = {"training": slice(about["training"]), "test": slice(about["training"], None)}

    def tracks(split: slice, noise: Noise) -> Tracks:
        longest = max(map(len, parts[split]))
        clocks = []
        arrays = np.full((3, longest, len(parts[split]), 3), np.nan)
        for k, (flight, part) in enumerate(zip(flown[split], parts[split], strict=True)):
            times = part["time"].to_numpy()
            arrays[:, : len(times), k] = _joined(part, f"{noise}_"), *flight.states_at(times)
            clocks.append(np.pad(times, (0, longest - len(times)), mode="edge"))
        return Tracks(np.stack(clocks, axis=1), *arrays)

    return RadarData(
        about["seed"],
        {name: flown[split] for name, split in splits.items()},
        {
            name: {noise: tracks(split, noise) for noise in NOISE_NAMES}
            for name, split in splits.items()
        },
    )


def _axes(prefix: str, values: FloatArray) -> dict[str, Any]:
    """Return the columns of values, (n, 3)."""
    return {f"{prefix}{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _joined(table: pd.DataFrame, prefix: str) -> FloatArray:
    """Return values, (n, 3), of their columns."""
    return table[[f"{prefix}{axis}" for axis in "xyz"]].to_numpy()
