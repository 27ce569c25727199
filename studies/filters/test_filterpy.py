"""The IMM filters of filterpy and of this study after an outlier, and the table of the page."""

from pathlib import Path

import numpy as np
from scipy.stats import norm

from studies.filters.__main__ import both

PAGE = Path(__file__).with_name("README.md")


def test_the_study_prints_the_table_of_the_page(tmp_path, run_study):
    printed = run_study("filters", "--out", str(tmp_path))
    table = (tmp_path / "filters.md").read_text()

    assert table in printed
    assert table in PAGE.read_text(encoding="utf-8")


def test_probabilities_are_right_at_any_distance():
    ours, peer = both()
    ours.predict(1.0)
    prior = ours.probabilities[0]
    spreads = [np.sqrt(kalman.covariance[0, 0, 0] + 1.0) for kalman in ours.filters]
    measured = ours.state[0, 0] + 60.0 * spreads[1]
    expected = [
        norm.logpdf(measured, kalman.state[0, 0], s)
        for kalman, s in zip(ours.filters, spreads, strict=True)
    ]
    ours.update([[measured]])
    ratios = np.diff(np.log(ours.probabilities[0]) - np.log(prior))
    np.testing.assert_allclose(ratios, np.diff(expected), rtol=1e-9)
    peer.predict()
    peer.update(np.array([[measured]]))
    # Filterpy has lost the measurement.
    np.testing.assert_allclose(peer.mu, prior)
