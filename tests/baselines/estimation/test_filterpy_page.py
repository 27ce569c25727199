"""The page "Other libraries": its program beside filterpy prints its table, and probabilities are
right at any distance.
"""

import re
from pathlib import Path

import numpy as np
from scipy.stats import norm

PAGE = Path(__file__).parents[3] / "docs/libraries.md"


def test_the_program_of_the_page_prints_its_table(capsys):
    text = PAGE.read_text(encoding="utf-8").partition("## From filterpy")[2]
    names = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)

    assert capsys.readouterr().out == re.search(r"```text\n(deviations.*?)```", text, re.DOTALL)[1]
    ours, peer = names["both"]()
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
