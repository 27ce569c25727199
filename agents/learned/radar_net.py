"""A recurrent network that corrects and forecasts the positions of a radar track.

It is a filter with learned gains: the state is predicted with the last velocity and acceleration, and a gated
recurrent unit reads the innovation in the frame of the heading and gives the gains, the acceleration, and the
forecasts with their deviations.
"""

import numpy as np
import torch
from torch import Tensor, nn

from baselines.estimation.run_filter import Estimates, Filtered
from baselines.papers.novospaskyi.radars import SIGMA
from baselines.papers.novospaskyi.scores import HORIZONS
from hybrid_env.checks import FloatArray

HIDDEN = 48
INPUTS = 10
ACCELERATION = 25.0  # the largest of the state [m/s^2]
LONGEST = 1.0  # time for which the acceleration is assumed to last [s]
OUTPUTS = 9 + 6 * len(HORIZONS)


class RadarNet(nn.Module):
    """The network.

    Attributes:
        log_scale: (H,) correction of the logarithms of the stated deviations.
    """

    log_scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.cell = nn.GRUCell(INPUTS, HIDDEN)
        self.output = nn.Linear(HIDDEN, OUTPUTS)
        self.register_buffer("log_scale", torch.zeros(len(HORIZONS)))

    def forward(self, measurements: Tensor, times: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the estimates after every measurement.

        Args:
            measurements: (T, B, 3) [m], NaN where a track has ended; its first one is there.
            times: (T, B) [s].

        Returns:
            Positions (T, B, 3) [m], velocities (T, B, 3) [m/s], forecast positions (T, B, H, 3) [m] and their
            covariances (T, B, H, 3, 3) [m^2].
        """
        tracks = measurements.shape[1]
        position, velocity = measurements[0], torch.zeros(tracks, 3)
        acceleration, memory = torch.zeros(tracks, 3), torch.zeros(tracks, HIDDEN)
        before, found = times[0], []
        for k, (measured, now) in enumerate(zip(torch.nan_to_num(measurements), times, strict=True)):
            step = (now - before)[:, None]
            lasting = step.clamp(max=LONGEST)
            position = position + velocity * step + 0.5 * acceleration * lasting**2
            velocity = velocity + acceleration * lasting
            frame = _frame(velocity, measured - position)
            innovation = (frame @ (measured - position)[..., None])[..., 0]
            speed = velocity.norm(dim=-1, keepdim=True)
            age = torch.full_like(step, float(k)).log1p()
            inputs = [torch.asinh(innovation / SIGMA), acceleration_in(frame, acceleration), step.log1p()]
            inputs += [speed / 50.0, velocity[:, 2:] / 10.0, age]
            memory = self.cell(torch.cat(inputs, dim=-1), memory)
            out = self.output(memory)
            gain, rate = out[:, :3].sigmoid(), out[:, 3:6].sigmoid()
            back = frame.transpose(1, 2)
            position = position + (back @ (gain * innovation)[..., None])[..., 0]
            velocity = velocity + (back @ (rate * innovation / step.clamp(min=0.4))[..., None])[..., 0]
            if k > 0:  # before, the track has no heading
                acceleration = (back @ (ACCELERATION * out[:, 6:9].tanh())[..., None])[..., 0]
            ahead, deviation = out[:, 9:].unflatten(-1, (2, len(HORIZONS), 3)).unbind(1)
            found.append((position, velocity, *self._forecast(position, velocity, back, ahead, deviation)))
            before = now
        first, second, third, fourth = zip(*found, strict=True)
        return torch.stack(first), torch.stack(second), torch.stack(third), torch.stack(fourth)

    def _forecast(
        self, position: Tensor, velocity: Tensor, back: Tensor, ahead: Tensor, deviation: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return positions (B, H, 3) and their covariances (B, H, 3, 3)."""
        horizons = torch.tensor(HORIZONS)[:, None]
        bent = 0.5 * ACCELERATION * horizons**2 * ahead.tanh()
        moved = position[:, None] + velocity[:, None] * horizons + bent @ back.transpose(1, 2)
        scale = SIGMA * (0.5 + horizons) * (deviation.clamp(-4.0, 4.0) + self.log_scale[:, None]).exp()
        root = back[:, None] * scale[:, :, None]
        return moved, root @ root.transpose(-1, -2)


def acceleration_in(frame: Tensor, acceleration: Tensor) -> Tensor:
    """Return accelerations (B, 3) in the frame (B, 3, 3), relative to the largest."""
    return (frame @ acceleration[..., None])[..., 0] / ACCELERATION


def _frame(velocity: Tensor, innovation: Tensor) -> Tensor:
    """Return rows along the horizontal heading, else along the innovation, across and up, (B, 3, 3)."""
    moving = torch.hypot(velocity[:, 0], velocity[:, 1]) > 1.0
    x, y = torch.where(moving[:, None], velocity, innovation)[:, :2].unbind(1)
    length = torch.hypot(x, y)
    zero_length = length == 0.0
    safe = torch.where(zero_length, 1.0, length)
    cosine, sine = torch.where(zero_length, 1.0, x / safe), y / safe
    zero, one = torch.zeros_like(x), torch.ones_like(x)
    rows = [cosine, sine, zero, -sine, cosine, zero, zero, zero, one]
    return torch.stack(rows, dim=-1).unflatten(-1, (3, 3))


@torch.no_grad()
def filter_with(net: RadarNet, measurements: FloatArray, times: FloatArray) -> Filtered:
    """Return the estimates of tracks with forecasts at `HORIZONS`, as `run_filter` does.

    Args:
        net: trained.
        measurements: (K, N, 3) [m].
        times: (K, N) [s].
    """
    first = torch.from_numpy(measurements).float()
    positions, velocities, forecasts, covariances = net(first, torch.from_numpy(times).float())
    ticks, tracks = times.shape
    nothing = np.full((ticks, tracks), np.nan)
    ahead = []
    for h in range(len(HORIZONS)):
        matrix = torch.zeros(ticks, tracks, 6, 6)
        matrix[..., ::2, ::2] = covariances[:, :, h]
        ahead.append(Estimates(_states(forecasts[:, :, h], velocities), matrix.double().numpy(), 2))
    return Filtered(_states(positions, velocities), None, 2, nothing, nothing, tuple(ahead))


def _states(positions: Tensor, velocities: Tensor) -> FloatArray:
    return np.asarray(torch.stack([positions, velocities], dim=-1).flatten(-2).numpy(), np.float64)
