"""What `baselines.smooth_modes` says of flights, as a rule that also reads the positions after the
one of which it states the mode.

It reads ticks of a second. A position is moved along its velocity to the nearest tick, and has the
covariance of its tier there; the last one of a tick counts. Modes and the law of their changes are
those of a filter. Errors are normal: with a Student t likelihood the histories lose an object that
moves as no mode does, as every position that is far from all of them is then an outlier.
"""

from dataclasses import dataclass

import numpy as np

from baselines import smooth_modes
from hybrid_env import QuickestOptions, Sensor
from studies.flights.labels import local_velocities
from studies.flights.rules import Settings, TurnRule, begun
from studies.flights.turns import Batch, IntArray, TurnEstimates, TurnModel

# Without a sensor positions have no covariances of their own; these are in units of its variance.
SENSOR = Sensor(variance=1.0)


@dataclass(frozen=True, kw_only=True)
class HindsightRule(TurnRule):
    """The modes of `baselines.smooth_modes`; a setting is its `process_share`."""

    grid: Settings = ((1.0,),)
    # Whether turns have the radii that belong to the turn rates at the median speed of a piece, or
    # the turn rates at any speed, as in a wind.
    radii: bool = True

    def statements(
        self, batch: Batch, estimates: TurnEstimates, settings: Settings, model: TurnModel
    ) -> IntArray:
        """See `TurnRule.statements`; the IMM is not read."""
        stated = begun(batch, settings)
        velocities = local_velocities(batch)
        noises = batch.noise(velocities)
        for piece, rows in enumerate(batch.present.T):
            passed = batch.times[rows, piece] - batch.times[0, piece]
            ticks = np.round(passed).astype(np.int64)
            velocity = velocities[rows, piece]
            moved = velocity * (ticks - passed)[:, None]
            # Positions, xx, xy, yy of their covariances, and no range rates.
            measured = np.full((ticks[-1] + 1, 9), np.nan)
            measured[ticks, :2] = batch.positions[rows, piece] + moved
            measured[ticks, 2:5] = noises[rows, piece].reshape(-1, 4)[:, [0, 1, 3]]
            # An object may rest.
            speed = max(float(np.median(np.hypot(*velocity.T))), 1.0)
            options = turn_options(model, speed, self.radii)
            decided = {
                share: smooth_modes(measured, options, process_share=share).modes[ticks]
                for (share,) in set(settings)
            }
            modes = np.stack([decided[share] for (share,) in settings], axis=1)
            stated[rows, piece] = model.modes[modes]
        return stated


def turn_options(model: TurnModel, speed: float, radii: bool) -> QuickestOptions:
    """Return the options, at ticks of a second, with the modes and the law of changes of a filter.

    Args:
        model: settings of the filter.
        speed: of the object [m/s].
        radii: see `HindsightRule`.
    """
    names = ["straight"]
    for rate in np.radians(model.rates[1:]).tolist():
        side = "left" if rate > 0.0 else "right"
        names.append(f"{side} {speed / abs(rate):.9g}" if radii else f"turn rate {rate:.9g}")
    # Rates at which a mode ends [1/s], and probabilities of the next one.
    ends = -np.diagonal(model.generator)
    order = model.generator / ends[:, None] + np.eye(len(ends))
    laws = [f"{name} geometric {1.0 / end:.6f}" for name, end in zip(names, ends, strict=True)]
    return QuickestOptions(
        modes=tuple(names),
        speed=speed,
        tau=1.0,
        process_variance=model.acceleration,
        measurement_variance=SENSOR.variance,
        sensors=(SENSOR,),
        durations=", ".join(laws),
        transitions=tuple(map(tuple, order.tolist())),
        start="random",
    )


HINDSIGHT = HindsightRule(models=(TurnModel(within=40.0),))
"""On flights of aircraft; the time between turn rates was chosen on simulated flights."""
