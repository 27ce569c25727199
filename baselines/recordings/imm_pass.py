"""The interacting multiple model bank over recorded measurements: likelihood and normalised
innovations. The likelihood, ln p(z_k | z_1 .. z_k-1) of the mixture over the modes, summed over the
ticks, is what `model_fit` maximises. Chunks of a recording of about equal length run side by side
in the lanes of a block.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from baselines.recordings.ticks import TickGrid
from baselines.rules.measurements import run_compiled
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray
from hybrid_env.compiled import (
    LANES,
    MEASURED_FIELDS,
    FilterModel,
    ImmBank,
    aligned_zeros,
    bank_arrays,
    begin_imm,
    compiled,
    correct_imm,
    internal,
    lanes_of,
    position_noise,
    predict_imm,
    step_imm,
)
from hybrid_env.sensors import Radar, sensor_table

# What `step_imm` reads and writes of a track.
PASS_BLOCK = lanes_of(
    *MEASURED_FIELDS,
    ("estimate", np.float64, (4,)),
    ("covariance", np.float64, (10,)),
)
# All lanes of a block, which are stepped by SIMD code; what those without a chunk hold is not used.
FIRST, LAST = np.uint64(0), np.uint64(LANES)
# Measurements after the start that do not count: they depend on how the velocity was found.
BURN_IN = 3
# Ticks; every chunk forgets the velocity of the one before, and with it what it says about Q.
SHORTEST_CHUNK = 256


class Chunks(NamedTuple):
    """Parts of a recording, each in a lane of one of B blocks."""

    # (B, T, 2, LANES), NaN without a measurement and after the end of a chunk.
    measurements: FloatArray
    # (B, T, LANES) at the first tick after a known switch; all modes are then equally probable.
    switches: BoolArray
    # (B,) number of lanes with a chunk, the first ones.
    lanes: IntArray
    # (1,) record `PASS_BLOCK`, temporary memory.
    block: AnyArray
    # (B, T, LANES) range rates, NaN without one.
    rates: FloatArray
    # (1,) record `SENSOR` of a radar at the origin that made the measurements, or none.
    sensors: AnyArray


class PassOutput(NamedTuple):
    """What a pass records at every tick, NaN where there is none, or arrays of length 0 to
    record nothing.
    """

    # (B, T, 2, LANES) innovation of the most probable mode, in its standard deviations, x and y.
    white: FloatArray
    # (B, T, M, LANES) of the modes.
    probabilities: FloatArray


NO_OUTPUT = PassOutput(np.empty((0, 0, 2, LANES)), np.empty((0, 0, 0, LANES)))


def make_chunks(
    parts: list[FloatArray],
    switches: list[BoolArray] | None = None,
    rates: list[FloatArray] | None = None,
    radar: Radar | None = None,
) -> Chunks:
    """Put parts of a recording into lanes: measurements (T_i, 2), by option whether a known switch
    precedes each tick, and range rates, (T_i,), of a radar at the origin. Parts of equal length
    waste no time.
    """
    blocks = -(-len(parts) // LANES)
    longest = max(map(len, parts))
    measurements = np.full((blocks, longest, 2, LANES), np.nan)
    begins = np.zeros((blocks, longest, LANES), np.bool_)
    own_rates = np.full((blocks, longest, LANES), np.nan)
    for k, part in enumerate(parts):
        b = k // LANES
        rows = slice(len(part))
        lane = k % LANES
        measurements[b, rows, :, lane] = part
        if switches is not None:
            begins[b, rows, lane] = switches[k]
        if rates is not None:
            own_rates[b, rows, lane] = rates[k]
    lanes = np.minimum(len(parts) - LANES * np.arange(blocks), LANES)
    block = aligned_zeros((1,), PASS_BLOCK)
    block["noise"][:, ::2] = 1.0
    block["rates"] = np.nan
    sensors = sensor_table([] if radar is None else [radar], 1.0)
    return Chunks(measurements, begins, lanes, block, own_rates, sensors)


@internal
def _sense(block: Any, lane: int, rate: float, radar: Any, variance: float) -> None:
    """Write the covariance of a position that a radar has measured, over R, and its range rate."""
    x = block.measurement[0, lane]
    y = block.measurement[1, lane]
    xx, xy, yy = position_noise(x, y, radar.deviation, radar.bearing_deviation)
    block.noise[0, lane] = xx / variance
    block.noise[1, lane] = xy / variance
    block.noise[2, lane] = yy / variance
    block.rates[0, lane] = rate


@internal
def _begin(
    bank: ImmBank,
    block: Any,
    lane: int,
    last: FloatArray,
    ticks: int,
    turn: float,
    model: FilterModel,
) -> None:
    """Start the filters of a lane from two measurements some ticks apart. The variance of the
    velocity, that of the chord, has their noise, the process noise, and half of the change of
    direction in a turn.
    """
    time = ticks * model.tau
    for axis in range(2):
        now = block.measurement[axis, lane]
        velocity = (now - last[axis]) / time
        block.estimate[2 * axis, lane] = now
        block.estimate[2 * axis + 1, lane] = velocity
    speed = math.hypot(block.estimate[1, lane], block.estimate[3, lane])
    bend = speed * min(0.5 * ticks * turn * speed * model.tau, 1.0)
    for k in range(10):
        block.covariance[k, lane] = 0.0
    for axis in range(2):
        variance = (model.variance_x if axis == 0 else model.variance_y) * block.noise[
            2 * axis, lane
        ]
        spread = 2.0 * variance / (time * time) + ticks * model.process_variance + bend * bend
        block.covariance[0 if axis == 0 else 7, lane] = variance
        block.covariance[1 if axis == 0 else 8, lane] = variance / time
        block.covariance[4 if axis == 0 else 9, lane] = spread
    begin_imm(bank, block, lane, -1)


@internal
def _record(
    bank: ImmBank,
    lane: int,
    measured: bool,
    white: FloatArray,
    probabilities: FloatArray,
) -> None:
    """Write innovation, (2, LANES), and probabilities, (M, LANES), of a lane."""
    best = 0
    for h in range(bank.hypotheses.size):
        value = bank.hypotheses[h].log_probability[lane]
        probabilities[h, lane] = math.exp(value)
        if value > bank.hypotheses[best].log_probability[lane]:
            best = h
    if measured:
        white[0, lane] = bank.innovations[best].white_x[lane]
        white[1, lane] = bank.innovations[best].white_y[lane]


@compiled
def imm_pass(
    chunks: Chunks,
    bank: ImmBank,
    radii: FloatArray,
    model: FilterModel,
    output: PassOutput,
) -> float:
    """Run the bank over all chunks; return the logarithm of the likelihood. Two measurements start
    a chunk, with equally probable modes; these and `BURN_IN` more do not count. The bank, of one
    block, and the output are overwritten; no radii (n,) is a bank of straight motion.
    """
    total = 0.0
    block = chunks.block[0]
    turn = 0.0
    for radius in radii:
        turn = max(turn, 1.0 / radius)
    seen = np.zeros(LANES, np.int64)
    when = np.zeros(LANES, np.int64)
    last = np.zeros((LANES, 2))
    records = output.white.shape[0] > 0
    same = 1.0 / (2 * radii.size + 1)
    renewed = FilterModel(
        model.tau,
        model.process_variance,
        model.variance_x,
        model.variance_y,
        same,
        same,
        model.freedom,
        model.exact_anchor,
    )
    for b in range(chunks.measurements.shape[0]):
        seen[:] = 0
        lanes = chunks.lanes[b]
        for k in range(chunks.measurements.shape[1]):
            measurement = chunks.measurements[b, k]
            together = chunks.sensors.size == 0
            for lane in range(lanes):
                if (
                    seen[lane] < 2
                    or math.isnan(measurement[0, lane])
                    or chunks.switches[b, k, lane]
                ):
                    together = False
            # An assignment of arrays would take seconds to compile.
            for lane in range(LANES):
                block.measurement[0, lane] = measurement[0, lane]
                block.measurement[1, lane] = measurement[1, lane]
            if together:
                step_imm(bank, block, FIRST, LAST, radii, model)
            for lane in range(lanes):
                measured = not math.isnan(measurement[0, lane])
                if measured and chunks.sensors.size > 0:
                    _sense(
                        block,
                        lane,
                        chunks.rates[b, k, lane],
                        chunks.sensors[0],
                        model.variance_x,
                    )
                if measured and seen[lane] < 2:
                    if seen[lane] == 1:
                        _begin(bank, block, lane, last[lane], k - when[lane], turn, model)
                    last[lane, 0] = measurement[0, lane]
                    last[lane, 1] = measurement[1, lane]
                    when[lane] = k
                    seen[lane] += 1
                    continue
                if seen[lane] < 2:
                    continue
                if not together:
                    of_tick = renewed if chunks.switches[b, k, lane] else model
                    if measured and chunks.sensors.size == 0:
                        step_imm(bank, block, np.uint64(lane), np.uint64(lane + 1), radii, of_tick)
                    else:
                        predict_imm(bank, block, lane, radii, of_tick)
                        if measured:
                            correct_imm(bank, block, lane, chunks.sensors, of_tick)
                if measured:
                    seen[lane] += 1
                    if seen[lane] > 2 + BURN_IN:
                        sums = bank.sums[0]
                        total += sums.largest[lane] + math.log(sums.total[lane])
                if records:
                    _record(bank, lane, measured, output.white[b, k], output.probabilities[b, k])
    return total


def fit_chunks(grid: TickGrid, scale: float, lengths: Sequence[int] = ()) -> Chunks:
    """Return chunks of a recording, evenly spread, see `chunks_at`."""
    # Ticks that are used; a longer recording is represented by chunks of it, evenly spread.
    fit_ticks = 4096
    length = max(-(-min(grid.total, fit_ticks) // LANES), SHORTEST_CHUNK)
    places = cut(grid, length)
    wanted = max(fit_ticks // length, LANES)
    if len(places) > wanted:
        places = [places[k] for k in np.linspace(0, len(places) - 1, wanted).round().astype(int)]
    places.sort(key=lambda place: place[2] - place[1])
    return chunks_at(grid, places, scale, lengths)


def cut(grid: TickGrid, length: int) -> list[tuple[int, int, int]]:
    """Return piece, first tick and end of chunks of a recording of about a length."""
    places = []
    for k, piece in enumerate(grid.pieces):
        number = max(round(len(piece.measurements) / length), 1)
        borders = np.linspace(0, len(piece.measurements), number + 1).astype(int).tolist()
        places += [(k, a, b) for a, b in pairwise(borders)]
    return places


def chunks_at(
    grid: TickGrid,
    places: list[tuple[int, int, int]],
    scale: float,
    lengths: Sequence[int],
) -> Chunks:
    """Return the chunks at `places`, see `cut`; with known switches if lengths are given. Lengths
    are in units of `scale`, times in ticks; the origin is the first measurement, or the radar.
    """
    begins = np.zeros(grid.total, np.bool_)
    switches = None
    velocity = grid.tau / scale
    if lengths:
        begins[np.cumsum([0, *lengths[:-1]])] = True
        switches = [begins[a:b] for _, a, b in places]
    parts = [grid.pieces[k].measurements[a:b] for k, a, b in places]
    rates = [grid.pieces[k].rates[a:b] * velocity for k, a, b in places]
    if grid.radar is None:
        radar = None
        origins = [np.vstack([part[~np.isnan(part[:, 0])], np.zeros(2)])[0] for part in parts]
    else:
        radar = grid.radar.scaled(1.0 / scale, velocity)
        origins = [np.array(grid.radar.position)] * len(parts)
    values = [(part - origin) / scale for part, origin in zip(parts, origins, strict=True)]
    return make_chunks(values, switches, rates, radar)


def recorded_pass(chunks: Chunks, radii: FloatArray, model: FilterModel) -> PassOutput:
    """Return innovations and probabilities of the modes of chunks at every tick, NaN where there
    are none. The block of the chunks holds the last estimates afterwards.
    """
    shape = chunks.measurements.shape[:2]
    modes = 2 * len(radii) + 1
    output = PassOutput(
        np.full((*shape, 2, LANES), np.nan),
        np.full((*shape, modes, LANES), np.nan),
    )
    run_compiled(imm_pass, chunks, bank_arrays(ImmBank, len(radii)), radii, model, output)
    return output
