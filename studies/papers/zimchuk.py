"""Zimchuk & Kankin 2006: reproduction of table 1, and what its filters are compared with.

An object is measured every 0.1 s with R = 25 m^2. It moves uniformly from 0 to 20 s and from 30 to
50 s, with an acceleration of 20 m/s^2 from 20 to 30 s, and with one that grows by 2 m/s^3 from 50
to 70 s. Here all three axes move like this, and a run is one of them. The paper does not state the
mean M of its estimates, the start, limits of the gains (see `AdaptiveFilter`), the number of
runs, or the process noise of its Kalman filter; 4.64 m/s^2 is that with which its first manoeuvre
comes out. The pattern of the table is reproduced, its numbers are not: the adaptive filter follows
a manoeuvre about three times better than the Kalman filter.
"""

import numpy as np

from studies.arrays import FloatArray
from studies.filters.gains import AdaptiveFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter
from studies.papers.published import Reproduction, intervals, table_row

# Length of a tick [s], and R [m^2].
TAU, VARIANCE = 0.1, 25.0
TIMES = TAU * np.arange(1, 701, dtype=np.float64)
# First and last tick of each leg; tick k is at (k + 1) T.
LEGS = {"0-20 s": (0, 200), "20-30 s": (200, 300), "30-50 s": (300, 500), "50-70 s": (500, 700)}
ADAPTIVE, SLOW = "adaptive, as published", "Kalman, sigma_w = 4.64"
# Table 1: position RMSE [m] on each leg.
PUBLISHED = {ADAPTIVE: (3.95, 7.60, 4.12, 8.56), SLOW: (3.94, 18.39, 3.64, 23.24)}


def true_position() -> FloatArray:
    """Position on one axis [m], (T,), from 100 m/s on, on which no filter depends."""
    turning = np.clip(TIMES - 20.0, 0.0, 10.0)
    after = np.maximum(TIMES - 30.0, 0.0)
    growing = np.maximum(TIMES - 50.0, 0.0)
    return 100.0 * TIMES + 10.0 * turning**2 + 200.0 * after + growing**3 / 3.0


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Table 1, and other filters on the same measurements.

    `runs` is the number of flights; otherwise arguments as of `golubkov2018.reproduce`.
    """
    truth = true_position()[:, None, None]
    noise = np.random.default_rng(seed).normal(0.0, np.sqrt(VARIANCE), (TIMES.size, runs, 3))
    measurements = truth + noise
    # A deviation of the acceleration in a step, and one of the first velocity.
    model = MotionModel("CV", axes=3, noise=4.64**2, discretization="discrete")
    kalman = KalmanFilter(model, VARIANCE, start_deviations=(1000.0,))
    results = {
        ADAPTIVE: run_filter(AdaptiveFilter(axes=3), measurements, TIMES).positions,
        SLOW: run_filter(kalman, measurements, TIMES).positions,
        "measurements": measurements,
        "adaptive, without limits": run_filter(
            AdaptiveFilter(axes=3, limited=False), measurements, TIMES
        ).positions,
    }
    rows = {}
    for name, positions in results.items():
        squares = (positions - truth) ** 2
        # Errors of each run and leg, (3 n, 4).
        of_legs = [squares[first:last].mean(0).ravel() for first, last in LEGS.values()]
        rows[name] = table_row(
            "Table 1, position RMSE, m"
            if name in PUBLISHED
            else "Position RMSE of other filters, m",
            name,
            LEGS,
            PUBLISHED.get(name, np.nan),
            intervals(np.stack(of_legs, axis=-1), np.sqrt, seed, study_runs=1),
            2,
            "The interval contains 95 % of single runs; the paper does not state its number of"
            " runs.",
            ["", "sigma_w was fitted to it", "", ""] if name == SLOW else "",
        )
    adaptive, slow = rows[ADAPTIVE], rows[SLOW]
    ours, theirs = adaptive.ours / slow.ours, adaptive.published / slow.published
    findings = [
        (
            f"RMSE of the adaptive filter over that of the Kalman filter, {leg}",
            f"{of_leg:.2f}",
            f"{published:.2f}",
        )
        for leg, of_leg, published in zip(LEGS, ours, theirs, strict=True)
    ]
    return Reproduction(
        "Zimchuk & Kankin", runs, seed, [*rows.values()], findings, size="runs not stated"
    )
