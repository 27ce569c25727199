"""The radar study: its quick forms, flights, noise, filters and tuning."""

import json
import os

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from agents import run_command
from baselines import KalmanFilter, MotionModel, run_filter
from studies.radar import flights as model
from studies.radar import radars, tuning
from studies.radar.__main__ import Radar
from studies.radar.alternatives import Correntropy, GHFilter
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.filters import moving_average
from studies.radar.particles import ParticleFilter
from studies.radar.radars import draw_noise, measure, scan_flights
from studies.radar.thesis import METRICS, TABLES, TEST_ERRORS, UNFILTERED, reproduce

pytest.importorskip("pyarrow")


@pytest.mark.parametrize("part", ["scores", "thesis"])
def test_the_quick_form_prints_its_tables(part, tmp_path, capsys):
    arguments = [
        part,
        "--quick",
        "--jobs",
        "1",
        "--out",
        str(tmp_path),
    ]
    assert run_command(Radar, "radar", arguments) == 0
    assert (tmp_path / f"{part}.md").read_text() in capsys.readouterr().out
    values = json.loads((tmp_path / f"{part}.json").read_text())
    if part == "scores":
        assert [len(filters) for filters in values.values()] == [12, 12]
        return
    # Unfiltered, the error is the noise itself: 4 standard errors of a deviation, from about 28
    # flights x 70 measurements x 3 axes.
    unfiltered = values["cells"][0]
    assert unfiltered["published"] == TEST_ERRORS["gaussian"][UNFILTERED][0]
    assert unfiltered["ours"] == pytest.approx(12.5, rel=4.0 / np.sqrt(2 * 28 * 210) + 0.01)


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

    np.testing.assert_allclose(
        moving_average(values, 7),
        expected,
        rtol=0.0,
        atol=1e-9,
    )


def test_particles_equal_the_kalman_filter_with_normal_errors():
    generator = np.random.default_rng(3)
    particles = 20_000
    times = np.cumsum(generator.uniform(0.5, 1.5, 25))
    truth = times[:, None, None] * generator.normal(0.0, 20.0, (1, 6, 2))
    measured = truth + generator.normal(0.0, 5.0, truth.shape)
    measured[7] = np.nan
    motion = MotionModel("CV", axes=2, noise=4.0)
    # With so many degrees of freedom, Student's t is normal.
    filters = (
        KalmanFilter(motion, 25.0, (20.0,)),
        ParticleFilter(
            motion,
            5.0,
            (20.0,),
            1e6,
            particles,
        ),
    )
    exact, ours = (run_filter(each, measured, times) for each in filters)
    variances, spread = (
        np.diagonal(each.covariances, axis1=-2, axis2=-1) for each in (exact, ours)
    )

    error = (ours.states - exact.states) / np.sqrt(variances)
    assert np.abs(error[1:]).max() < 20.0 / np.sqrt(particles)
    assert np.abs(spread / variances - 1.0).max() < 0.2
    difference = ours.log_likelihoods - exact.log_likelihoods
    assert np.abs(difference)[1:].max() < 0.15


def test_a_tuning_that_is_killed_ends_with_the_same_parameters(tmp_path):
    scans, _ = scan_flights(model.point_mass_flights(4, 0), 0)
    training = {"gaussian": measure(scans, "gaussian", (0, 2))}
    whole, _, parts = (
        tuning.tune(
            "KF CV",
            "gaussian",
            training,
            trials,
            7,
            tmp_path / name,
        )
        for trials, name in ((12, "whole"), (5, "parts"), (12, "parts"))
    )

    assert parts == whole


@pytest.mark.study
def test_the_published_pattern(tmp_path):
    cells = reproduce(folder=tmp_path, jobs=os.cpu_count() or 1).cells
    ours = cells.set_index(["table", "row", "column"]).ours
    for noise, table in TABLES.items():
        unfiltered = ours[table, UNFILTERED].tolist()
        assert unfiltered == pytest.approx(TEST_ERRORS[noise][UNFILTERED], rel=0.034)
        position, _, velocity, _ = (ours[table, :, metric] for metric in METRICS)
        assert position["KF CA"] < position["KF CJ"]
        assert velocity["g-h"] < velocity["KF CA"] < velocity["KF CJ"]


def test_the_g_h_filter_starts_with_two_points_and_anew_after_a_gap():
    measurements = np.array([np.nan, 2.0, np.nan, 8.0, 11.0, np.nan, 50.0, 54.0, 54.5])[:, None]
    times = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 9.0, 9.0]
    gh = GHFilter(
        1,
        0.5,
        0.25,
        longest_gap=3.5,
    )
    # By hand: two points 2 s apart, a prediction, a gap of 4 s, a second sensor at the same time.
    expected = [[2.0, 0.0], [2.0, 0.0], [8.0, 3.0], [11.0, 3.0], [14.0, 3.0], [50.0, 0.0]]
    states = run_filter(gh, measurements, times).states

    assert np.isnan(states[0]).all()
    np.testing.assert_allclose(states[1:], [*expected, [54.0, 4.0], [54.25, 4.0]])


def test_a_wide_kernel_gives_the_kalman_filter_and_a_narrow_one_ignores_outliers():
    innovation = np.array([0.5, -3.0, 80.0])
    predicted, variance = np.array([1.0, 4.0, 2.0]), np.full(3, 2.0)
    gain, _, log_likelihood = Correntropy(1e5).factors(innovation, predicted, variance)
    total = predicted + variance
    np.testing.assert_allclose(gain, 1.0 / total, rtol=1e-6)
    np.testing.assert_allclose(log_likelihood, norm.logpdf(innovation, scale=np.sqrt(total)))

    assert abs(Correntropy(2.0).factors(innovation, predicted, variance)[0][2]) < 1e-5
