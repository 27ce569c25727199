"""The radar study: its quick forms, flights, noise, filters and tuning."""

import json
import os

import numpy as np
import pandas as pd
import pytest
import torch

from agents import run_command
from baselines import KalmanFilter, MotionModel, run_filter
from studies.radar import flights as model
from studies.radar import radars, tuning
from studies.radar.__main__ import Radar
from studies.radar.dataset import load_radar_data, write_radar_data
from studies.radar.filters import moving_average
from studies.radar.network import RadarNet, filter_with
from studies.radar.particles import ParticleFilter
from studies.radar.radars import draw_noise, measure, scan_flights
from studies.radar.thesis import METRICS, TABLES, TEST_ERRORS, UNFILTERED, reproduce

pytest.importorskip("pyarrow")


@pytest.mark.parametrize("part", ["scores", "thesis"])
def test_the_quick_form_prints_its_tables(part, tmp_path, capsys):
    arguments = [part, "--quick", "--jobs", "1", "--out", str(tmp_path)]
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
    contents = []
    for name in ("first", "again"):
        folder = tmp_path / name
        folder.mkdir()
        write_radar_data(folder, seed=3, flights=34)
        contents.append({file.name: file.read_bytes() for file in folder.iterdir()})

    assert contents[0] == contents[1]
    data = load_radar_data(folder)
    assert [len(flown) for flown in data.flights.values()] == [10, 24]
    tracks = data.tracks["test"]["gaussian"]
    error = (tracks.measurements - tracks.positions)[~np.isnan(tracks.positions)]
    assert error.std() == pytest.approx(radars.SIGMA, rel=4.0 / np.sqrt(2 * error.size))


def test_flights_have_the_speed_of_the_thesis_and_respect_the_limits():
    flights = model.point_mass_flights(12, 0)
    speeds = [np.linalg.norm(flight.velocities, axis=1).mean() for flight in flights]
    assert np.mean(speeds) == pytest.approx(50.0, abs=1.0)
    for flight in flights:
        change = np.diff(flight.velocities, axis=0) / model.RECORD_STEP
        thrust = change + np.array([0.0, 0.0, model.GRAVITY]) - model.drag(flight.velocities[:-1])
        assert np.linalg.norm(thrust, axis=1).max() < 1.01 * model.LARGEST_FORCE


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


def test_particles_equal_the_kalman_filter_with_normal_errors():
    generator = np.random.default_rng(3)
    particles = 20_000
    times = np.cumsum(generator.uniform(0.5, 1.5, 25))
    truth = times[:, None, None] * generator.normal(0.0, 20.0, (1, 6, 2))
    measured = truth + generator.normal(0.0, 5.0, truth.shape)
    measured[7] = np.nan
    motion = MotionModel("CV", axes=2, noise=4.0)
    # With so many degrees of freedom, Student's t is normal.
    cloud = ParticleFilter(motion, 5.0, (20.0,), 1e6, particles)
    expected, estimated = (
        run_filter(kind, measured, times) for kind in (KalmanFilter(motion, 25.0, (20.0,)), cloud)
    )
    variances, ours = (
        np.diagonal(each.covariances, axis1=-2, axis2=-1) for each in (expected, estimated)
    )
    error = (estimated.states - expected.states) / np.sqrt(variances)

    assert np.abs(error[1:]).max() < 20.0 / np.sqrt(particles)
    assert np.abs(ours / variances - 1.0).max() < 0.2
    difference = estimated.log_likelihoods - expected.log_likelihoods
    assert np.abs(difference)[1:].max() < 0.15


def test_a_turn_about_the_vertical_turns_the_estimates_of_the_network():
    torch.manual_seed(0)
    net = RadarNet()
    times = np.cumsum(np.full((12, 2), 0.5), axis=0)
    noise = np.random.default_rng(0).normal(0.0, 5.0, (12, 2, 3))
    path = 40.0 * times[..., None] * np.array([0.6, 0.8, 0.1]) + noise
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    plain, turned = (filter_with(net, flown, times) for flown in (path, path @ turn.T))

    np.testing.assert_allclose(turned.positions, plain.positions @ turn.T, atol=1e-2)
    np.testing.assert_allclose(turned.velocities, plain.velocities @ turn.T, atol=1e-2)


def test_a_tuning_that_is_killed_ends_with_the_same_parameters(tmp_path):
    scans, _ = scan_flights(model.point_mass_flights(4, 0), 0)
    training = {"gaussian": measure(scans, "gaussian", (0, 2))}
    whole, _, parts = (
        tuning.tune("KF CV", "gaussian", training, trials, 7, tmp_path / name)
        for trials, name in ((12, "whole"), (5, "parts"), (12, "parts"))
    )

    assert parts == whole


@pytest.mark.study
def test_the_published_pattern_and_the_better_filters(tmp_path):
    cells = reproduce(folder=tmp_path, jobs=os.cpu_count() or 1).cells
    ours = cells.set_index(["table", "row", "column"]).ours
    for noise, table in TABLES.items():
        unfiltered = ours[table, UNFILTERED].tolist()
        assert unfiltered == pytest.approx(TEST_ERRORS[noise][UNFILTERED], rel=0.034)
        position, _, velocity, _ = (ours[table, :, metric] for metric in METRICS)
        assert position["KF CA"] < position["KF CJ"]
        assert velocity["g-h"] < velocity["KF CA"] < velocity["KF CJ"]
    gaussian, levy = (
        ours[f"Sound settings, {name}", :, METRICS[0]] for name in radars.NOISE_NAMES.values()
    )
    assert gaussian["IMM (CV, CA)"] < gaussian["CV"] <= 0.75 * 12.5
    for name in ("CV, Huber", "CV, Student-t"):
        assert levy[name] <= 0.70 * levy["CV"]
        assert gaussian[name] <= 1.01 * gaussian["CV"]
