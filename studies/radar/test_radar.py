"""The radar study: its quick forms, flights, noise, filters and tuning."""

import json

import numpy as np
import pandas as pd
import pytest

from agents import run_command
from studies.filters.gains import GHFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.filters.run_filter import run_filter
from studies.radar import radars, tuning
from studies.radar.__main__ import Radar
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.filters import moving_average
from studies.radar.radars import draw_noise, flight_errors

pytest.importorskip("pyarrow")


def test_the_quick_form_prints_its_tables(tmp_path, capsys):
    arguments = ["scores", "--quick", "--jobs", "1", "--out", str(tmp_path)]
    assert run_command(Radar, "radar", arguments) == 0
    assert (tmp_path / "scores.md").read_text() in capsys.readouterr().out
    values = json.loads((tmp_path / "scores.json").read_text())
    assert [len(filters) for filters in values.values()] == [9, 9]


def test_the_same_seed_writes_the_same_bytes_and_the_split_is_that_of_the_study(tmp_path):
    folders = [tmp_path / "first", tmp_path / "again"]
    for folder in folders:
        folder.mkdir()
        write_radar_data(folder, seed=3, flights=34)
    first, again = (
        {file.name: file.read_bytes() for file in folder.iterdir()} for folder in folders
    )

    assert first == again
    data = load_radar_data(folders[0])
    assert [len(flown) for flown in data.flights.values()] == [10, 24]
    speeds = [np.linalg.norm(flown.velocities, axis=1).mean() for flown in data.flights["test"]]
    assert np.mean(speeds) == pytest.approx(50.0, abs=1.0)
    tracks = data.tracks["test"]["gaussian"]
    error = (tracks.measurements - tracks.positions)[~np.isnan(tracks.positions)]
    assert error.std() == pytest.approx(radars.SIGMA, rel=4.0 / np.sqrt(2 * error.size))


def test_levy_noise_has_its_characteristic_function():
    levy = draw_noise("levy", 30_000, np.random.default_rng(1))
    assert np.abs(levy).max() == radars.CLIP
    expected = np.exp(-((radars.SIGMA * 0.08) ** radars.STABILITY))
    # 4 standard errors of a mean of cosines, at most sqrt(1/2) each, and 3e-4 of the draws are
    # clipped.
    bound = 4.0 * np.sqrt(0.5 / levy.size) + 2 * 3e-4
    assert np.cos(0.08 * levy).mean() == pytest.approx(expected, abs=bound)


def test_moving_average_equals_pandas():
    values = np.random.default_rng(3).normal(size=(40, 3))
    values[[0, 5, 6, 20]] = np.nan
    expected = pd.DataFrame(values).rolling(7, min_periods=1).mean().mask(np.isnan(values))

    np.testing.assert_allclose(moving_average(values, 7), expected, rtol=0.0, atol=1e-9)


def test_a_tuning_that_is_killed_ends_with_the_same_parameters(tmp_path):
    write_radar_data(tmp_path, flights=14)
    training = load_radar_data(tmp_path).tracks["training"]
    whole, _, parts = (
        tuning.tune("KF CV", "gaussian", training, trials, 7, tmp_path / name)
        for trials, name in ((12, "whole"), (5, "parts"), (12, "parts"))
    )

    assert parts == whole


def test_the_g_h_filter_starts_with_two_points_and_anew_after_a_gap():
    measurements = np.array([np.nan, 2.0, np.nan, 8.0, 11.0, np.nan, 50.0, 54.0, 54.5])[
        :, None, None
    ]
    times = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 9.0, 9.0]
    gh = GHFilter(1, 0.5, 0.25, longest_gap=3.5)
    # By hand: two points 2 s apart, a prediction, a gap of 4 s, a second sensor at the same time.
    expected = [[2.0, 0.0], [2.0, 0.0], [8.0, 3.0], [11.0, 3.0], [14.0, 3.0], [50.0, 0.0]]
    states = run_filter(gh, measurements, times).states[:, 0]

    assert np.isnan(states[0]).all()
    np.testing.assert_allclose(states[1:], [*expected, [54.0, 4.0], [54.25, 4.0]])


def test_constant_gains_are_those_of_a_kalman_filter_in_its_steady_state():
    # Kalata 1984 with the tracking index, deviation of the acceleration times step^2 over deviation
    # of a measurement.
    step = 0.7
    deviation = 3.0
    index = 0.8
    root = np.sqrt(index**2 + 8.0 * index)
    g = ((index + 4.0) * root - index**2 - 8.0 * index) / 8.0
    h = (index**2 + 4.0 * index - index * root) / 4.0
    variance = (index * deviation / step**2) ** 2
    motion = MotionModel("CV", axes=1, noise=variance, discretization="discrete")
    kalman = KalmanFilter(motion, deviation**2, [30.0])
    times = step * np.arange(200.0)
    noise = np.random.default_rng(0).normal(0.0, deviation, (200, 5, 1))
    measured = times[:, None, None] ** 2 + noise
    exact, ours = (run_filter(each, measured, times).states for each in (kalman, GHFilter(1, g, h)))

    np.testing.assert_allclose(ours[150:], exact[150:], rtol=1e-9, atol=1e-7)
    assert np.abs(ours[3] - exact[3]).max() > 0.1


def test_errors_are_means_over_the_axes_and_those_of_the_formula():
    truth = np.zeros((3, 1, 3))
    truth[2] = np.nan
    estimates = np.array([[3.0, -4.0, 0.0], [1.0, 2.0, 2.0], [9.0, 9.0, 9.0]])[:, None]
    # By hand, of two measurements: squares of the axes 5, 10 and 2.
    expected = [np.sqrt([5.0, 10.0, 2.0]).mean(), np.sqrt((25.0 + 9.0) / 2.0)]

    np.testing.assert_allclose(flight_errors(estimates, truth), [expected])
