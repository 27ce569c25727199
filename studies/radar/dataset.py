"""The data set of the study, flights, radars and measurements with both noises, and the errors
of filters on it.
"""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import chi2

from baselines import Scores, Statistic
from hybrid_env import ArgumentError
from studies.radar import radars
from studies.radar.filters import Estimated
from studies.radar.flights import FLIGHTS, RECORD_STEP, Flight, point_mass_flights
from studies.radar.radars import NOISES, Noise, Tracks, measure, scan_flight

FloatArray = NDArray[np.float64]
FORMAT = 1
TABLES = ("flights", "radars", "measurements")
SPLITS = ("training", "test")
# Times ahead [s].
HORIZONS = (1.0, 2.0, 5.0)
# Measurements of a track before its forecasts count.
FEWEST = 3
# Probability of the stated region of a forecast.
REGION = 0.95

# Figures of a flight: RMSE of position [m] and velocity [m/s], RMSE of the forecast positions [m],
# share of true positions within the stated regions; the RMSE are means over the axes, see
# `flight_errors`.
COLUMNS = (
    "position",
    "velocity",
    *(f"ahead {h:g}" for h in HORIZONS),
    *(f"covered {h:g}" for h in HORIZONS),
)
STATISTICS = {name: Statistic((name,), np.positive) for name in COLUMNS}

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

- A radar measures the position once every {period:g} s while the object is within {range:g} m;
  elsewhere the track has a gap.
- Noise on each axis: normal with a deviation of {sigma:g} m, or symmetric alpha-stable (Lévy) with
  index {stability:g} and scale {sigma:g} m, clipped at {clip:g} m, in columns of their own.
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
    # The training flights first.
    flights: list[Flight]
    # By split ("training", "test") and noise ("gaussian", "levy")
    tracks: dict[str, dict[Noise, Tracks]]

    def flights_of(self, split: str) -> list[Flight]:
        """Return the flights of a split."""
        count = len(self.tracks["training"]["gaussian"].times)
        return self.flights[:count] if split == "training" else self.flights[count:]


def write_radar_data(
    folder: Path,
    seed: int = 0,
    flights: int = FLIGHTS,
) -> None:
    """Write the data set of at least 4 flights into an existing, empty folder."""
    flown = point_mass_flights(flights, seed)
    scans = [
        scan_flight(flight, np.random.default_rng((seed, 1, k))) for k, flight in enumerate(flown)
    ]
    training = round(radars.TRAINING_SHARE * flights)
    numbers = np.arange(flights)
    join = np.concatenate
    states = {
        "flight": np.repeat(numbers, [len(flight.times) for flight in flown]),
        "time": join([flight.times for flight in flown]),
    }
    states |= _axes("", join([flight.positions for flight in flown])) | _axes(
        "v",
        join([flight.velocities for flight in flown]),
    )
    _write(folder, "flights", states)
    places = {
        "flight": np.repeat(numbers, radars.RADARS),
        "radar": np.tile(np.arange(radars.RADARS), flights),
    }
    _write(
        folder,
        "radars",
        places | _axes("", join([scan.radars for scan in scans])),
    )
    flight = np.repeat(numbers, [len(scan.times) for scan in scans])
    seen = {
        "flight": flight,
        "split": np.where(flight < training, *SPLITS),
    }
    seen |= {
        "radar": join([scan.radar for scan in scans]),
        "time": join([scan.times for scan in scans]),
    }
    for noise in NOISES:
        first = measure(scans[:training], noise, (seed, radars.TRAINING_NOISE)).measurements
        later = measure(scans[training:], noise, (seed, radars.TEST_NOISE, 0)).measurements
        seen |= _axes(
            f"{noise}_",
            join([values[~np.isnan(values[..., 0])] for values in (first, later)]),
        )
    _write(folder, "measurements", seen)
    card = CARD.format(
        flights=flights,
        version=version("hybrid-track"),
        seed=seed,
        step=RECORD_STEP,
        training=training,
        period=radars.PERIOD,
        range=radars.RANGE,
        sigma=radars.SIGMA,
        stability=radars.STABILITY,
        clip=radars.CLIP,
    )
    (folder / "README.md").write_text(card, encoding="utf-8")
    digests = {name: _digest(folder / f"{name}.parquet") for name in TABLES}
    about = {
        "format": FORMAT,
        "seed": seed,
        "flights": flights,
        "training": training,
        "sha256": digests,
    }
    (folder / "dataset.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


def load_radar_data(folder: str | Path) -> RadarData:
    """Load the data set that `write_radar_data` has written into a folder.

    Raises:
        ArgumentError: the folder has no such data set, or a file is damaged.
    """
    folder = Path(folder)
    try:
        about = json.loads((folder / "dataset.json").read_text(encoding="utf-8"))
        damaged = [
            name for name in TABLES if _digest(folder / f"{name}.parquet") != about["sha256"][name]
        ]
        known = about["format"] == FORMAT
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ArgumentError(f"{folder} has no radar data set: {error}") from None
    if not known or damaged:
        fault = f"{damaged[0]}.parquet was changed" if damaged else "it has another format"
        raise ArgumentError(f"{folder} cannot be loaded: {fault}; write the data set anew")
    tables = {name: pd.read_parquet(folder / f"{name}.parquet") for name in TABLES}
    by_flight = tables["flights"].groupby("flight")
    flights = [Flight(_joined(part, ""), _joined(part, "v")) for _, part in by_flight]
    parts: dict[str, dict[Noise, list[Any]]] = {
        split: {noise: [] for noise in NOISES} for split in SPLITS
    }
    for number, part in tables["measurements"].groupby("flight"):
        times = part["time"].to_numpy()
        truth = flights[number].states_at(times)
        for noise in NOISES:
            measured = _joined(part, f"{noise}_")
            parts[part["split"].iloc[0]][noise].append((times, measured, *truth))
    tracks = {
        split: {noise: radars.padded_tracks(of_noise) for noise, of_noise in of_split.items()}
        for split, of_split in parts.items()
    }
    return RadarData(about["seed"], flights, tracks)


def _axes(prefix: str, values: FloatArray) -> dict[str, Any]:
    """Return the columns of values, (n, 3)."""
    return {f"{prefix}{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _joined(table: pd.DataFrame, prefix: str) -> FloatArray:
    """Return values, (n, 3), of their columns."""
    return table[[f"{prefix}{axis}" for axis in "xyz"]].to_numpy()


def _write(
    folder: Path,
    name: str,
    columns: dict[str, Any],
) -> None:
    pd.DataFrame(columns).to_parquet(folder / f"{name}.parquet", index=False, compression="zstd")


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def truth_ahead(
    flights: Sequence[Flight],
    tracks: Tracks,
    horizon: float,
) -> FloatArray:
    """Return the true positions some time after every measurement, (N, K, 3) [m]; NaN where none
    counts.
    """
    found = np.full_like(tracks.positions, np.nan)
    for k, (flight, positions) in enumerate(zip(flights, tracks.positions, strict=True)):
        times = tracks.times[k] + horizon
        counts = np.flatnonzero(~np.isnan(positions[:, 0]) & (times <= flight.times[-1]))
        counts = counts[counts >= FEWEST - 1]
        found[k, counts] = flight.states_at(times[counts])[0]
    return found


def score_estimates(
    name: str,
    found: Estimated,
    data: RadarData,
    noise: Noise,
) -> Scores:
    """Return the figures of the test flights, of estimates with forecasts at `HORIZONS`."""
    tracks, flights = data.tracks["test"][noise], data.flights_of("test")
    positions = np.swapaxes(found.positions, 0, 1)
    velocities = np.swapaxes(found.velocities, 0, 1)
    errors = tracks.errors(positions, velocities)
    ahead = [
        _forecast_figures(*forecast, truth_ahead(flights, tracks, horizon))
        for horizon, forecast in zip(HORIZONS, found.forecasts, strict=True)
    ]
    rmse, covered = zip(*ahead, strict=True)
    figures = np.stack([errors[:, 0], errors[:, 2], *rmse, *covered], axis=1)
    return Scores(
        name,
        "",
        (0.0,),
        COLUMNS,
        figures[..., None],
    )


def _forecast_figures(
    positions: FloatArray,
    covariances: FloatArray | None,
    truth: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the RMSE [m] and the share of true positions in the stated region, (N,) each."""
    positions = np.swapaxes(positions, 0, 1)
    rmse = radars.flight_errors(positions, truth)[0]
    if covariances is None:
        return rmse, np.full(len(rmse), np.nan)
    spread = np.swapaxes(covariances, 0, 1)
    counts = ~np.isnan(truth[..., 0])
    error = np.where(
        counts[..., None],
        truth - positions,
        0.0,
    )
    spread = np.where(
        counts[..., None, None],
        spread,
        np.eye(3),
    )
    squares = (error * np.linalg.solve(spread, error[..., None])[..., 0]).sum(-1)
    inside = counts & (squares <= chi2.ppf(REGION, 3))
    return rmse, inside.sum(1) / counts.sum(1)
