"""A recurrent network that corrects and forecasts the positions of a radar track, trained on
those of the data set.

It is a filter with learned gains: the state is predicted with the last velocity and acceleration,
and a gated recurrent unit reads the innovation in the frame of the heading and gives the gains, the
acceleration, and the forecasts with their deviations.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from scipy.stats import chi2
from torch import Tensor, nn

from hybrid_env import ArgumentError
from studies.radar.dataset import HORIZONS, REGION, RadarData, truth_ahead
from studies.radar.filters import Estimated
from studies.radar.radars import NOISES, SIGMA, draw_noise

FloatArray = NDArray[np.float64]

UPDATES = 600
LEARNING_RATE = 6e-3
HELD_OUT = 8
"""Last training flights, on which the deviations of the forecasts are scaled."""

# [m/s], of the errors of the loss.
VELOCITY_SCALE = 4.0
# [m]
POSITION_SCALE = 6.0
HIDDEN = 48
INPUTS = 10
# The largest of the state [m/s^2].
ACCELERATION = 25.0
# Time for which the acceleration is assumed to last [s].
LONGEST = 1.0
OUTPUTS = 9 + 6 * len(HORIZONS)


class RadarNet(nn.Module):
    """The network; `log_scale` (H,) corrects the logarithms of the stated deviations."""

    log_scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.cell = nn.GRUCell(INPUTS, HIDDEN)
        self.output = nn.Linear(HIDDEN, OUTPUTS)
        self.register_buffer("log_scale", torch.zeros(len(HORIZONS)))

    def forward(
        self,
        measurements: Tensor,
        times: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the estimates after every measurement, (T, B, 3) [m], NaN where a track has
        ended, at times [s].

        They are positions (T, B, 3) [m], velocities (T, B, 3) [m/s], forecast positions (T, B, H,
        3) [m] and their covariances (T, B, H, 3, 3) [m^2].
        """
        tracks = measurements.shape[1]
        position = measurements[0]
        velocity = torch.zeros(tracks, 3)
        acceleration = torch.zeros(tracks, 3)
        memory = torch.zeros(tracks, HIDDEN)
        before = times[0]
        found = []
        for k, (measured, now) in enumerate(
            zip(torch.nan_to_num(measurements), times, strict=True)
        ):
            step = (now - before)[:, None]
            lasting = step.clamp(max=LONGEST)
            position = position + velocity * step + 0.5 * acceleration * lasting**2
            velocity = velocity + acceleration * lasting
            frame = _frame(velocity, measured - position)
            # In the frame of the heading.
            innovation = _turned(frame, measured - position)
            inputs = [
                torch.asinh(innovation / SIGMA),
                _turned(frame, acceleration) / ACCELERATION,
                step.log1p(),
                velocity.norm(dim=-1, keepdim=True) / 50.0,
                velocity[:, 2:] / 10.0,
                torch.full_like(step, float(k)).log1p(),
            ]
            memory = self.cell(torch.cat(inputs, dim=-1), memory)
            out = self.output(memory)
            gain = out[:, :3].sigmoid()
            rate = out[:, 3:6].sigmoid()
            back = frame.transpose(1, 2)
            position = position + _turned(back, gain * innovation)
            change = rate * innovation / step.clamp(min=0.4)
            velocity = velocity + _turned(back, change)
            # Before, the track has no heading.
            if k > 0:
                acceleration = _turned(back, ACCELERATION * out[:, 6:9].tanh())
            ahead, deviation = out[:, 9:].unflatten(-1, (2, len(HORIZONS), 3)).unbind(1)
            forecast = self._forecast(
                position,
                velocity,
                back,
                ahead,
                deviation,
            )
            found.append((position, velocity, *forecast))
            before = now
        first, second, third, fourth = map(torch.stack, zip(*found, strict=True))
        return first, second, third, fourth

    def _forecast(
        self,
        position: Tensor,
        velocity: Tensor,
        back: Tensor,
        ahead: Tensor,
        deviation: Tensor,
    ) -> tuple[Tensor, Tensor]:
        """Return positions (B, H, 3) and their covariances (B, H, 3, 3)."""
        horizons = torch.tensor(HORIZONS)[:, None]
        bent = 0.5 * ACCELERATION * horizons**2 * ahead.tanh()
        moved = position[:, None] + velocity[:, None] * horizons + bent @ back.transpose(1, 2)
        logarithms = deviation.clamp(-4.0, 4.0) + self.log_scale[:, None]
        scale = SIGMA * (0.5 + horizons) * logarithms.exp()
        root = back[:, None] * scale[:, :, None]
        return moved, root @ root.transpose(-1, -2)


def _turned(frame: Tensor, vectors: Tensor) -> Tensor:
    """Return vectors (B, 3) in a frame (B, 3, 3)."""
    return (frame @ vectors[..., None])[..., 0]


def _frame(velocity: Tensor, innovation: Tensor) -> Tensor:
    """Return rows along the horizontal heading, else along the innovation, across and up, (B, 3,
    3).
    """
    moving = torch.hypot(velocity[:, 0], velocity[:, 1]) > 1.0
    x, y = torch.where(moving[:, None], velocity, innovation)[:, :2].unbind(1)
    length = torch.hypot(x, y)
    zero_length = length == 0.0
    safe = torch.where(zero_length, 1.0, length)
    cosine = torch.where(zero_length, 1.0, x / safe)
    sine = y / safe
    zero = torch.zeros_like(x)
    unit = torch.ones_like(x)
    rows = [
        cosine,
        sine,
        zero,
        -sine,
        cosine,
        zero,
        zero,
        zero,
        unit,
    ]
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


@torch.no_grad()
def filter_with(
    net: RadarNet,
    measurements: FloatArray,
    times: FloatArray,
) -> Estimated:
    """Return the estimates of tracks with forecasts at `HORIZONS`; measurements (K, N, 3) [m],
    times (K, N) [s].
    """
    given = (torch.from_numpy(array).float() for array in (measurements, times))
    positions, velocities, forecasts, covariances = (
        values.double().numpy() for values in net(*given)
    )
    ahead = [(forecasts[:, :, h], covariances[:, :, h]) for h in range(len(HORIZONS))]
    return Estimated(positions, velocities, tuple(ahead))


def radar_net(
    data: RadarData,
    file: Path,
    on_progress: Callable[[int], None],
    updates: int = UPDATES,
) -> RadarNet:
    """Return the network of a file, or train it with a number of updates and write the file.

    It is trained on the training flights, turned about the vertical at random, half of them
    mirrored, with noise drawn anew in every update; training begins anew if it is interrupted.
    `on_progress` gets the number of finished updates.
    """
    torch.set_num_threads(1)
    torch.manual_seed(data.seed)
    net = RadarNet()
    if file.exists():
        try:
            net.load_state_dict(load_file(file))
        except (SafetensorError, RuntimeError) as error:
            raise ArgumentError(f"{file} cannot be loaded: {error}"[:200]) from None
        return net
    tracks, flights = data.tracks["training"]["gaussian"], data.flights_of("training")
    ahead = np.stack([truth_ahead(flights, tracks, h) for h in HORIZONS], axis=2)
    states = np.stack([tracks.positions, tracks.velocities], axis=2)
    truth = np.concatenate([states, ahead], axis=2)
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
        on_progress(update + 1)
    _scale(net, data, ahead)
    part = file.with_suffix(".part")
    save_file(net.state_dict(), part)
    part.replace(file)
    return net


def _augmented(
    truth: FloatArray,
    times: FloatArray,
    generator: np.random.Generator,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return true values (K, n, 2 + H, 3), measurements (K, n, 3) and times (K, n), n = 2 N:
    both noises.
    """
    both = np.concatenate([truth, truth])
    angle = generator.uniform(
        0.0,
        2.0 * math.pi,
        len(both),
    )
    cosine = np.cos(angle)
    sine = np.sin(angle)
    mirror = generator.choice([-1.0, 1.0], len(both))
    turn = np.zeros((len(both), 1, 3, 3))
    turn[:, 0, 0, 0] = cosine
    turn[:, 0, 0, 1] = -sine * mirror
    turn[:, 0, 1, 0] = sine
    turn[:, 0, 1, 1] = cosine * mirror
    turn[:, 0, 2, 2] = 1.0
    # Positions relative to the first one are small.
    origin = both[:, :1, :1].copy()
    both[:, :, [0, *range(2, both.shape[2])]] -= origin
    both = both @ turn.swapaxes(-1, -2)
    count = len(truth) * truth.shape[1]
    errors = [draw_noise(noise, count, generator) for noise in NOISES]
    measured = both[:, :, 0] + np.concatenate(errors).reshape(*both.shape[:2], 3)
    return (
        _by_tick(both),
        _by_tick(measured),
        _by_tick(np.concatenate([times, times])),
    )


def _by_tick(values: FloatArray) -> Tensor:
    return torch.from_numpy(np.swapaxes(values, 0, 1)).float()


def _loss(
    net: RadarNet,
    truth: Tensor,
    measured: Tensor,
    times: Tensor,
) -> Tensor:
    """Return the mean robust error of positions and velocities, and the negative log-density of
    forecasts.
    """
    positions, velocities, forecasts, covariances = net(measured, times)
    total = torch.zeros(())
    for found, scale, k in (
        (positions, POSITION_SCALE, 0),
        (velocities, VELOCITY_SCALE, 1),
    ):
        error = (found - truth[:, :, k]) / scale
        total = total + error[error.isfinite()].square().add(1.0).sqrt().mean()
    error = truth[:, :, 2:] - forecasts
    counts = error.isfinite().all(-1)
    factor = torch.linalg.cholesky(covariances[counts])
    white = torch.linalg.solve_triangular(
        factor,
        error[counts][..., None],
        upper=False,
    )[..., 0]
    log_determinant = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
    return total + 0.2 * (0.5 * white.square().sum(-1) + log_determinant).mean()


def _scale(
    net: RadarNet,
    data: RadarData,
    ahead: FloatArray,
) -> None:
    """Scale the deviations so that the regions hold the true positions of the held-out flights."""
    for h in range(len(HORIZONS)):
        squares = []
        for noise in NOISES:
            tracks = data.tracks["training"][noise]
            found = filter_with(
                net,
                tracks.measurements[-HELD_OUT:].swapaxes(0, 1),
                tracks.times[-HELD_OUT:].T,
            )
            positions, covariances = found.forecasts[h]
            assert covariances is not None
            error = ahead[-HELD_OUT:, :, h].swapaxes(0, 1) - positions
            counts = ~np.isnan(error[..., 0])
            error = error[counts]
            white = np.linalg.solve(covariances[counts], error[..., None])[..., 0]
            squares.append((error * white).sum(-1))
        ratio = np.quantile(np.concatenate(squares), REGION) / chi2.ppf(REGION, 3)
        net.log_scale[h] = 0.5 * math.log(ratio)
