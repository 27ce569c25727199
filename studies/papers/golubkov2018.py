"""Golubkov 2018: reproduction of tables 2, 3, 4 and of the percentages of correct modes, and the
Kalman filter with known modes of table 2.

The paper does not state the following settings; with them the tables are reproduced. tau = 0.1 s;
alpha = beta = 0.001; natural logarithms; the filter starts at the exact x0; P := I at the start of
every segment for tables 3 and 4, but P is carried over, from P = I at the beginning, for table 2.
If several ratios exceed A, the largest wins. A segment without a decision counts its whole length
and keeps q_A. A mode is correct if its type is (straight, left or right).

Deviations from the published text: Sigma = H P H' + R (published as H' P H + R); the turns after
eq. (3) run to 2 n; rule (5) tests i only against q_A, as the algorithm does, not against any other
hypothesis ("any lambda_ij").
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from hybrid_env import Simulation
from studies.arrays import FloatArray
from studies.papers.published import Finding, Reproduction, intervals, rmse_row, table_row
from studies.papers.setting import GOLUBKOV_2018 as SETTING

KNOWN_MODES = "Table 2, RMSE with known modes"
ATE, TIMES, SHARE = "Table 3, RMSE of ATE", "Table 4, decision time in ticks", "Correct modes, %"
PUBLISHED: dict[str, dict[str, tuple[float, ...]]] = {
    KNOWN_MODES: {
        "R1": (0.3552, 0.2738, 0.3618, 0.2587, 0.6316),
        "R2": (0.1355, 0.1662, 0.1363, 0.1678, 0.3045),
        "R3": (0.0506, 0.1073, 0.0500, 0.1064, 0.1670),
    },
    ATE: {
        "R1": (0.9189, 1.2295, 0.9752, 1.1414, 2.1471),
        "R2": (0.5743, 0.9727, 0.5671, 0.9169, 1.5615),
        "R3": (0.3650, 1.2056, 0.4292, 2.0156, 2.4152),
    },
    TIMES: {
        "R1": (32.92, 22.87, 29.57, 37.88, 30.67, 40.74, 32.442),
        "R2": (22.18, 15.95, 26.3, 22.23, 20.48, 26.98, 22.353),
        "R3": (14.94, 11.24, 17.04, 14.66, 14.66, 18.44, 15.163),
    },
    SHARE: {"R1": (72.5,), "R2": (77.0,), "R3": (79.8,)},
}


def filter_known_modes(recording: Simulation, variance: float) -> FloatArray:
    """Return the estimates (n, T, 4) [m, m/s] with known modes and switch times, "optimal" in
    table 2, from the exact state one tick before the first measurement, and P = I.

    One filter runs in each segment, from the last estimate and its covariance. Its turn has the
    centre and the rate of that estimate. Points of the plane are complex numbers x + i y, and both
    axes share the gain.

    Args:
        recording: n runs.
        variance: R [m^2].
    """
    measurements = recording.measurements @ [1.0, 1.0j]
    runs = len(measurements)
    state = np.tile([1.0, 1.0j] @ np.reshape(SETTING.start, (2, 2)), (runs, 1))
    covariance = np.tile(np.eye(2), (runs, 1, 1))
    estimates = []
    parts = np.split(measurements, recording.lengths.cumsum()[:-1], axis=1)
    for part, radius in zip(parts, recording.signed_radii, strict=True):
        transition = np.tile([[1.0, SETTING.tau], [0.0, 1.0]], (runs, 1, 1))
        centre = np.zeros((runs, 2), np.complex128)
        if radius:
            rate = np.abs(state[:, 1]) / radius
            cosine, sine = np.cos(rate * SETTING.tau), np.sin(rate * SETTING.tau)
            rows = [[cosine, sine / rate], [-rate * sine, cosine]]
            transition = np.moveaxis(np.array(rows), -1, 0)
            centre[:, 0] = state[:, 0] + 1j * state[:, 1] / rate
        for measured in part.T:
            state = centre + (transition @ (state - centre)[..., None])[..., 0]
            covariance = transition @ covariance @ transition.swapaxes(1, 2)
            covariance[:, 1, 1] += SETTING.process_variance
            gain = covariance[:, 0] / (covariance[:, :1, 0] + variance)
            state = state + gain * (measured - state[:, 0])[:, None]
            covariance = covariance - gain[..., None] * covariance[:, :1]
            estimates.append(np.stack([state.real, state.imag], axis=1).reshape(runs, 4))
    return np.stack(estimates, axis=1)


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Reproduce tables 2, 3 and 4 and the percentages.

    Args:
        runs: number of runs per measurement variance, at least 2.
        seed: seed of the simulated recordings.
    """
    rows: list[pd.DataFrame] = []
    findings: list[Finding] = []
    for name, recording, tracks, of_setting in _compared(runs, seed):
        rows += of_setting
        findings += _findings(name, recording, tracks)
    return Reproduction(
        SETTING.paper,
        runs,
        seed,
        rows,
        [*findings, *_counts(runs, seed, rows), *_settings_tried(seed)],
    )


def _compared(runs: int, seed: int) -> Iterator[tuple[str, Simulation, Any, list[pd.DataFrame]]]:
    """Yield name, recording, tracks of ATE and rows of all tables of every setting."""
    for index, (name, variance) in enumerate(SETTING.variances.items()):
        recording = SETTING.simulate(runs, seed + index, variance)
        tracks = SETTING.track(recording, variance)
        known = rmse_row(
            KNOWN_MODES,
            name,
            PUBLISHED[KNOWN_MODES][name],
            filter_known_modes(recording, variance),
            recording.truth,
            seed,
        )
        yield (name, recording, tracks, [known, *_ate_rows(name, recording, tracks, seed)])


def _counts(runs: int, seed: int, rows: list[pd.DataFrame], seeds: int = 4) -> list[Finding]:
    """Number of published values inside at consecutive seeds, of each table, from the rows at the
    first seed.
    """
    counted: dict[str, list[str]] = {table: [] for table in PUBLISHED}
    for later in range(seed, seed + seeds):
        if later > seed:
            rows = [row for *_, of_setting in _compared(runs, later) for row in of_setting]
        for table, cells in Reproduction("", runs, later, rows, ()).tables.items():
            counted[table].append(f"{(cells.verdict == 'inside').sum()} of {len(cells)}")
    label = f"at the seeds {seed} to {seed + seeds - 1}"
    return [(f"{table}, {label}", ", ".join(counts), "") for table, counts in counted.items()]


def _ate_rows(name: str, recording: Simulation, tracks: Any, seed: int) -> list[pd.DataFrame]:
    """A row of tables 3 and 4 and of the percentages."""
    published = {table: values[name] for table, values in PUBLISHED.items()}
    ticks = np.concatenate([tracks.ticks, tracks.ticks.mean(1, keepdims=True)], axis=1)
    correct = 100.0 * SETTING.correct_types(tracks, recording).mean(1, keepdims=True)
    means = [
        table_row(
            table, name, heads, published[table], intervals(values, np.positive, seed), digits
        )
        for table, heads, values, digits in (
            (TIMES, (*"123456", "mean"), ticks, 2),
            (SHARE, ("S, L or R",), correct, 1),
        )
    ]
    errors = rmse_row(ATE, name, published[ATE], tracks.estimates, recording.truth, seed)
    return [errors, *means]


def _findings(name: str, recording: Simulation, tracks: Any) -> list[Finding]:
    """How few runs carry the error, and how many modes are correct with their radius."""
    squares = ((tracks.estimates - recording.truth) ** 2).mean(1).sum(-1)
    worst = np.sort(squares)[-max(round(0.01 * squares.size), 1) :]
    studies = np.array_split(squares, max(squares.size // 100, 1))
    errors = [np.sqrt(study.mean()) for study in studies]
    right = SETTING.signed_radii[tracks.decided] == recording.signed_radii
    return [
        (
            f"{name}: table 3 in {len(studies)} studies of 100 runs",
            f"nRMSE {min(errors):.2f} to {max(errors):.2f}; the worst 1 % of all runs carry "
            f"{100.0 * worst.sum() / squares.sum():.0f} % of the squared error",
            "",
        ),
        (
            f"{name}: modes that are correct if the radius counts too",
            f"{100.0 * right.mean():.1f} %",
            f"{PUBLISHED[SHARE][name][0]} %, what counts not stated",
        ),
    ]


def _settings_tried(seed: int, runs: int = 100) -> list[Finding]:
    """Number of published values inside, for the settings that were tried."""
    findings = []
    for tau, alpha in product((0.05, SETTING.tau, 0.2), (0.05, 0.01, 1e-3, 1e-4)):
        rows = []
        for index, (name, variance) in enumerate(SETTING.variances.items()):
            recording = SETTING.simulate(runs, seed + index, variance, tau=tau)
            tracks = SETTING.track(recording, variance, tau=tau, alpha=alpha)
            rows += _ate_rows(name, recording, tracks, seed)
        verdicts = Reproduction("", runs, seed, rows, ()).cells.verdict
        inside = f"{(verdicts == 'inside').sum()} of {len(verdicts)} inside"
        label = f"tau = {tau:g} s, alpha = beta = {alpha:g}"
        tried = f"tried, {runs} runs: tables 3, 4 and percentages with {label}"
        findings.append((tried, inside, "not stated"))
    return findings
