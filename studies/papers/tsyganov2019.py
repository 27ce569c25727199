"""Tsyganov 2019: settings and reproduction of the RMSE table.

Settings that the paper does not state: tau = 0.1 s; alpha = beta = 0.001; x0 = [0, 0, 0, 0.25]
(published with a decimal comma). After a decision, the estimates of the segment are recalculated
from its first state but with the covariance of the decision tick, so that the data are used twice
("as_published"). Lines 17 to 20 of the published algorithm go back to neither ("literal"), and the
table does not come out; "rewind" goes back to both.
"""

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines import sprt_thresholds, track_ate
from hybrid_env import simulate
from studies.papers.figures import draw_tracking
from studies.papers.reproduction import Cell, Finding, Reproduction, rmse_row

PAPER = "Tsyganov 2019"
SCHEME = "tsyganov2019"
# State one tick before the first measurement, [x, vx, y, vy] [m, m/s].
START = (0.0, 0.0, 0.0, 0.25)
# Turn radius [m].
RADIUS = 5.0
ALPHA = 1e-3
# R [m^2] of each setting.
MEASUREMENT_VARIANCES = {
    "R = 0.01": 0.01,
    "R = 0.1": 0.1,
    "R = 1": 1.0,
}
CLAIM = "the motion modes were detected correctly in all three considered cases"
ILLEGIBLE = math.nan
TABLE = {
    "R = 0.01": (ILLEGIBLE, 0.0404, ILLEGIBLE, ILLEGIBLE, 0.3103),
    "R = 0.1": (ILLEGIBLE, 0.0449, ILLEGIBLE, 0.0408, 0.3832),
    "R = 1": (0.3791, 0.0575, 0.3440, 0.0568, 0.5182),
}
AS_PUBLISHED = "back to the first state, not to its covariance"
VARIANTS: dict[str, dict[str, Any]] = {
    AS_PUBLISHED: {"recalculation": "as_published"},
    "lines 17 to 20 as printed, no rewind": {"recalculation": "literal"},
    "rewind of state and covariance": {"recalculation": "rewind"},
    "rewind of state and covariance, tests against straight": {
        "recalculation": "rewind",
        "reference": "straight",
    },
}


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Reproduce the table, and compare variants of the recalculation; arguments as of
    `golubkov2018.reproduce`.
    """
    cells: list[Cell] = []
    findings: list[Finding] = []
    examples = {}
    for index, (name, variance) in enumerate(MEASUREMENT_VARIANCES.items()):
        variances: dict[str, Any] = {"process_variance": 0.0, "measurement_variance": variance}
        recording = simulate(
            SCHEME,
            runs,
            seed + index,
            start=START,
            **variances,
        )
        for variant, options in VARIANTS.items():
            settings: dict[str, Any] = {"radii": [RADIUS], "alpha": ALPHA} | variances | options
            tracks = track_ate(recording.measurements, recording.lengths, START, **settings)
            row = rmse_row(
                "Table, RMSE",
                name,
                TABLE[name],
                tracks.estimates,
                recording.truth,
                seed,
            )
            if variant == AS_PUBLISHED:
                cells += row
                examples[name] = (recording, tracks)
            sides = np.array([0, 1, -1])[tracks.decided]
            correct = 100.0 * (sides == np.sign(recording.signed_radii)).mean()
            text = f"{correct:.1f} % of modes correct, nRMSE {row[-1].ours:.4f}"
            findings.append(
                Finding(f"{name}, {variant}", text, CLAIM if variant == AS_PUBLISHED else "")
            )
    return Reproduction(
        PAPER,
        runs,
        seed,
        tuple(cells),
        tuple(findings),
        examples,
    )


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return a figure for each R by its file name."""
    figures = {}
    for index, (name, example) in enumerate(result.examples.items(), start=1):
        recording, tracks = example
        title = f"{PAPER}: one run of ATE, {name} m²"
        figure = draw_tracking(
            title,
            recording,
            tracks,
            np.arange(3),
            sprt_thresholds(ALPHA),
        )
        figures[f"tsyganov2019_{index}.png"] = figure
    return figures
