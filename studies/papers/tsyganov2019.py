"""Tsyganov 2019: reproduction of the RMSE table, and variants of the recalculation.

Lines 17 to 20 of the published algorithm go back neither to the first state of the segment nor to
its covariance ("literal"), and the table does not come out; "rewind" goes back to both.
"""

from math import nan

from studies.papers.published import Finding, Reproduction, rmse_row
from studies.papers.setting import TSYGANOV_2019 as SETTING

# RMSE by setting; NaN is illegible.
TABLE = {
    "R = 0.01": (nan, 0.0404, nan, nan, 0.3103),
    "R = 0.1": (nan, 0.0449, nan, 0.0408, 0.3832),
    "R = 1": (0.3791, 0.0575, 0.3440, 0.0568, 0.5182),
}
# Options of `track_ate`, the published ones first.
VARIANTS = {
    "back to the first state, not to its covariance": {},
    "lines 17 to 20 as printed, no rewind": {"recalculation": "literal"},
    "rewind of state and covariance, tests against straight": {
        "recalculation": "rewind",
        "reference": "straight",
    },
}


def reproduce(runs: int = 1000, seed: int = 0) -> Reproduction:
    """Reproduce the table, and compare variants of the recalculation; arguments as of
    `golubkov2018.reproduce`.
    """
    rows = []
    findings: list[Finding] = []
    for index, (name, variance) in enumerate(SETTING.variances.items()):
        recording = SETTING.simulate(runs, seed + index, variance)
        for variant, options in VARIANTS.items():
            tracks = SETTING.track(recording, variance, **options)
            estimates = tracks.estimates
            row = rmse_row("Table, RMSE", name, TABLE[name], estimates, recording.truth, seed)
            claim = ""
            if not options:
                rows.append(row)
                claim = "the motion modes were detected correctly in all three considered cases"
            correct = 100.0 * SETTING.correct_types(tracks, recording).mean()
            text = f"{correct:.1f} % of modes correct, nRMSE {row.ours.iloc[-1]:.4f}"
            findings.append((f"{name}, {variant}", text, claim))
    return Reproduction(SETTING.paper, runs, seed, rows, findings)
