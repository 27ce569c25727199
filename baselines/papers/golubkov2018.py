"""Golubkov 2018, tables 2, 3, 4 and the share of right modes: settings, study, analysis.

Not stated in print and found to reproduce the tables: tau = 0.1; alpha = beta = 0.001; natural logarithms;
the filter starts at the exact x0; P := I at every piece for tables 3 and 4, carried over from P = I for
table 2; of several ratios above A the largest wins; a piece without a decision counts its whole length and
keeps q_A; "right" means straight, left or right, not the radius.

Where this departs from the print: Sigma = H P H' + R (printed H' P H + R); the turns after eq. (3) run to
2 n; rule (5) tests i against q_A alone, as the algorithm does, not "any lambda_ij".
"""

import numpy as np
from numpy.typing import NDArray

from baselines.filters.known_modes import filter_known_modes
from baselines.papers.reproduction import Cell, Finding, Reproduction, cells_of, rmse_figures, study_spread
from baselines.recordings.ate import Tracks, track
from hybrid_env.checks import check_integer
from hybrid_env.simulation import Simulation, simulate

PAPER = "Golubkov 2018"
SCHEME = "golubkov2018"
START = (0.0, 0.0, 0.0, 2.0)
RADII = tuple(float(radius) for radius in range(1, 11))
ALPHA = 1e-3
NOISE = {"R1": 1.0, "R2": 0.1, "R3": 0.01}  # R [m^2]

STATES = ("x1", "x2", "x3", "x4", "nRMSE")
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
RIGHT_MODES = {"R1": 72.5, "R2": 77.0, "R3": 79.8}  # per cent


def follow(recording: Simulation, variance: float, refine_radius: bool = False) -> Tracks:
    """ATE with the paper's 21 hypotheses."""
    return track(
        recording.measurements, recording.lengths, START, radii=RADII, measurement_variance=variance,
        alpha=ALPHA, refine_radius=refine_radius,
    )  # fmt: skip


def right_types(found: Tracks, recording: Simulation) -> NDArray[np.bool_]:
    """(n, K) True where straight, left or right is right."""
    n = len(RADII)
    sides = np.where(found.decided == 0, 0, np.where(found.decided <= n, 1, -1))
    return sides == np.sign(recording.signed_radii)


def right_radii(found: Tracks, recording: Simulation) -> NDArray[np.bool_]:
    """(n, K) True where the hypothesis is right, radius included."""
    signed = np.array([0.0, *RADII, *(-radius for radius in RADII)])
    return signed[found.decided] == recording.signed_radii


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Tables 2, 3 and 4, the percentages, and the radius refined after the decision."""
    runs = check_integer("runs", runs, minimum=2)
    cells: list[Cell] = []
    findings: list[Finding] = []
    pictures = {}
    for row, (name, variance) in enumerate(NOISE.items()):
        recording = simulate(SCHEME, runs, seed + row, start=START, measurement_variance=variance)
        found = follow(recording, variance)
        known = filter_known_modes(
            recording.measurements, recording.lengths, recording.signed_radii, START,
            measurement_variance=variance,
        )  # fmt: skip
        for table, estimates, published in (
            ("Table 2, RMSE with known modes", known.estimates, TABLE_2),
            ("Table 3, RMSE of ATE", found.estimates, TABLE_3),
        ):
            squares = ((estimates - recording.truth) ** 2).mean(1)
            cells += cells_of(table, name, STATES, published[name], study_spread(squares, rmse_figures, seed))
        ticks = np.concatenate([found.ticks, found.ticks.mean(1, keepdims=True)], axis=1)
        spread = study_spread(ticks, lambda means: means, seed)
        cells += cells_of("Table 4, decision time in ticks", name, PIECES, TABLE_4[name], spread, 2)
        right = 100.0 * right_types(found, recording).mean(1, keepdims=True)
        spread = study_spread(right, lambda means: means, seed)
        cells += cells_of("Right modes, %", name, ("S, L or R",), (RIGHT_MODES[name],), spread, 1)
        findings += _radius_findings(name, recording, found, follow(recording, variance, refine_radius=True))
        pictures[name] = (recording, found)
    return Reproduction(PAPER, runs, seed, tuple(cells), tuple(findings), pictures)


def _radius_findings(name: str, recording: Simulation, found: Tracks, refined: Tracks) -> list[Finding]:
    """The paper's future work: the radius refined after the decision, by the likeliest turn of the side."""

    def describe(tracks: Tracks) -> tuple[float, float, float]:
        squares = ((tracks.estimates - recording.truth) ** 2).mean((0, 1)).sum()
        types, radii = right_types(tracks, recording).mean(), right_radii(tracks, recording).mean()
        return 100 * radii, 100 * types, float(np.sqrt(squares))

    before, after = describe(found), describe(refined)
    return [
        Finding(
            f"{name}: radius refined after the decision",
            f"radius right {before[0]:.1f} -> {after[0]:.1f} %, "
            f"type right {before[1]:.1f} -> {after[1]:.1f} %, nRMSE {before[2]:.3f} -> {after[2]:.3f}",
            "named as future work",
        )
    ]
