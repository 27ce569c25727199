"""A recurrent network that corrects and forecasts the positions of a radar track, trained on
those of the data set.

It is a filter with learned gains: the state is predicted with the last velocity and acceleration,
and a gated recurrent unit reads the innovation in the frame of the heading and gives the gains, the
acceleration, and the forecasts with their deviations.
"""

import math
from pathlib import Path

import numpy as np
import torch
from rich.progress import track
from safetensors.torch import load_file, save_file
from scipy.stats import chi2
from torch import Tensor, nn

from studies.radar.dataset import HORIZONS, REGION, RadarData, squared_distances, truth_ahead
from studies.radar.filters import Estimated
from studies.radar.flights import FloatArray
from studies.radar.radars import NOISES, SIGMA, draw_noise

UPDATES = 600
# Last training flights, on which the deviations of the forecasts are scaled.
HELD_OUT = 8
# The largest of the state [m/s^2].
ACCELERATION = 25.0


class RadarNet(nn.Module):
    """The network; `log_scale` (H,) corrects the logarithms of the stated deviations."""

    log_scale: Tensor

    def __init__(self, hidden: int = 48) -> None:
        super().__init__()
        self.cell = nn.GRUCell(10, hidden)
        self.output = nn.Linear(hidden, 9 + 6 * len(HORIZONS))
        self.register_buffer("log_scale", torch.zeros(len(HORIZONS)))

    def forward(self, measurements: Tensor, times: Tensor) -> tuple[Tensor, ...]:
        """Return the estimates after every measurement, (T, B, 3) [m], NaN where a track has
        ended, at times [s].

        They are positions (T, B, 3) [m], velocities (T, B, 3) [m/s], forecast positions (T, B, H,
        3) [m] and their covariances (T, B, H, 3, 3) [m^2].
        """
        position = measurements[0]
        velocity = acceleration = torch.zeros_like(position)
        memory = torch.zeros(len(position), self.cell.hidden_size)
        estimates = []
        steps = torch.diff(times, dim=0, prepend=times[:1])
        for k, measured in enumerate(torch.nan_to_num(measurements)):
            step = steps[k, :, None]
            # Time for which the acceleration is assumed to last [s].
            lasting = step.clamp(max=1.0)
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
            forecast = self._forecast(position, velocity, back, ahead, deviation)
            estimates.append((position, velocity, *forecast))
        return tuple(map(torch.stack, zip(*estimates, strict=True)))

    def _forecast(
        self, position: Tensor, velocity: Tensor, back: Tensor, ahead: Tensor, deviation: Tensor
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
    # Without a direction, that of x.
    x = torch.where((x == 0.0) & (y == 0.0), 1.0, x)
    length = torch.hypot(x, y)
    cosine, sine = x / length, y / length
    frame = torch.eye(3).repeat(len(x), 1, 1)
    frame[:, 0, 0] = frame[:, 1, 1] = cosine
    frame[:, 0, 1], frame[:, 1, 0] = sine, -sine
    return frame


@torch.no_grad()
def filter_with(net: RadarNet, measurements: FloatArray, times: FloatArray) -> Estimated:
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
    data: RadarData, file: Path, updates: int = UPDATES, learning_rate: float = 6e-3
) -> RadarNet:
    """Return the network of a file, or train it with a number of updates and write the file.

    It is trained on the training flights, turned about the vertical at random, half of them
    mirrored, with noise drawn anew in every update; training begins anew if it is interrupted.
    """
    torch.set_num_threads(1)
    torch.manual_seed(data.seed)
    net = RadarNet()
    if file.exists():
        net.load_state_dict(load_file(file))
        return net
    tracks, flights = data.tracks["training"]["gaussian"], data.flights["training"]
    ahead = np.stack([truth_ahead(flights, tracks, h) for h in HORIZONS], axis=2)
    states = np.stack([tracks.positions, tracks.velocities], axis=2)
    truth = np.concatenate([states, ahead], axis=2).swapaxes(0, 1)[:-HELD_OUT]
    times = tracks.times[:, :-HELD_OUT]
    generator = np.random.default_rng((data.seed, 4))
    optimizer = torch.optim.Adam(net.parameters(), learning_rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, learning_rate, updates)
    for _ in track(range(updates), "recurrent network"):
        loss = _loss(net, *_augmented(truth, times, generator))
        optimizer.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(net.parameters(), 1.0)
        optimizer.step()
        schedule.step()
    _scale(net, data, ahead[:, -HELD_OUT:])
    part = file.with_suffix(".part")
    save_file(net.state_dict(), part)
    part.replace(file)
    return net


def _augmented(
    truth: FloatArray, times: FloatArray, generator: np.random.Generator
) -> list[Tensor]:
    """Return true values (K, 2 N, 2 + H, 3), measurements (K, 2 N, 3) with both noises and times
    (K, 2 N), of true values (N, K, 2 + H, 3) at times (K, N).
    """
    both = np.concatenate([truth, truth])
    angle = generator.uniform(0.0, 2.0 * math.pi, len(both))
    cosine, sine = np.cos(angle), np.sin(angle)
    mirror = generator.choice([-1.0, 1.0], len(both))
    turn = np.zeros((len(both), 1, 3, 3))
    rows = [[cosine, -sine * mirror], [sine, cosine * mirror]]
    turn[:, 0, :2, :2] = np.moveaxis(np.array(rows), -1, 0)
    turn[:, 0, 2, 2] = 1.0
    # Positions relative to the first one are small.
    origin = both[:, :1, :1].copy()
    both[:, :, [0, *range(2, both.shape[2])]] -= origin
    both = both @ turn.mT
    count = len(truth) * truth.shape[1]
    errors = [draw_noise(noise, count, generator) for noise in NOISES]
    measured = both[:, :, 0] + np.concatenate(errors).reshape(*both.shape[:2], 3)
    by_tick = both.swapaxes(0, 1), measured.swapaxes(0, 1), np.tile(times, 2)
    return [torch.from_numpy(values).float() for values in by_tick]


def _loss(net: RadarNet, truth: Tensor, measured: Tensor, times: Tensor) -> Tensor:
    """Return the mean robust error of positions and velocities, in units of 6 m and 4 m/s, and the
    negative log-density of forecasts.
    """
    positions, velocities, forecasts, covariances = net(measured, times)
    total = torch.zeros(())
    for estimated, scale, k in ((positions, 6.0, 0), (velocities, 4.0, 1)):
        error = (estimated - truth[:, :, k]) / scale
        total = total + error[error.isfinite()].square().add(1.0).sqrt().mean()
    error = truth[:, :, 2:] - forecasts
    counts = error.isfinite().all(-1)
    factor = torch.linalg.cholesky(covariances[counts])
    white = torch.linalg.solve_triangular(factor, error[counts][..., None], upper=False)[..., 0]
    log_determinant = factor.diagonal(dim1=-2, dim2=-1).log().sum(-1)
    return total + 0.2 * (0.5 * white.square().sum(-1) + log_determinant).mean()


def _scale(net: RadarNet, data: RadarData, ahead: FloatArray) -> None:
    """Scale the deviations so that the regions hold the true positions (K, n, H, 3) of the held-out
    flights.
    """
    filtered = [
        filter_with(net, tracks.measurements[:, -HELD_OUT:], tracks.times[:, -HELD_OUT:])
        for tracks in data.tracks["training"].values()
    ]
    for h in range(len(HORIZONS)):
        squares = []
        for estimated in filtered:
            positions, covariances = estimated.forecasts[h]
            assert covariances is not None
            squares.append(squared_distances(ahead[:, :, h] - positions, covariances))
        ratio = np.nanquantile(squares, REGION) / chi2.ppf(REGION, 3)
        net.log_scale[h] = 0.5 * np.log(ratio)
