"""Zimchuk & Kankin 2006: settings and reproduction of table 1, and what its filters are compared
with.

An object is measured every 0.1 s with R = 25 m^2. It moves uniformly from 0 to 20 s and from 30 to
50 s, with an acceleration of 20 m/s^2 from 20 to 30 s, and with one that grows by 2 m/s^3 from 50
to 70 s. Here all three axes move like this, and a run is one of them. The paper does not state the
mean M of its estimates, the start, limits of the gains (see `adaptive`), the number of runs, or the
process noise of its Kalman filter; 4.64 m/s^2 is that with which its first manoeuvre comes out. The
pattern of the table is reproduced, its numbers are not: the adaptive filter follows a manoeuvre
about three times better than a slow Kalman filter. A faster one is better than both.

Also its adaptive filter in matrix form, for n sensors with correlated errors in the plane. The
state is [x, vx, y, vy], and the measurement g = C x + f holds the positions of n sensors. With the
pseudo-inverse C+ of C, which for one sensor is the C' of eq. (17), and F+ in the rows of the
velocities, where nu_i is the innovation i ticks ago:

    P_e C' = M[(-D^3 x_e + C+ (3 nu_1 - 3 nu_2 + nu_3)
                + F+ (3 nu_1 - 6 nu_2 + 4 nu_3 - nu_4) / T) nu']
    K      = P_e C' H_0^-1              eq. (5), with C P_e C' + R = H_0 = M[nu nu']
"""

from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from baselines import (
    AdaptiveFilter,
    CorrectedAdaptiveFilter,
    KalmanFilter,
    MotionModel,
    run_filter,
)
from studies.papers.figures import new_figure
from studies.papers.reproduction import Cell, Finding, Reproduction, both_intervals, table_row

FloatArray = NDArray[np.float64]
PAPER = "Zimchuk & Kankin"
# Length of a tick [s].
TAU = 0.1
# R [m^2].
VARIANCE = 25.0
AXES = 3
# At the start, on each axis [m/s]; no filter depends on it.
SPEED = 100.0
# [m/s^2] from 20 to 30 s, [m/s^3] from 50 to 70 s.
ACCELERATION, JERK = 20.0, 2.0
# First and last tick of each leg; tick k is at (k + 1) T.
LEGS = {
    "0-20 s": (0, 200),
    "20-30 s": (200, 300),
    "30-50 s": (300, 500),
    "50-70 s": (500, 700),
}
# Standard deviation of the velocity at the start of the Kalman filters [m/s].
START_SPEED = 1000.0
# Standard deviations of the acceleration in the Kalman filters, sigma_w [m/s^2].
SLOW, MEDIUM, FAST = 4.64, 20.0, 60.0
PUBLISHED_ADAPTIVE = (3.95, 7.60, 4.12, 8.56)
PUBLISHED_KALMAN = (3.94, 18.39, 3.64, 23.24)
NOT_PUBLISHED = (np.nan,) * len(LEGS)
TABLE = "Table 1, position RMSE, m"
SOUND = "Position RMSE of other filters, m"
RUN_INTERVAL = (
    "The interval contains 95 % of single runs; the paper does not state its number of runs."
)
# sigma_w of the Kalman filter [m/s^2].
SCANNED = (2.0, SLOW, 10.0, MEDIUM, FAST, 200.0, 600.0, 2000.0)
SCANNED_RUNS = 50
FITTED = {"20-30 s": "sigma_w was fitted to it"}
MATRIX = "Matrix form over axis by axis, ratio of position RMSE in the plane"
MATRIX_RUNS = 300
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
# Before the filter adapts, for each measured value.
PRODUCTS = 10
COLOURS = {
    "adaptive, as published": "#AA3377",
    "adaptive, corrected": "#CCBB44",
    "Kalman, sigma_w = 4.64": "#000000",
    "Kalman, sigma_w = 20": "#4477AA",
    "Kalman, sigma_w = 60": "#228833",
    "measurements": "#9a9a9a",
}


class Flights(NamedTuple):
    """n simulated flights at T times."""

    # (T,) [s]
    times: FloatArray
    # (T,) position on each axis [m]
    truth: FloatArray
    # (T, n, 3) [m]
    measurements: FloatArray


def true_position(times: FloatArray) -> FloatArray:
    """Position on one axis [m] at times [s]."""
    turning = np.clip(times - 20.0, 0.0, 10.0)
    after = np.maximum(times - 30.0, 0.0)
    growing = np.maximum(times - 50.0, 0.0)
    manoeuvre = 0.5 * ACCELERATION * turning**2 + 10.0 * ACCELERATION * after
    return SPEED * times + manoeuvre + JERK * growing**3 / 6.0


def simulate_flights(runs: int, seed: int) -> Flights:
    """Simulate flights of the published scenario."""
    times = TAU * np.arange(1, 701, dtype=np.float64)
    truth = true_position(times)
    noise = np.random.default_rng(seed).normal(
        0.0,
        np.sqrt(VARIANCE),
        (times.size, runs, AXES),
    )
    return Flights(
        times,
        truth,
        truth[:, None, None] + noise,
    )


def kalman_positions(flights: Flights, deviation: float) -> FloatArray:
    """Positions (T, n, 3) by the Kalman filter CV; deviation: of the acceleration in a step
    [m/s^2].
    """
    shape = flights.measurements.shape
    # The axes are independent.
    single = flights.measurements.reshape(
        shape[0],
        -1,
        1,
    )
    return _filtered(single, flights.times, deviation)[0].reshape(shape)


def _filtered(
    measured: FloatArray,
    times: FloatArray,
    deviation: float,
) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities by the Kalman filter."""
    model = MotionModel(
        "CV",
        axes=1,
        noise=deviation**2,
        discretization="discrete",
    )
    kalman = KalmanFilter(model, VARIANCE, start_deviations=(START_SPEED,))
    found = run_filter(kalman, measured, times, keep_covariances=False)
    return found.positions, found.velocities


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
    position, velocity = np.swapaxes(factor, -1, -2) @ (spread @ sensors / (m // d)) @ factor
    gains, directions = np.linalg.eigh(0.5 * (position + np.swapaxes(position, -1, -2)))
    gains = np.clip(gains, 0.0, 1.0)
    rates = np.einsum("...ik,...ij,...jk->...k", directions, velocity, directions)
    rates = np.clip(
        rates,
        0.0,
        gains**2 / ((2.0 - gains) * TAU),
    )
    scaled = directions * np.stack([gains, rates])[..., None, :]
    limited = scaled @ np.swapaxes(directions, -1, -2)
    unfactor = np.linalg.inv(factor)
    return np.asarray(np.swapaxes(unfactor, -1, -2) @ limited @ unfactor @ of_position)


def matrix_positions(measured: FloatArray, dimensions: int = 2) -> FloatArray:
    """Positions (T, n, d) by the adaptive filter in matrix form, of measurements (T, n, m) of one
    sensor after another. The gains are those of a line fit before it adapts.
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
        lagged = np.tensordot(
            LAGS,
            innovations @ mean.T,
            axes=1,
        )
        lagged[1] /= TAU
        spread = lagged - np.tensordot(DIFFERENCE, predictions, axes=1)
        left = np.concatenate([innovation, *spread], axis=-1)
        if not np.isnan(left).any():
            count += 1
            means += (left[..., None] * innovation[:, None] - means) / count
        if count > PRODUCTS * m:
            rows = np.stack([means[:, m : m + d], means[:, m + d :]])
            gains = matrix_gain(means[:, :m], rows)
        state = state + (gains @ innovation[..., None])[..., 0]
        positions.append(state[0])
    return np.stack(positions)


def noise_bias(gain: float) -> float:
    """Ratio of the R of eq. (19) to the true one, in uniform motion with constant gains g and h =
    g^2 / (2 - g). The prediction is sum_i c_i z_(n-i), and D^3 of the motion is 0, so that M[D^3 z
    nu'] = R (1 + 3 c_1 - 3 c_2 + c_3).
    """
    # After a measurement of 1, in units of a tick.
    g, h = position, velocity = gain, gain**2 / (2.0 - gain)
    response = []
    for _ in range(3):
        response.append(position + velocity)
        position, velocity = response[-1] - g * response[-1], velocity - h * response[-1]
    return float(1.0 - DIFFERENCE[1:] @ response)


def matrix_ratios(runs: int, seed: int) -> list[Cell]:
    """Error of the adaptive filter in matrix form over that of each axis by itself, on the same
    flights.
    """
    flights = simulate_flights(1, seed)
    cells = []
    draw = np.random.default_rng(seed).multivariate_normal

    def ratio(means: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(means[..., : len(LEGS)] / means[..., len(LEGS) :]))

    for name, covariance in ERRORS.items():
        n = len(covariance) // 2
        m = len(covariance)
        measured = flights.truth[:, None, None] + draw(
            np.zeros(m),
            covariance,
            (len(flights.times), runs),
        )
        mean = measured.reshape(-1, runs, n, 2).mean(2)
        plain = run_filter(AdaptiveFilter(2, TAU), mean, flights.times).positions
        squares = [
            mean_squares(flights, positions).reshape(runs, 2, -1)
            for positions in (matrix_positions(measured), plain)
        ]
        values = both_intervals(
            np.concatenate(squares, -1).mean(1),
            ratio,
            seed,
            study_runs=1,
        )
        cells += table_row(MATRIX, name, LEGS, NOT_PUBLISHED, values, 2, RUN_INTERVAL)
    return cells


def mean_squares(flights: Flights, positions: FloatArray) -> FloatArray:
    """Mean squared error of each run and leg, (3 n, 4) [m^2]."""
    squares = (positions - flights.truth[:, None, None]) ** 2
    legs = [squares[first:last].mean(0).ravel() for first, last in LEGS.values()]
    return np.stack(legs, axis=-1)


def rmse(flights: Flights, positions: FloatArray) -> FloatArray:
    """RMSE of each leg over all runs, (4,) [m]."""
    return np.asarray(np.sqrt(mean_squares(flights, positions).mean(0)))


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Table 1, other filters on the same measurements, and the doubtful points of the paper.

    `runs` is the number of flights; otherwise arguments as of `golubkov2018.reproduce`.
    """
    flights = simulate_flights(runs, seed)
    adaptive = "adaptive, as published"
    slow = f"Kalman, sigma_w = {SLOW:g}"
    versions = (
        AdaptiveFilter(AXES, TAU),
        AdaptiveFilter(AXES, TAU, limited=False),
        CorrectedAdaptiveFilter(AXES, TAU),
    )
    plain, free, corrected = (
        run_filter(version, flights.measurements, flights.times).positions for version in versions
    )
    rows = {
        adaptive: plain,
        slow: kalman_positions(flights, SLOW),
        "measurements": flights.measurements,
        "adaptive, without limits": free,
        "adaptive, corrected": corrected,
        f"Kalman, sigma_w = {MEDIUM:g}": kalman_positions(flights, MEDIUM),
        f"Kalman, sigma_w = {FAST:g}": kalman_positions(flights, FAST),
    }
    published = {adaptive: PUBLISHED_ADAPTIVE, slow: PUBLISHED_KALMAN}
    cells: list[Cell] = []
    for name, positions in rows.items():
        table, given = (TABLE, published[name]) if name in published else (SOUND, NOT_PUBLISHED)
        values = both_intervals(
            mean_squares(flights, positions),
            np.sqrt,
            seed,
            study_runs=1,
        )
        cells += table_row(
            table,
            name,
            LEGS,
            given,
            values,
            2,
            RUN_INTERVAL,
            FITTED if name == slow else None,
        )
    cells += matrix_ratios(min(runs, MATRIX_RUNS), seed)
    ratios = rmse(flights, rows[adaptive]) / rmse(flights, rows[slow])
    theirs = np.divide(PUBLISHED_ADAPTIVE, PUBLISHED_KALMAN)
    findings = [
        Finding(
            f"RMSE of the adaptive filter over that of the Kalman filter, {leg}",
            f"{ours:.2f}",
            f"{published_ratio:.2f}",
        )
        for leg, ours, published_ratio in zip(LEGS, ratios, theirs, strict=True)
    ] + _doubtful_points(flights, seed)
    examples = {"flights": flights, **rows}
    return Reproduction(
        PAPER,
        runs,
        seed,
        tuple(cells),
        tuple(findings),
        examples,
        size="runs not stated",
    )


def _doubtful_points(flights: Flights, seed: int) -> list[Finding]:
    """Statements of the paper that do not hold, and what is not stated."""
    bias = ", ".join(f"{noise_bias(gain):.2f} at K_1 = {gain:g}" for gain in (0.1, 0.2, 0.5))
    few = simulate_flights(SCANNED_RUNS, seed + 1)
    scan = np.stack([rmse(few, kalman_positions(few, deviation)) for deviation in SCANNED])
    needed = []
    for leg, value, errors in zip(LEGS, PUBLISHED_KALMAN, scan.T, strict=True):
        crossings = np.flatnonzero((errors[:-1] - value) * (errors[1:] - value) <= 0.0)
        levels = []
        for k in crossings:
            pair = slice(k, k + 2)
            points = sorted(zip(errors[pair] - value, np.log(SCANNED[pair]), strict=True))
            levels.append(np.exp(np.interp(0.0, *np.transpose(points))))
        needed.append(f"{leg}: {' or '.join(f'{level:.3g}' for level in levels) or 'none'}")
    error, innovation = _lag_products(flights)
    scanned = "sigma_w with which the Kalman filter has the published RMSE, m/s^2"
    means = "M[e_n e_(n-1)] of prediction errors and M[nu_n nu_(n-1)] of innovations [m^2]"
    lagged = f"Kalman, sigma_w = {MEDIUM:g}, 30-50 s: {means}"
    gains = "line fit for the first 10 products, 0 <= K_1 <= 1, 0 <= K_2 <= K_1^2 / ((2 - K_1) T)"
    difference = f"{_equation_difference(flights):.1e}", "two methods; they are the same one"
    return [
        Finding(scanned, "; ".join(needed), "one Kalman filter, its process noise not stated"),
        Finding("R of eq. (19) over the true one, in uniform motion", bias, "1: eq. (19) gives R"),
        Finding("eq. (18) minus eq. (19), largest difference in a run [m^2]", *difference),
        Finding(lagged, f"{error:.2f} and {innovation:.2f}", "equal, before eq. (17)"),
        Finding(
            "settings that the paper does not state",
            f"mean over all ticks, axes by themselves, {gains}",
        ),
    ]


def _lag_products(flights: Flights) -> tuple[float, float]:
    """Mean products of successive prediction errors and of successive innovations [m^2], 35 to
    50 s.
    """
    measured = flights.measurements[:, :, :1]
    positions, velocities = _filtered(measured, flights.times, MEDIUM)
    predicted = positions[:-1] + TAU * velocities[:-1]
    steady = slice(349, 499)
    error = (predicted - flights.truth[1:, None, None])[steady]
    innovation = (measured[1:] - predicted)[steady]
    of_errors = error[1:] * error[:-1]
    of_innovations = innovation[1:] * innovation[:-1]
    return float(of_errors.mean()), float(of_innovations.mean())


def _equation_difference(flights: Flights) -> float:
    """Largest difference of the products in eq. (18) and (19) on one run, for any predictions
    [m^2].
    """
    z = flights.measurements[:, 0, 0]
    filtered = kalman_positions(
        Flights(flights.times, flights.truth, flights.measurements[:, :1]),
        SLOW,
    )
    predicted = np.concatenate([z[:1], filtered[:-1, 0, 0]])
    innovation = z - predicted
    measured, new, expected = (np.diff(values, 3) for values in (z, innovation, predicted))
    return float(np.abs((measured - new - expected) * innovation[3:]).max())


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name: the error over time, and on each leg."""
    title = f"{PAPER}: uniform motion and two manoeuvres, R = {VARIANCE:g} m²"
    figure, (over_time, by_leg) = new_figure(
        title,
        (15.0, 5.6),
        (1.0, 1.0),
    )
    flights = result.examples["flights"]
    shifts = np.linspace(-0.3, 0.3, len(COLOURS))
    for shift, (name, colour) in zip(shifts, COLOURS.items(), strict=True):
        errors = result.examples[name] - flights.truth[:, None, None]
        over_time.plot(
            flights.times,
            np.sqrt((errors**2).mean((1, 2))),
            color=colour,
            label=name,
        )
        cells = [cell for cell in result.cells if cell.row == name]
        places = np.arange(len(LEGS)) + shift
        by_leg.plot(
            places,
            [cell.ours for cell in cells],
            "o",
            color=colour,
        )
        published = [cell.published for cell in cells]
        by_leg.plot(places, published, "o", color=colour, markerfacecolor="white")
    for first, _ in LEGS.values():
        over_time.axvline(
            flights.times[first],
            color="0.75",
            linestyle="--",
            linewidth=0.8,
        )
    over_time.set(
        title=f"Error over time, {result.runs} runs; dashed: a leg begins",
        xlabel="time [s]",
    )
    by_leg.set_title("RMSE on each leg; open: in the paper")
    by_leg.set_xticks(range(len(LEGS)), list(LEGS))
    ticks = (1.5, 2, 3, 5, 10, 20, 40)
    for axes in (over_time, by_leg):
        axes.set(
            yscale="log",
            ylim=(1.2, 50.0),
            ylabel="RMSE of the position on an axis [m]",
        )
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
    figure.legend(*over_time.get_legend_handles_labels(), loc="outside right upper")
    return {"zimchuk.png": figure}
