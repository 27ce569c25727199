"""Zimchuk & Kankin 2006: reproduction of table 1, and what its filters are compared with.

An object is measured every 0.1 s with R = 25 m^2. It moves uniformly from 0 to 20 s and from 30 to
50 s, with an acceleration of 20 m/s^2 from 20 to 30 s, and with one that grows by 2 m/s^3 from 50
to 70 s. Here all three axes move like this, and a run is one of them. The paper does not state the
mean M of its estimates, the start, limits of the gains (see `adaptive_positions`), the number of
runs, or the process noise of its Kalman filter; 4.64 m/s^2 is that with which its first manoeuvre
comes out. The pattern of the table is reproduced, its numbers are not: the adaptive filter follows
a manoeuvre about three times better than the Kalman filter.
"""

import numpy as np

from studies.arrays import FloatArray
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


def adaptive_positions(measured: FloatArray, limited: bool = True) -> FloatArray:
    """Positions by the adaptive filter of each axis, as the measurements (T, n, d).

    It has no model of the noises: its gain is identified from the innovations nu and the third
    backward differences D^3 of the predictions x_e, v_e, by eqs. (5) and (17). With nu_i the
    innovation i ticks ago and the mean M over all ticks so far,

        K_1 = M[(3 nu_1 - 3 nu_2 + nu_3 - D^3 x_e) nu] / M[nu nu]
        K_2 = M[((3 nu_1 - 6 nu_2 + 4 nu_3 - nu_4) / T - D^3 v_e) nu] / M[nu nu]

    The first gains are those of a line fit. If `limited`, which the paper does not state, they are
    those of a stable filter, 0 <= K_1 <= 1 and 0 <= K_2 <= K_1^2 / ((2 - K_1) T).
    """
    position, velocity = measured[0], np.zeros(measured[0].shape)
    positions = [position]
    # Innovations of the last ticks, the newest first; NaN before the first one.
    innovations = np.full((5, *position.shape), np.nan)
    predictions = np.full((4, 2, *position.shape), np.nan)
    means = np.zeros((3, *position.shape))
    count = 0
    for n, values in enumerate(measured[1:], start=2):
        position = position + TAU * velocity
        innovation = values - position
        innovations = np.stack([innovation, *innovations[:-1]])
        predictions = np.stack([np.stack([position, velocity]), *predictions[:-1]])
        first, second = 2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1) * TAU)
        of_position = np.tensordot([0.0, 3.0, -3.0, 1.0, 0.0], innovations, 1)
        of_velocity = np.tensordot([0.0, 3.0, -6.0, 4.0, -1.0], innovations, 1) / TAU
        third = np.tensordot([1.0, -3.0, 3.0, -1.0], predictions, 1)
        spread = np.stack([innovation, of_position - third[0], of_velocity - third[1]])
        if not np.isnan(spread).any():
            count += 1
            means += (spread * innovation - means) / count
        if count > 10:
            first, second = means[1:] / means[0]
            if limited:
                first = np.clip(first, 0.0, 1.0)
                second = np.clip(second, 0.0, first**2 / ((2.0 - first) * TAU))
        position, velocity = position + first * innovation, velocity + second * innovation
        positions.append(position)
    return np.stack(positions)


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
        ADAPTIVE: adaptive_positions(measurements),
        SLOW: run_filter(kalman, measurements, TIMES).positions,
        "measurements": measurements,
        "adaptive, without limits": adaptive_positions(measurements, limited=False),
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
