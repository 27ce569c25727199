"""Training of the recurrent network for radar tracks, on the training flights of the data set."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from agents.interface.output_files import atomic_file
from agents.learned.radar_net import RadarNet, filter_with
from baselines.papers.novospaskyi.dataset import RadarData
from baselines.papers.novospaskyi.radars import NOISES, draw_noise
from baselines.papers.novospaskyi.scores import HORIZONS, REGION, truth_ahead
from hybrid_env.checks import ArgumentError, FloatArray

UPDATES = 600
LEARNING_RATE = 6e-3
HELD_OUT = 8
"""Last training flights, on which the deviations of the forecasts are scaled."""

VELOCITY_SCALE = 4.0  # [m/s], of the errors of the loss
POSITION_SCALE = 6.0  # [m]


def radar_net(data: RadarData, file: Path, on_progress: Callable[[float], None], updates: int = UPDATES) -> RadarNet:
    """Return the network of a file, or train it and write the file.

    It is trained on the training flights, turned about the vertical at random, half of them mirrored, with
    noise drawn anew in every update; training begins anew if it is interrupted.

    Args:
        data: the data set.
        file: of the weights.
        on_progress: called with the finished share.
        updates: of the weights.

    Raises:
        ArgumentError: the file cannot be read or written.
    """
    torch.set_num_threads(1)
    torch.manual_seed(data.seed)
    net = RadarNet()
    if file.exists():
        try:
            net.load_state_dict(load_file(file))
        except Exception as error:
            raise ArgumentError(f"{file} cannot be loaded: {error}"[:200]) from None
        return net
    tracks, flights = data.tracks["training"]["gaussian"], data.flights_of("training")
    ahead = np.stack([truth_ahead(flights, tracks, h) for h in HORIZONS], axis=2)
    truth = np.concatenate([tracks.positions[:, :, None], tracks.velocities[:, :, None], ahead], axis=2)
    used = slice(len(flights) - HELD_OUT)
    generator = np.random.default_rng((data.seed, 4))
    optimizer = torch.optim.Adam(net.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, LEARNING_RATE, total_steps=updates)
    for update in range(updates):
        loss = _loss(net, *_augmented(truth[used], tracks.times[used], generator))
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        on_progress((update + 1) / updates)
    _scale(net, data, ahead)
    with atomic_file(file) as part:
        save_file(net.state_dict(), part)
    return net


def _augmented(truth: FloatArray, times: FloatArray, generator: np.random.Generator) -> tuple[Tensor, Tensor, Tensor]:
    """Return true values (K, n, 2 + H, 3), measurements (K, n, 3) and times (K, n), n = 2 N: both noises."""
    both = np.concatenate([truth, truth])
    angle = generator.uniform(0.0, 2.0 * math.pi, len(both))
    cosine, sine, mirror = np.cos(angle), np.sin(angle), generator.choice([-1.0, 1.0], len(both))
    turn = np.zeros((len(both), 1, 3, 3))
    turn[:, 0, 0, 0], turn[:, 0, 0, 1], turn[:, 0, 2, 2] = cosine, -sine * mirror, 1.0
    turn[:, 0, 1, 0], turn[:, 0, 1, 1] = sine, cosine * mirror
    origin = both[:, :1, :1].copy()  # positions relative to the first one are small
    both[:, :, [0, *range(2, both.shape[2])]] -= origin
    both = both @ turn.swapaxes(-1, -2)
    count = len(truth) * truth.shape[1]
    noise = np.concatenate([draw_noise(one, count, generator).reshape(*truth.shape[:2], 3) for one in NOISES])
    arrays = both, both[:, :, 0] + noise, np.concatenate([times, times])
    of_truth, measured, moments = (torch.from_numpy(np.swapaxes(one, 0, 1)).float() for one in arrays)
    return of_truth, measured, moments


def _loss(net: RadarNet, truth: Tensor, measured: Tensor, times: Tensor) -> Tensor:
    """Return the mean robust error of positions and velocities, and the negative log-density of forecasts."""
    positions, velocities, forecasts, covariances = net(measured, times)
    total = torch.zeros(())
    for found, scale, k in ((positions, POSITION_SCALE, 0), (velocities, VELOCITY_SCALE, 1)):
        error = (found - truth[:, :, k]) / scale
        total = total + error[error.isfinite()].square().add(1.0).sqrt().mean()
    error = truth[:, :, 2:] - forecasts
    counts = error.isfinite().all(-1)
    factor = torch.linalg.cholesky(covariances[counts])
    white = torch.linalg.solve_triangular(factor, error[counts][..., None], upper=False)[..., 0]
    log_determinant = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
    return total + 0.2 * (0.5 * white.square().sum(-1) + log_determinant).mean()


def _scale(net: RadarNet, data: RadarData, ahead: FloatArray) -> None:
    """Scale the deviations so that the regions hold the true positions of the held-out flights."""
    from scipy.stats import chi2

    for h in range(len(HORIZONS)):
        squares = []
        for noise in NOISES:
            tracks = data.tracks["training"][noise]
            found = filter_with(net, tracks.measurements[-HELD_OUT:].swapaxes(0, 1), tracks.times[-HELD_OUT:].T)
            forecast = found.forecasts[h]
            assert forecast.covariances is not None
            error = ahead[-HELD_OUT:, :, h].swapaxes(0, 1) - forecast.positions
            counts = ~np.isnan(error[..., 0])
            spread = forecast.covariances[counts][:, ::2, ::2]
            squares.append((error[counts] * np.linalg.solve(spread, error[counts][..., None])[..., 0]).sum(-1))
        ratio = np.quantile(np.concatenate(squares), REGION) / chi2.ppf(REGION, 3)
        net.log_scale[h] = 0.5 * math.log(ratio)
