"""Zimchuk & Kankin 2006: reproduction of table 1, and what its filters are compared with.

An object is measured every 0.1 s with R = 25 m^2. It moves uniformly from 0 to 20 s and from 30 to
50 s, with an acceleration of 20 m/s^2 from 20 to 30 s, and with one that grows by 2 m/s^3 from 50
to 70 s. Here all three axes move like this, and a run is one of them. The paper does not state the
mean M of its estimates, the start, limits of the gains (see `AdaptiveFilter`), the number of runs,
or the process noise of its Kalman filter; 4.64 m/s^2 is that with which its first manoeuvre comes
out. The pattern of the table is reproduced, its numbers are not: the adaptive filter follows a
manoeuvre about three times better than a slow Kalman filter. A faster one is better than both.

Also its adaptive filter in matrix form, for n sensors with correlated errors in the plane. The
state is [x, vx, y, vy], and the measurement g = C x + f holds the positions of n sensors. With the
pseudo-inverse C+ of C, which for one sensor is the C' of eq. (17), and F+ in the rows of the
velocities, where nu_i is the innovation i ticks ago:

    P_e C' = M[(-D^3 x_e + C+ (3 nu_1 - 3 nu_2 + nu_3)
                + F+ (3 nu_1 - 6 nu_2 + 4 nu_3 - nu_4) / T) nu']
    K      = P_e C' H_0^-1              eq. (5), with C P_e C' + R = H_0 = M[nu nu']
"""

import numpy as np
import pandas as pd

from baselines import (
    AdaptiveFilter,
    CorrectedAdaptiveFilter,
    KalmanFilter,
    MotionModel,
    TrackFilter,
    run_filter,
)
from studies.papers.published import Finding, FloatArray, Reproduction, both_intervals, table_row

# Length of a tick [s], and R [m^2].
TAU, VARIANCE = 0.1, 25.0
TIMES = TAU * np.arange(1, 701, dtype=np.float64)
# First and last tick of each leg; tick k is at (k + 1) T.
LEGS = {
    "0-20 s": (0, 200),
    "20-30 s": (200, 300),
    "30-50 s": (300, 500),
    "50-70 s": (500, 700),
}
ADAPTIVE, SLOW = "adaptive, as published", "Kalman, sigma_w = 4.64"
# Table 1: position RMSE [m] on each leg.
PUBLISHED = {
    ADAPTIVE: (3.95, 7.60, 4.12, 8.56),
    SLOW: (3.94, 18.39, 3.64, 23.24),
}
RUN_INTERVAL = (
    "The interval contains 95 % of single runs; the paper does not state its number of runs."
)
CORRELATED = np.array([[0.0, 1.0], [1.0, 0.0]])
# Covariances of the errors [m^2] in the plane, where x and y move alike; of two sensors the
# axis-wise filter gets the mean.
ERRORS = {
    "independent errors": VARIANCE * np.eye(2),
    "correlation of x and y 0.9": VARIANCE * (np.eye(2) + 0.9 * CORRELATED),
    "correlation of x and y -0.9": VARIANCE * (np.eye(2) - 0.9 * CORRELATED),
    "two sensors, R = 25 and 100": np.kron(np.diag([VARIANCE, 4.0 * VARIANCE]), np.eye(2)),
}
# Coefficients of the third backward difference, and of the innovations in eq. (17) with N = 3 for
# positions and velocities, newest first.
DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])
LAGS = np.array([[0.0, 3.0, -3.0, 1.0, 0.0], [0.0, 3.0, -6.0, 4.0, -1.0]])


def true_position() -> FloatArray:
    """Position on one axis [m], (T,), from 100 m/s on, on which no filter depends."""
    turning = np.clip(TIMES - 20.0, 0.0, 10.0)
    after = np.maximum(TIMES - 30.0, 0.0)
    growing = np.maximum(TIMES - 50.0, 0.0)
    return 100.0 * TIMES + 10.0 * turning**2 + 200.0 * after + growing**3 / 3.0


def simulate_flights(runs: int, seed: int) -> FloatArray:
    """Simulate measurements [m] of the published scenario, (T, n, 3)."""
    shape = TIMES.size, runs, 3
    noise = np.random.default_rng(seed).normal(
        0.0,
        np.sqrt(VARIANCE),
        shape,
    )
    return true_position()[:, None, None] + noise


def kalman(deviation: float) -> TrackFilter:
    """Return the Kalman filter CV with a deviation of the acceleration in a step [m/s^2], whose
    start has a deviation of 1000 m/s.
    """
    model = MotionModel(
        "CV",
        axes=3,
        noise=deviation**2,
        discretization="discrete",
    )
    return KalmanFilter(model, VARIANCE, start_deviations=(1000.0,))


def positions_of(kind: TrackFilter, measurements: FloatArray) -> FloatArray:
    """Return the positions of a filter, as the measurements (T, n, 3)."""
    return run_filter(
        kind,
        measurements,
        TIMES,
        keep_covariances=False,
    ).positions


def matrix_gain(covariances: FloatArray, spread: FloatArray) -> FloatArray:
    """Gains of positions [-] and velocities [1/s], (2, ..., d, m), of the values of m = n d
    measured axes. From H_0 (..., m, m) [m^2], invertible, and the rows of P_e C', (2, ..., d, m).
    The limits are those of `AdaptiveFilter`, in the directions in which the gain of a common
    position is diagonal: with L L' = C' H_0^-1 C the eigenvectors of L' P L, P the symmetric part
    of the covariance of the predicted position.
    """
    inverse = np.linalg.inv(covariances)
    d, m = spread.shape[-2:]
    # C without the columns of the velocities.
    sensors = np.tile(np.eye(d), (m // d, 1))
    # C' H_0^-1.
    of_position = sensors.T @ inverse
    factor = np.linalg.cholesky(of_position @ sensors)
    position, velocity = factor.mT @ (spread @ sensors / (m // d)) @ factor
    gains, directions = np.linalg.eigh(0.5 * (position + position.mT))
    gains = np.clip(gains, 0.0, 1.0)
    rates = np.einsum(
        "...ik,...ij,...jk->...k",
        directions,
        velocity,
        directions,
    )
    rates = np.clip(rates, 0.0, gains**2 / ((2.0 - gains) * TAU))
    limited = (directions * np.stack([gains, rates])[..., None, :]) @ directions.mT
    unfactor = np.linalg.inv(factor)
    return np.asarray(unfactor.mT @ limited @ unfactor @ of_position)


def matrix_positions(measured: FloatArray, dimensions: int = 2, products: int = 10) -> FloatArray:
    """Positions (T, n, d) by the adaptive filter in matrix form, of measurements (T, n, m) of one
    sensor after another. The gains are those of a line fit before it adapts, after some products of
    each measured value.
    """
    d, m = dimensions, measured.shape[-1]
    runs = len(measured[0])
    sensors = np.tile(np.eye(d), (m // d, 1))
    mean = sensors.T / (m // d)
    # Positions and velocities.
    state = np.stack([measured[0] @ mean.T, np.zeros((runs, d))])
    predictions = np.full((len(DIFFERENCE), *state.shape), np.nan)
    innovations = np.full((LAGS.shape[1], runs, m), np.nan)
    # H_0, then P_e C' of positions and velocities.
    means = np.zeros((runs, m + 2 * d, m))
    count = 0
    positions = [state[0]]
    for n, values in enumerate(measured[1:], start=2):
        state = np.stack([state[0] + TAU * state[1], state[1]])
        innovation = values - state[0] @ sensors.T
        line = 2.0 * (2 * n - 1) / (n * (n + 1)), 6.0 / (n * (n + 1) * TAU)
        gains = np.array(line)[:, None, None, None] * mean
        predictions = np.concatenate([state[None], predictions[:-1]])
        innovations = np.concatenate([innovation[None], innovations[:-1]])
        lagged = np.tensordot(LAGS, innovations @ mean.T, axes=1)
        lagged[1] /= TAU
        spread = lagged - np.tensordot(DIFFERENCE, predictions, axes=1)
        left = np.concatenate([innovation, *spread], axis=-1)
        if not np.isnan(left).any():
            count += 1
            means += (left[..., None] * innovation[:, None] - means) / count
        if count > products * m:
            rows = np.stack([means[:, m : m + d], means[:, m + d :]])
            gains = matrix_gain(means[:, :m], rows)
        state = state + (gains @ innovation[..., None])[..., 0]
        positions.append(state[0])
    return np.stack(positions)


def matrix_ratios(runs: int, seed: int) -> list[pd.DataFrame]:
    """Error of the adaptive filter in matrix form over that of each axis by itself, on the same
    flights.
    """
    rows = []
    draw = np.random.default_rng(seed).multivariate_normal

    def ratio(means: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(means[..., : len(LEGS)] / means[..., len(LEGS) :]))

    for name, covariance in ERRORS.items():
        m = len(covariance)
        errors = draw(np.zeros(m), covariance, (TIMES.size, runs))
        measured = true_position()[:, None, None] + errors
        mean = measured.reshape(-1, runs, m // 2, 2).mean(2)
        squares = [
            mean_squares(positions).reshape(runs, 2, -1)
            for positions in (
                matrix_positions(measured),
                positions_of(AdaptiveFilter(2, TAU), mean),
            )
        ]
        results = both_intervals(
            np.concatenate(squares, -1).mean(1),
            ratio,
            seed,
            study_runs=1,
        )
        table = "Matrix form over axis by axis, ratio of position RMSE in the plane"
        rows.append(
            table_row(
                table,
                name,
                LEGS,
                np.nan,
                results,
                2,
                RUN_INTERVAL,
            )
        )
    return rows


def mean_squares(positions: FloatArray) -> FloatArray:
    """Mean squared error of each run and leg, (3 n, 4) [m^2]."""
    squares = (positions - true_position()[:, None, None]) ** 2
    legs = [squares[first:last].mean(0).ravel() for first, last in LEGS.values()]
    return np.stack(legs, axis=-1)


def rmse(positions: FloatArray) -> FloatArray:
    """RMSE of each leg over all runs, (4,) [m]."""
    return np.asarray(np.sqrt(mean_squares(positions).mean(0)))


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Table 1, other filters on the same measurements, and what the paper does not state.

    `runs` is the number of flights; otherwise arguments as of `golubkov2018.reproduce`.
    """
    measurements = simulate_flights(runs, seed)
    filters: dict[str, TrackFilter | None] = {
        ADAPTIVE: AdaptiveFilter(3, TAU),
        SLOW: kalman(4.64),
        "measurements": None,
        "adaptive, without limits": AdaptiveFilter(3, TAU, limited=False),
        "adaptive, corrected": CorrectedAdaptiveFilter(3, TAU),
        "Kalman, sigma_w = 60": kalman(60.0),
    }
    rows = []
    errors = {}
    for name, kind in filters.items():
        positions = measurements if kind is None else positions_of(kind, measurements)
        errors[name] = rmse(positions)
        published = PUBLISHED.get(name)
        table = "Table 1, position RMSE, m" if published else "Position RMSE of other filters, m"
        results = both_intervals(
            mean_squares(positions),
            np.sqrt,
            seed,
            study_runs=1,
        )
        fitted = ["", "sigma_w was fitted to it", "", ""] if name == SLOW else ""
        values = published or np.nan
        rows.append(
            table_row(
                table,
                name,
                LEGS,
                values,
                results,
                2,
                RUN_INTERVAL,
                fitted,
            )
        )
    theirs = np.divide(PUBLISHED[ADAPTIVE], PUBLISHED[SLOW])
    ratios = zip(
        LEGS,
        errors[ADAPTIVE] / errors[SLOW],
        theirs,
        strict=True,
    )
    findings: list[Finding] = [
        (
            f"RMSE of the adaptive filter over that of the Kalman filter, {leg}",
            f"{ours:.2f}",
            f"{published_ratio:.2f}",
        )
        for leg, ours, published_ratio in ratios
    ]
    return Reproduction(
        "Zimchuk & Kankin",
        runs,
        seed,
        rows + matrix_ratios(min(runs, 300), seed),
        [*findings, _needed_noise(seed)],
        size="runs not stated",
    )


def _needed_noise(seed: int) -> Finding:
    """The process noise with which a Kalman filter has the published errors, of 50 flights."""
    deviations = (2.0, 4.64, 10.0, 20.0, 60.0, 200.0, 600.0, 2000.0)
    flights = simulate_flights(50, seed + 1)
    scan = np.stack([rmse(positions_of(kalman(deviation), flights)) for deviation in deviations])
    needed = []
    for leg, value, errors in zip(
        LEGS,
        PUBLISHED[SLOW],
        scan.T,
        strict=True,
    ):
        levels = []
        for k in np.flatnonzero((errors[:-1] - value) * (errors[1:] - value) <= 0.0):
            pair = slice(k, k + 2)
            points = sorted(
                zip(
                    errors[pair] - value,
                    np.log(deviations[pair]),
                    strict=True,
                )
            )
            levels.append(np.exp(np.interp(0.0, *np.transpose(points))))
        needed.append(f"{leg}: {' or '.join(f'{level:.3g}' for level in levels) or 'none'}")
    return (
        "sigma_w with which the Kalman filter has the published RMSE, m/s^2",
        "; ".join(needed),
        "one Kalman filter, its process noise not stated",
    )
