"""The published tables, the filters against literal ones, and the table of the page."""

import json
from pathlib import Path

import numpy as np
import pytest
from matrix_filters import MatrixKalmanFilter

from agents import run_command
from hybrid_env import simulate
from studies.filters.gains import AdaptiveFilter
from studies.filters.run_filter import run_filter
from studies.papers import golubkov2018, golubkov2020, tsyganov2019, zimchuk
from studies.papers.__main__ import Reproduce
from studies.papers.published import intervals
from studies.papers.setting import GOLUBKOV_2018


def test_the_quick_form_writes_tables(tmp_path):
    assert run_command(Reproduce, "papers", ["--quick", "--out", str(tmp_path)]) == 0
    cells = json.loads((tmp_path / "golubkov2018.json").read_text())["cells"]

    assert {cell["verdict"] for cell in cells} == {"inside", "outside"}
    assert (tmp_path / "reproduction.md").read_text().count("\n| ") == 7


@pytest.mark.study
def test_the_table_of_the_page_is_up_to_date(tmp_path):
    page = (Path(__file__).parent / "README.md").read_text()
    shown = page.split("<!-- reproduction -->\n")[1].split("<!-- /reproduction -->")[0].splitlines()
    assert run_command(Reproduce, "papers", ["--out", str(tmp_path)]) == 0
    printed = (tmp_path / "reproduction.md").read_text().splitlines()

    assert len(shown) >= 9
    assert [line for line in shown if line.startswith("|") and line not in printed] == []


@pytest.mark.parametrize(
    ("paper", "least", "total"), [(golubkov2018, 36, 39), (tsyganov2019, 9, 10), (zimchuk, 4, 7)]
)
def test_the_published_tables_come_out(paper, least, total):
    result = paper.reproduce(300, seed=0)
    counted = result.cells[(result.cells.verdict != "not published") & (result.cells.excuse == "")]
    # It does not come out.
    counted = counted[~counted.table.str.startswith("Table 2")]

    assert len(counted) == total
    assert (counted.verdict == "inside").sum() >= least
    # One of the settings of Golubkov 2018 that were tried has the published values.
    tried = {name: int(value.split()[0]) for name, value, _ in result.findings if "tau =" in name}
    best = [name.partition("with ")[2] for name, count in tried.items() if count >= 30]
    assert best == ["tau = 0.1 s, alpha = beta = 0.001"] * (paper is golubkov2018)


def test_the_published_delay_of_golubkov_2020_is_within_the_distribution():
    cells = golubkov2020.reproduce(runs=200, seed=0).cells
    inside = cells[cells.verdict == "inside"].row.tolist()

    assert inside[:2] == ["alpha = 0.1", "alpha = 0.05"]


def test_intervals_are_those_of_a_mean_of_100_runs_and_of_all():
    values = np.random.default_rng(0).normal(5.0, 2.0, (4000, 1))
    mean, *bounds = np.ravel(intervals(values, np.positive, seed=0))

    assert mean == pytest.approx(values.mean())
    # With 2,000 resamples the standard error of a 2.5 % quantile is about 4 % of the half width.
    widths = np.diff(bounds)[::2] / (2 * 1.96)
    assert widths == pytest.approx([2.0 / np.sqrt(100), 2.0 / np.sqrt(4000)], rel=0.1)


def test_the_filter_with_known_modes_equals_matrix_filters():
    recording = simulate("L40r3 S30 R50r6", runs=1, seed=3, measurement_variance=0.3)
    estimates = iter(golubkov2018.filter_known_modes(recording, 0.3)[0])
    measurements = iter(recording.measurements[0])
    state, P = GOLUBKOV_2018.start, np.eye(4)
    for length, radius in ((40, 3.0), (30, 0.0), (50, -6.0)):
        kalman = MatrixKalmanFilter(state, P, radius, 0.1, 0.001, 0.3 * np.eye(2))
        for _ in range(length):
            kalman.step(next(measurements))
            np.testing.assert_allclose(next(estimates), kalman.x, atol=1e-11)
        state, P = kalman.x, kalman.P


def test_an_axis_is_filtered_by_the_published_scalar_formulas():
    measured = zimchuk.true_position() + np.random.default_rng(0).normal(0.0, 5.0, 700)
    tau, x, v = zimchuk.TAU, measured[0], 0.0
    positions, predicted, innovations, products = [x], [], [], []
    for n, z in enumerate(measured[1:], start=2):
        x += tau * v
        predicted.insert(0, np.array([x, v]))
        innovations.insert(0, z - x)
        nu = innovations
        K = np.array([2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1) * tau)])
        if len(nu) > 4:
            third = predicted[0] - 3 * predicted[1] + 3 * predicted[2] - predicted[3]
            products.append(np.array([*nu[:5], *third]) * nu[0])
        if len(products) > 10:
            H0, H1, H2, H3, H4, of_x, of_v = np.mean(products, axis=0)
            spread = 3 * H1 - 3 * H2 + H3 - of_x, (3 * H1 - 6 * H2 + 4 * H3 - H4) / tau - of_v
            K[0] = np.clip(spread[0] / H0, 0, 1)
            K[1] = np.clip(spread[1] / H0, 0, K[0] ** 2 / ((2 - K[0]) * tau))
        x, v = x + K[0] * nu[0], v + K[1] * nu[0]
        positions.append(x)

    ours = run_filter(AdaptiveFilter(1), measured[:, None, None], zimchuk.TIMES).positions[:, 0, 0]
    np.testing.assert_allclose(ours, positions, rtol=1e-7)
