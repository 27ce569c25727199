"""Errors of filters on the test flights of the data set, and of their forecasts."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from baselines.estimation.run_filter import Estimates, Filtered
from baselines.papers.novospaskyi.dataset import RadarData
from baselines.papers.novospaskyi.flights import Flight
from baselines.papers.novospaskyi.radars import Noise, Tracks, flight_errors
from baselines.scoring.scores import Scores, mean
from hybrid_env.checks import FloatArray

HORIZONS = (1.0, 2.0, 5.0)  # times ahead [s]
FEWEST = 3  # measurements of a track before its forecasts count
REGION = 0.95  # probability of the stated region of a forecast

# Figures of a flight: RMSE of position [m] and velocity [m/s], RMSE of the forecast positions [m], share of true
# positions within the stated regions; the RMSE are means over the axes, see `flight_errors`.
COLUMNS = (
    "position", "velocity", *(f"ahead {h:g}" for h in HORIZONS), *(f"covered {h:g}" for h in HORIZONS),
)  # fmt: skip
STATISTICS = {name: mean(name) for name in COLUMNS}


def truth_ahead(flights: Sequence[Flight], tracks: Tracks, horizon: float) -> FloatArray:
    """Return the true positions some time after every measurement, (N, K, 3) [m]; NaN where none counts."""
    found = np.full_like(tracks.positions, np.nan)
    for k, (flight, positions) in enumerate(zip(flights, tracks.positions, strict=True)):
        times = tracks.times[k] + horizon
        counts = np.flatnonzero(~np.isnan(positions[:, 0]) & (times <= flight.times[-1]))
        counts = counts[counts >= FEWEST - 1]
        found[k, counts] = flight.states_at(times[counts])[0]
    return found


def score_estimates(name: str, filtered: Filtered, data: RadarData, noise: Noise) -> Scores:
    """Return the figures of the test flights, of estimates (K, N, n) with forecasts at `HORIZONS`."""
    tracks, flights = data.tracks["test"][noise], data.flights_of("test")
    errors = tracks.errors(*(np.swapaxes(one, 0, 1) for one in (filtered.positions, filtered.velocities)))
    ahead = [
        _forecast_figures(one, truth_ahead(flights, tracks, horizon))
        for horizon, one in zip(HORIZONS, filtered.forecasts, strict=True)
    ]
    rmse, covered = zip(*ahead, strict=True)
    figures = np.stack([errors[:, 0], errors[:, 2], *rmse, *covered], axis=1)
    return Scores(name, "", (0.0,), COLUMNS, figures[..., None])


def _forecast_figures(forecast: Estimates, truth: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the RMSE [m] and the share of true positions in the stated region, (N,) each."""
    positions = np.swapaxes(forecast.positions, 0, 1)
    rmse = flight_errors(positions, truth)[0]
    if forecast.covariances is None:
        return rmse, np.full(len(rmse), np.nan)
    spread = np.swapaxes(forecast.covariances[..., :: forecast.order, :: forecast.order], 0, 1)
    counts = ~np.isnan(truth[..., 0])
    error = np.where(counts[..., None], truth - positions, 0.0)
    spread = np.where(counts[..., None, None], spread, np.eye(3))
    squares = (error * np.linalg.solve(spread, error[..., None])[..., 0]).sum(-1)
    inside = counts & (squares <= chi2.ppf(REGION, 3))
    return rmse, inside.sum(1) / counts.sum(1)
