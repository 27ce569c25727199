"""Golubkov 2018: settings and reproduction of tables 2, 3, 4 and of the percentages of correct
modes, and the Kalman filter with known modes of table 2.

The paper does not state the following settings; with them the tables are reproduced. tau = 0.1 s;
alpha = beta = 0.001; natural logarithms; the filter starts at the exact x0; P := I at the start of
every segment for tables 3 and 4, but P is carried over, from P = I at the beginning, for table 2.
If several ratios exceed A, the largest wins. A segment without a decision counts its whole length
and keeps q_A. A mode is correct if its type is (straight, left or right).

Deviations from the published text: Sigma = H P H' + R (published as H' P H + R); the turns after
eq. (3) run to 2 n; rule (5) tests i only against q_A, as the algorithm does, not against any other
hypothesis ("any lambda_ij").
"""

import itertools
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from baselines import sprt_thresholds, track_ate
from hybrid_env import Simulation, simulate
from studies.papers.figures import draw_tracking
from studies.papers.reproduction import (
    PAPER_RUNS,
    Cell,
    Finding,
    Reproduction,
    both_intervals,
    rmse_row,
    table_row,
)

PAPER = "Golubkov 2018"
SCHEME = "golubkov2018"
# State one tick before the first measurement, [x, vx, y, vy] [m, m/s].
START = (0.0, 0.0, 0.0, 2.0)
# Turn radii of the 21 hypotheses [m].
RADII = tuple(float(radius) for radius in range(1, 11))
# Of the hypotheses [m]: positive to the left, negative to the right, 0 if straight.
SIGNED_RADII = np.array([0.0, *RADII, *(-radius for radius in RADII)])
# Length of a tick [s], and Q [m^2/s^2].
TAU, PROCESS_VARIANCE = 0.1, 0.001
# Of the fit of a start.
FIRST_TICKS = 10
ALPHA = 1e-3
# R [m^2] of each setting.
MEASUREMENT_VARIANCES = {
    "R1": 1.0,
    "R2": 0.1,
    "R3": 0.01,
}
PIECES = ("1", "2", "3", "4", "5", "6", "mean")
TABLE_2 = {
    "R1": (0.3552, 0.2738, 0.3618, 0.2587, 0.6316),
    "R2": (0.1355, 0.1662, 0.1363, 0.1678, 0.3045),
    "R3": (0.0506, 0.1073, 0.0500, 0.1064, 0.1670),
}
TABLE_3 = {
    "R1": (0.9189, 1.2295, 0.9752, 1.1414, 2.1471),
    "R2": (0.5743, 0.9727, 0.5671, 0.9169, 1.5615),
    "R3": (0.3650, 1.2056, 0.4292, 2.0156, 2.4152),
}
TABLE_4 = {
    "R1": (32.92, 22.87, 29.57, 37.88, 30.67, 40.74, 32.442),
    "R2": (22.18, 15.95, 26.3, 22.23, 20.48, 26.98, 22.353),
    "R3": (14.94, 11.24, 17.04, 14.66, 14.66, 18.44, 15.163),
}
# Published percentages of correct modes.
CORRECT_MODES = {
    "R1": 72.5,
    "R2": 77.0,
    "R3": 79.8,
}
# [s]
SCANNED_TAU = (0.05, 0.1, 0.2)
SCANNED_ALPHA = (0.05, 0.01, 1e-3, 1e-4)
SCANNED_RUNS = 100
# What was tried for table 2: arguments of `filter_known_modes`.
KNOWN_MODES_SETTINGS: dict[str, dict[str, Any]] = {
    "P carried over from I, as reported": {},
    "P := I at every switch": {"carry": False},
    "P carried over from 0.1 I": {"spread": 0.1},
    "P carried over from 0": {"spread": 0.0},
    "start from the first measurements": {"start": None},
}


def fitted_start(measurements: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states one tick before the first measurement, (n, 4), of lines that are fitted to
    the first ones.
    """
    times = TAU * np.arange(1, FIRST_TICKS + 1)
    first = measurements[:, :FIRST_TICKS].swapaxes(0, 1)
    velocity, position = np.polyfit(
        times,
        first.reshape(FIRST_TICKS, -1),
        1,
    )
    return np.stack([position, velocity], axis=-1).reshape(-1, 4)


def filter_known_modes(
    recording: Simulation,
    variance: float,
    start: ArrayLike | None = START,
    spread: float = 1.0,
    carry: bool = True,
) -> NDArray[np.float64]:
    """Return the estimates (n, T, 4) [m, m/s] with known modes and switch times, "optimal" in
    table 2.

    One filter runs in each segment, from the last estimate and its covariance. Its turn has the
    centre and the rate of that estimate.

    Args:
        recording: n runs.
        variance: R [m^2].
        start: (4,) state one tick before the first measurement; None fits it.
        spread: P is this multiple of I at the start.
        carry: False resets P at every switch.
    """
    runs = len(recording.measurements)
    first = fitted_start(recording.measurements) if start is None else np.tile(start, (runs, 1))
    # By run and axis: position and velocity.
    state = first.reshape(runs, 2, 2)
    covariance = np.tile(spread * np.eye(2), (runs, 1, 1))
    estimates = []
    ticks = iter(recording.measurements.swapaxes(0, 1))
    for length, radius in zip(recording.lengths, recording.signed_radii, strict=True):
        (x, vx), (y, vy) = np.moveaxis(
            state,
            0,
            -1,
        )
        transition = np.tile([[1.0, TAU], [0.0, 1.0]], (runs, 1, 1))
        centre = np.zeros((runs, 2, 2))
        if radius:
            rate = np.hypot(vx, vy) / radius
            cosine, sine = np.cos(rate * TAU), np.sin(rate * TAU)
            rows = [
                [cosine, sine / rate],
                [-rate * sine, cosine],
            ]
            transition = np.moveaxis(
                np.array(rows),
                -1,
                0,
            )
            centre[:, 0, 0], centre[:, 1, 0] = x - vy / rate, y + vx / rate
        if not carry:
            covariance = np.tile(spread * np.eye(2), (runs, 1, 1))
        for measured in itertools.islice(ticks, int(length)):
            state = centre + (state - centre) @ transition.swapaxes(1, 2)
            covariance = transition @ covariance @ transition.swapaxes(1, 2)
            covariance[:, 1, 1] += PROCESS_VARIANCE
            gain = covariance[:, 0] / (covariance[:, :1, 0] + variance)
            state = state + (measured - state[..., 0])[..., None] * gain[:, None]
            covariance = covariance - gain[..., None] * covariance[:, :1]
            estimates.append(state.reshape(runs, 4))
    return np.stack(estimates, axis=1)


def run_ate(recording: Simulation, variance: float, **options: Any) -> Any:
    """Run ATE with the 21 hypotheses of the paper; options are those of `baselines.track_ate`."""
    chosen: dict[str, Any] = {"start": START, "alpha": ALPHA} | options
    return track_ate(
        recording.measurements,
        recording.lengths,
        radii=RADII,
        measurement_variance=variance,
        **chosen,
    )


def correct_types(tracks: Any, recording: Simulation) -> NDArray[np.bool_]:
    """(n, K) True where the decided type (straight, left or right) is correct."""
    return np.sign(SIGNED_RADII[tracks.decided]) == np.sign(recording.signed_radii)


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Reproduce tables 2, 3 and 4 and the percentages, and refine the radius after the decision.

    Args:
        runs: number of runs per measurement variance, at least 2.
        seed: seed of the simulated recordings.
    """
    cells: list[Cell] = []
    findings: list[Finding] = []
    examples = {}
    for index, (name, variance) in enumerate(MEASUREMENT_VARIANCES.items()):
        recording = simulate(
            SCHEME,
            runs,
            seed + index,
            start=START,
            measurement_variance=variance,
        )
        tracks = run_ate(recording, variance)
        cells += _known_modes_cells(name, recording, seed) + _ate_cells(
            name,
            recording,
            tracks,
            seed,
        )
        findings += _findings(
            name,
            recording,
            tracks,
            run_ate(recording, variance, refine_radius=True),
        )
        examples[name] = (recording, tracks)
    findings += _scans(seed)
    return Reproduction(
        PAPER,
        runs,
        seed,
        tuple(cells),
        tuple(findings),
        examples,
    )


def _known_modes_cells(name: str, recording: Simulation, seed: int, **options: Any) -> list[Cell]:
    """A row of table 2, with options of `filter_known_modes`."""
    estimates = filter_known_modes(recording, MEASUREMENT_VARIANCES[name], **options)
    return rmse_row(
        "Table 2, RMSE with known modes",
        name,
        TABLE_2[name],
        estimates,
        recording.truth,
        seed,
    )


def _ate_cells(
    name: str,
    recording: Simulation,
    tracks: Any,
    seed: int,
) -> list[Cell]:
    """A row of tables 3 and 4 and of the percentages."""
    ticks = np.concatenate([tracks.ticks, tracks.ticks.mean(1, keepdims=True)], axis=1)
    correct = 100.0 * correct_types(tracks, recording).mean(1, keepdims=True)
    times, types = (
        both_intervals(values, lambda means: means, seed) for values in (ticks, correct)
    )
    return [
        *rmse_row(
            "Table 3, RMSE of ATE",
            name,
            TABLE_3[name],
            tracks.estimates,
            recording.truth,
            seed,
        ),
        *table_row("Table 4, decision time in ticks", name, PIECES, TABLE_4[name], times, 2),
        *table_row("Correct modes, %", name, ("S, L or R",), (CORRECT_MODES[name],), types, 1),
    ]


def _findings(
    name: str,
    recording: Simulation,
    tracks: Any,
    refined: Any,
) -> list[Finding]:
    """Effect of taking the most likely turn in the decided direction afterwards, and how few
    runs carry the error.
    """
    figures = []
    for track in (tracks, refined):
        squares = (track.estimates - recording.truth) ** 2
        radius = 100.0 * (SIGNED_RADII[track.decided] == recording.signed_radii).mean()
        figures.append(
            (
                radius,
                100.0 * correct_types(track, recording).mean(),
                np.sqrt(squares.mean((0, 1)).sum()),
            )
        )
    text = (
        "correct radius {:.1f} -> {:.1f} %, correct type {:.1f} -> {:.1f} %, nRMSE {:.3f} -> {:.3f}"
    )
    change = text.format(*itertools.chain(*zip(*figures, strict=True)))
    squares = ((tracks.estimates - recording.truth) ** 2).mean(1).sum(-1)
    worst = np.sort(squares)[-max(round(0.01 * squares.size), 1) :]
    blocks = [
        np.sqrt(block.mean())
        for block in np.array_split(squares, max(squares.size // PAPER_RUNS, 1))
    ]
    spread = (
        f"nRMSE {min(blocks):.2f} to {max(blocks):.2f}; the worst 1 % of all runs carry "
        f"{100.0 * worst.sum() / squares.sum():.0f} % of the squared error"
    )
    by_radius = f"{figures[0][0]:.1f} %"
    claim = f"{CORRECT_MODES[name]} %, what counts not stated"
    return [
        Finding(f"{name}: radius refined after the decision", change, "named as future work"),
        Finding(f"{name}: table 3 in {len(blocks)} studies of {PAPER_RUNS} runs", spread),
        Finding(f"{name}: modes that are correct if the radius counts too", by_radius, claim),
    ]


def _scans(seed: int) -> list[Finding]:
    """Number of published values inside, for the settings that were tried."""
    tried: dict[str, list[Cell]] = {}
    for index, (name, variance) in enumerate(MEASUREMENT_VARIANCES.items()):
        for tau in SCANNED_TAU:
            recording = simulate(
                SCHEME,
                SCANNED_RUNS,
                seed + index,
                start=START,
                tau=tau,
                measurement_variance=variance,
            )
            for alpha in SCANNED_ALPHA:
                label = (
                    f"tables 3, 4 and percentages with tau = {tau:g} s, alpha = beta = {alpha:g}"
                )
                tracks = run_ate(recording, variance, tau=tau, alpha=alpha)
                tried.setdefault(label, []).extend(_ate_cells(name, recording, tracks, seed))
        recording = simulate(
            SCHEME,
            SCANNED_RUNS,
            seed + index,
            start=START,
            measurement_variance=variance,
        )
        label = "tables 3, 4 and percentages with a start from the first measurements"
        tried.setdefault(label, []).extend(
            _ate_cells(name, recording, run_ate(recording, variance, start=None), seed)
        )
        for setting, options in KNOWN_MODES_SETTINGS.items():
            tried.setdefault(f"table 2, {setting}", []).extend(
                _known_modes_cells(name, recording, seed, **options)
            )
    findings = []
    for label, cells in tried.items():
        inside = f"{sum(cell.verdict == 'inside' for cell in cells)} of {len(cells)} inside"
        findings.append(Finding(f"tried, {SCANNED_RUNS} runs: {label}", inside, "not stated"))
    return findings


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return a figure for each R by its file name."""
    types = np.sign(SIGNED_RADII).astype(np.int64) % 3
    figures = {}
    for index, (name, example) in enumerate(result.examples.items(), start=1):
        recording, tracks = example
        title = f"{PAPER}: one run of ATE, R = {MEASUREMENT_VARIANCES[name]:g} m²"
        figure = draw_tracking(title, recording, tracks, types, sprt_thresholds(ALPHA))
        figures[f"golubkov2018_{index}.png"] = figure
    return figures
