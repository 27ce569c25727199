"""The recurrent network for radar tracks."""

import numpy as np
import pytest
import torch

from studies.radar.dataset import (
    STATISTICS,
    load_radar_data,
    score_estimates,
    write_radar_data,
)
from studies.radar.network import RadarNet, filter_with, radar_net

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("radar")
    write_radar_data(folder, seed=3, flights=34)
    return load_radar_data(folder)


def test_training_reduces_the_error_and_is_kept(data, tmp_path):
    tracks = data.tracks["test"]["levy"]
    measured, times = tracks.measurements.swapaxes(0, 1), tracks.times.T
    torch.manual_seed(data.seed)
    file = tmp_path / "network.safetensors"
    nets = RadarNet(), radar_net(data, file, lambda update: None, updates=15)
    first, second = (
        score_estimates("net", filter_with(net, measured, times), data, "levy") for net in nets
    )
    ratio = second.ratio(first, STATISTICS["position"])

    assert ratio.high < 1.0
    again = filter_with(
        radar_net(data, file, lambda update: None),
        measured,
        times,
    )
    trained = filter_with(nets[1], measured, times)
    np.testing.assert_array_equal(again.positions, trained.positions)


def test_a_turn_about_the_vertical_turns_the_estimates():
    torch.manual_seed(0)
    generator = np.random.default_rng(0)
    net = RadarNet()
    times = np.cumsum(np.full((12, 2), 0.5), axis=0)
    path = 40.0 * times[..., None] * np.array([0.6, 0.8, 0.1]) + generator.normal(
        0.0,
        5.0,
        (12, 2, 3),
    )
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    found, turned = (filter_with(net, flown, times) for flown in (path, path @ turn.T))

    np.testing.assert_allclose(
        turned.positions,
        found.positions @ turn.T,
        atol=1e-2,
    )
    np.testing.assert_allclose(
        turned.velocities,
        found.velocities @ turn.T,
        atol=1e-2,
    )
    for (positions, covariances), (of_turned, _) in zip(
        found.forecasts,
        turned.forecasts,
        strict=True,
    ):
        np.testing.assert_allclose(of_turned[1:], positions[1:] @ turn.T, atol=0.1)
        assert np.linalg.eigvalsh(covariances).min() > 0.0
