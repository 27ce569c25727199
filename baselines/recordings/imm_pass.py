"""The interacting multiple model bank over recorded measurements, and the model that it assumes:
likelihood, normalised innovations and probabilities. The likelihood, ln p(z_k | z_1 .. z_k-1) of
the mixture over the modes, summed over the ticks, is what `model_fit` maximises. Chunks of a
recording of about equal length run side by side in the lanes of a block.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval

from baselines.recordings.ticks import TickGrid
from baselines.recordings.track_modes import in_units
from baselines.rules.hindsight import PROCESS_SHARE
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray, PositiveOrZero
from hybrid_env.compiled import (
    HEIGHT_FIELDS,
    LANES,
    MEASURED_FIELDS,
    DenseImmBank,
    FilterModel,
    ImmBank,
    aligned_zeros,
    bank_arrays,
    compiled,
    internal,
    lanes_of,
    operations,
    run_compiled,
)
from hybrid_env.durations import GeometricDurations
from hybrid_env.limits import MAX_LENGTH
from hybrid_env.modes import Mode, Stopping, modes_of_radii, motion_table
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.sensors import Radar, Sensor, sensor_table

# What `step_imm` reads and writes of a track.
PASS_BLOCK = lanes_of(
    **MEASURED_FIELDS, **HEIGHT_FIELDS, estimate=(float, 4), covariance=(float, 10)
)


# Of the units of a recording, which are any; squares and products do not overflow.
Found = Annotated[float, Interval(ge=1e-60, le=1e60)]
FoundOrZero = Annotated[float, Interval(ge=0.0, le=1e60)]


class Chunks(NamedTuple):
    """Parts of a recording, each in a lane of one of B blocks."""

    # (B, T, 2, LANES), NaN without a measurement and after the end of a chunk.
    measurements: FloatArray
    # (B, T, LANES) at the first tick after a known switch; all modes are then equally probable.
    switches: BoolArray
    # (B, T, 3, LANES) covariances xx, xy, yy of the measurements, over R.
    noises: FloatArray
    # (B, T, k, LANES) range rates of a radar at the origin, or velocities, NaN without one.
    rates: FloatArray
    # (B, 3, LANES) ticks of the two measurements that start a lane, and of the last one that does
    # not count; T without them.
    starts: IntArray
    # (1,) record `SENSOR` of what measures range rates or velocities, or none.
    sensors: AnyArray


class Pass(NamedTuple):
    """What the bank finds on chunks; NaN where there is none."""

    log_likelihood: float
    # (B, T, 2, LANES) innovations of the most probable mode, in their standard deviations, x and y.
    white: FloatArray
    # (B, T, M, LANES) of the modes.
    probabilities: FloatArray


@internal
def _begin(
    bank: Any, block: Any, lane: int, first: FloatArray, ticks: int, turn: float, model: FilterModel
) -> None:
    """Start the filters of a lane from two measurements some ticks apart, of which (2, LANES) is
    the first one. The variance of the velocity, that of the chord, has their noise, the process
    noise, and half of the change of direction in a turn.
    """
    time = ticks * model.tau
    for axis in range(2):
        now = block.measurement[axis, lane]
        block.estimate[2 * axis, lane] = now
        block.estimate[2 * axis + 1, lane] = (now - first[axis, lane]) / time
    speed = math.hypot(block.estimate[1, lane], block.estimate[3, lane])
    bend = speed * min(0.5 * ticks * turn * speed * model.tau, 1.0)
    for k in range(10):
        block.covariance[k, lane] = 0.0
    for axis in range(2):
        variance = model.variance_x * block.noise[2 * axis, lane]
        spread = 2.0 * variance / (time * time) + ticks * model.process_variance + bend * bend
        block.covariance[7 * axis, lane] = variance
        block.covariance[7 * axis + 1, lane] = variance / time
        block.covariance[5 * axis + 4, lane] = spread
    operations.begin_imm(bank, block, lane, -1)


@compiled
def imm_pass(
    chunks: Chunks,
    bank: Any,
    blocks: AnyArray,
    radii: FloatArray,
    model: FilterModel,
    white: FloatArray,
    probabilities: FloatArray,
) -> float:
    """Run the bank over all chunks; return the logarithm of the likelihood, and write innovations
    and probabilities as of `Pass`. The bank, of one block, and the record `PASS_BLOCK` (1,) are
    overwritten; no radii (n,) is a bank of straight motion.
    """
    total = 0.0
    block = blocks[0]
    turn = 1.0 / radii.min() if radii.size else 0.0
    for b in range(chunks.measurements.shape[0]):
        for k in range(chunks.measurements.shape[1]):
            # An assignment of arrays would take seconds to compile.
            for lane in range(LANES):
                for axis in range(2):
                    block.measurement[axis, lane] = chunks.measurements[b, k, axis, lane]
                for element in range(3):
                    block.noise[element, lane] = chunks.noises[b, k, element, lane]
                for row in range(chunks.rates.shape[2]):
                    block.rates[row, lane] = chunks.rates[b, k, row, lane]
                if k > chunks.starts[b, 1, lane] and chunks.switches[b, k, lane]:
                    operations.begin_imm(bank, block, lane, -1)
            # What lanes without a chunk hold is not used.
            first, last = np.uint64(0), np.uint64(LANES)
            operations.step_imm(bank, block, first, last, radii, chunks.sensors, model)
            for lane in range(LANES):
                second = chunks.starts[b, 1, lane]
                if k == second:
                    before = chunks.starts[b, 0, lane]
                    start = chunks.measurements[b, before]
                    _begin(bank, block, lane, start, second - before, turn, model)
                if k <= second:
                    continue
                measured = not math.isnan(block.measurement[0, lane])
                best = 0
                for h in range(bank.hypotheses.size):
                    value = bank.hypotheses[h].log_probability[lane]
                    probabilities[b, k, h, lane] = math.exp(value)
                    if value > bank.hypotheses[best].log_probability[lane]:
                        best = h
                if measured:
                    white[b, k, 0, lane] = bank.innovations[best].white_x[lane]
                    white[b, k, 1, lane] = bank.innovations[best].white_y[lane]
                if measured and k > chunks.starts[b, 2, lane]:
                    sums = bank.sums[0]
                    total += sums.largest[lane] - math.log(sums.inverse[lane])
    return total


def run_pass(chunks: Chunks, track: "TrackModel") -> Pass:
    """Run the bank of a model over chunks, in their units; without a variance of the velocities
    these are not used.
    """
    if (chunks.sensors["rates"] == 2).any():
        sensors = chunks.sensors[: int(track.velocity_variance > 0.0)].copy()
        sensors["deviations"] = math.sqrt(track.velocity_variance)
        chunks = chunks._replace(sensors=sensors)
    shape = chunks.measurements.shape[:2]
    modes = track.hypotheses
    blocks = aligned_zeros((1,), PASS_BLOCK)
    white, probabilities = (np.full((*shape, rows, LANES), np.nan) for rows in (2, modes))
    radii = np.array(track.radii, float)
    model = track.of_bank
    bank = bank_arrays(DenseImmBank if track.modes else ImmBank, len(radii), modes=modes)
    if track.modes:
        bank.motions[:] = motion_table(
            track.modes, 1.0, model.process_variance, model.drift_variance
        )
        stays = (model.stay_probability - model.switch_probability) * np.eye(modes)
        bank.transitions[:] = model.switch_probability + stays
    arguments = chunks, bank, blocks, radii, model, white, probabilities
    return Pass(run_compiled(imm_pass, *arguments), white, probabilities)


def grid_chunks(
    grid: TickGrid, scale: float, lengths: Sequence[int], longest: int, most: float = math.inf
) -> tuple[Chunks, list[tuple[int, int, int]]]:
    """Return chunks of a recording of at most about `longest` ticks, and piece, first tick and end
    of each; if they have more than `most` ticks, some of them, evenly spread. With lengths, ticks
    between known switches. Positions are in units of `scale`, times in ticks; the origin is the
    first measurement, or the radar.
    """
    # Every chunk forgets the velocity of the one before, and with it what it says about Q.
    length = max(min(longest, -(-grid.total // LANES)), 256)
    places = []
    for k, piece in enumerate(grid.pieces):
        number = max(round(len(piece.measurements) / length), 1)
        borders = np.linspace(0, len(piece.measurements), number + 1).astype(int).tolist()
        places += [(k, *borders_of) for borders_of in pairwise(borders)]
    wanted = max(most // length, LANES)
    if len(places) > wanted:
        kept = np.linspace(0, len(places) - 1, int(wanted)).round().astype(int)
        places = [places[k] for k in kept]
    places.sort(key=lambda place: place[2] - place[1])
    begins = np.zeros(grid.total, np.bool_)
    if lengths:
        begins[np.cumsum([0, *lengths[:-1]])] = True
    velocity = grid.tau / scale
    radar = None if grid.radar is None else grid.radar.scaled(1.0 / scale, velocity)
    # Its variances are those of the model.
    sensors: list[Sensor | Radar] = []
    if grid.velocities:
        sensors = [Sensor(variance=1.0, velocity_variance=1.0)]
    blocks = -(-len(places) // LANES)
    shape = blocks * LANES, max(end - first for _, first, end in places)
    values = np.full((*shape, 2), np.nan)
    rates = np.full((*shape, grid.pieces[0].rates.shape[1]), np.nan)
    switches = np.zeros(shape, np.bool_)
    for k, (index, first, end) in enumerate(places):
        part = grid.pieces[index].measurements[first:end]
        origin = part[(~np.isnan(part[:, 0])).argmax()]
        if grid.radar is not None:
            origin = np.array(grid.radar.position)
        values[k, : end - first] = (part - origin) / scale
        rates[k, : end - first] = grid.pieces[index].rates[first:end] * velocity
        # Of a recording without gaps.
        switches[k, : end - first] = begins[first:end]
    measured = ~np.isnan(values[..., 0])
    noises = np.tile([1.0, 0.0, 1.0], (*shape, 1))
    if radar is not None:
        sensors = [radar]
        noises[measured] = [radar.noise(x, y) for x, y in values[measured].tolist()]
    # Of each lane, up to a tick. Three measurements after the two that start it do not count: they
    # depend on how the velocity was found.
    seen = measured.cumsum(1)
    starts = np.stack([(seen < count).sum(1) for count in (1, 2, 5)], axis=1)

    def by_lane(array: Any) -> Any:
        lanes = array.reshape(blocks, LANES, *array.shape[1:])
        return np.ascontiguousarray(np.moveaxis(lanes, 1, -1))

    return Chunks(
        by_lane(values),
        by_lane(switches),
        by_lane(noises),
        by_lane(rates),
        by_lane(starts),
        sensor_table(sensors, 1.0),
    ), places


@dataclass(frozen=True)
class TrackModel:
    """What the filters assume of a recording, in its units."""

    # Of turns, each to the left and to the right.
    radii: tuple[Found, ...]
    # R of each coordinate.
    measurement_variance: Found
    # Q of each velocity in a tick.
    process_variance: FoundOrZero
    # Mean, of a segment [ticks]; infinite for modes that only change at known switches.
    duration: PositiveOrZero
    # Median.
    speed: FoundOrZero
    tick: Found
    # Names of the attributes above that were not given.
    estimated: tuple[str, ...] = ()
    # Whether turns of these radii explain the recording better than straight motion alone.
    turns: bool = True
    # Proposed by the recording, which they explain better than the given ones.
    better_radii: tuple[Found, ...] = ()
    # Without one, straight motion and the turns of the radii.
    modes: tuple[Mode, ...] = ()
    # Of the drift of each measured coordinate in a tick, as of a GPS.
    drift_variance: FoundOrZero = 0.0
    # Of each coordinate of measured velocities; 0 without them.
    velocity_variance: FoundOrZero = 0.0
    # In which the speed falls by a factor of e before a stop; 0 if that is not known.
    stopping_time: FoundOrZero = 0.0

    @property
    def tau(self) -> float:
        """Length of a tick, as of options."""
        return self.tick

    @property
    def hypotheses(self) -> int:
        """Number of modes of the bank."""
        return len(self.modes) or 2 * len(self.radii) + 1

    @property
    def all_modes(self) -> tuple[Mode, ...]:
        """Modes of the bank, in its order."""
        return self.modes or modes_of_radii(self.radii)

    def modes_in(self, length: float, velocity: float) -> tuple[Mode, ...]:
        """Return `modes` for positions times `length` and velocities times `velocity`."""
        units = length, velocity, self.tau, self.speed
        return tuple(in_units(mode, *units) for mode in self.modes)

    @property
    def of_bank(self) -> FilterModel:
        """Return the model of the bank, of lengths in any unit and times in ticks, with geometric
        durations.
        """
        modes = self.hypotheses
        hazard = min(1.0 / self.duration, 1.0 - 1.0 / modes)
        return FilterModel(
            1.0,
            self.process_variance,
            self.measurement_variance,
            self.measurement_variance,
            1.0 - hazard,
            hazard / max(modes - 1, 1),
            drift_variance=self.drift_variance,
        )

    def run(
        self, grid: TickGrid, lengths: Sequence[int], longest: int, most: float = math.inf
    ) -> tuple[Pass, list[tuple[int, int, int]]]:
        """Run the bank over a recording, or the part of it that `grid_chunks` chooses; return what
        it finds, with the likelihood in units of the recording, and the places of the chunks.
        """
        deviation = math.sqrt(self.measurement_variance)
        chunks, places = grid_chunks(grid, deviation, lengths, longest, most)
        model = replace(
            self,
            radii=tuple(radius / deviation for radius in self.radii),
            modes=self.modes_in(1.0 / deviation, self.tau / deviation),
            measurement_variance=1.0,
            process_variance=self.process_variance * self.tau**2 / self.measurement_variance,
            drift_variance=self.drift_variance / self.measurement_variance,
            velocity_variance=self.velocity_variance * self.tau**2 / self.measurement_variance,
            duration=math.inf if lengths else self.duration,
        )
        result = run_pass(chunks, model)
        measured = np.count_nonzero(~np.isnan(chunks.measurements[:, :, 0]))
        units = measured * math.log(self.measurement_variance)
        return result._replace(log_likelihood=result.log_likelihood - units), places

    @property
    def scales(self) -> FloatArray:
        """Scales (4,) of [x, vx, y, vy] to the units of an environment, in which R and tick are .1,
        as in the default one: what a decider reads does not depend on the units of a recording.
        """
        length = math.sqrt(0.1 / self.measurement_variance)
        return length * np.array([1.0, self.tau / 0.1, 1.0, self.tau / 0.1])

    def cause(self) -> str:
        """Return why filters cannot have this model, and what helps, "" if it is not known."""
        step = self.speed * self.tau
        radii = ", ".join(f"{radius:.4g}" for radius in self.radii)
        smallest = min(self.radii, default=math.inf)
        if "radii" not in self.estimated and smallest < step / np.pi:
            return (
                f"the object goes {step:.4g} in a tick, more than half a turn of radius {radii}:"
                " give --radii in the unit of the positions, or none to find them"
            )
        if math.sqrt(self.measurement_variance) < 1e-6 * step:
            return (
                f"the positions have no noise, R = {self.measurement_variance:.3g}: give"
                f" --measurement-variance {1e-4 * step**2:.3g}, a hundredth of a step squared"
            )
        return ""

    def options(self, radar: Radar | None = None) -> dict[str, Any]:
        """Return the options of an environment with this model in its units, and with a radar."""
        length, velocity = self.scales[:2].tolist()
        sensors: tuple[Radar | Sensor, ...] = ()
        if radar is not None:
            sensors = (radar.scaled(length, velocity),)
        elif self.velocity_variance > 0.0:
            variance = self.velocity_variance * velocity**2
            sensors = (Sensor(variance=0.1, velocity_variance=variance),)
        return {
            "sensors": sensors,
            "radii": tuple(radius * length for radius in self.radii),
            "modes": self.modes_in(length, velocity) or None,
            "speed": self.speed * velocity,
            "tau": 0.1,
            "process_variance": self.process_variance * velocity**2,
            "drift_variance": self.drift_variance * length**2,
            "measurement_variance": 0.1,
        }

    @property
    def live(self) -> "TrackModel":
        """The model by which modes are decided from the measurements so far: with a share of the
        process noise, which may also cover brakes and turns that begin gradually, and with a mode
        in which the object slows down to a stop.
        """
        modes = self.modes
        if self.stopping_time > 0.0:
            modes = (*modes, Stopping(self.stopping_time))
        return replace(self, modes=modes, process_variance=PROCESS_SHARE * self.process_variance)

    def unknown_switches(
        self, durations: str | None, ticks: int, radar: Radar | None = None
    ) -> QuickestOptions:
        """Return the options of an environment with unknown switches and this model in its units.

        Args:
            durations: law of the durations [ticks]; None is geometric with the mean of the model.
            ticks: of an episode, for deciders that read them.
            radar: that measures, in the units of the recording.
        """
        return QuickestOptions(
            **self.options(radar),
            durations=durations or GeometricDurations(self.duration),
            start="random",
            ticks=min(ticks, MAX_LENGTH),
        )

    @property
    def turn_rates(self) -> tuple[float, ...]:
        """Turn rates of the radii at the median speed [rad / time unit]."""
        return tuple(self.speed / radius for radius in self.radii)
