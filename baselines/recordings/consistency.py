"""Whether the model fits a recording: if it does, innovations of the interacting multiple model
bank divided by their standard deviations are white, with a variance of 1. Bar-Shalom, Li and
Kirubarajan 2001, "Estimation with applications to tracking and navigation", section 5.4.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from baselines.recordings.imm_pass import SHORTEST_CHUNK, chunks_at, cut, recorded_pass
from baselines.recordings.model_fit import NEVER, TrackModel, imm_model
from baselines.recordings.scatter import noise_estimate
from baselines.recordings.ticks import TickGrid
from hybrid_env.checks import FloatArray
from hybrid_env.core.records import LANES

# Ticks; the filters start anew at the beginning of each chunk.
LONGEST_CHUNK = 2048
# Median of the squared length of a normalised innovation in two dimensions.
CHI_SQUARE_MEDIAN = 2.0 * math.log(2.0)
# Squared length that a normalised innovation exceeds with probability 0.001.
FAR = 13.8
LARGEST_RATIO = 1.5
LARGEST_SCATTER = 3.0
LARGEST_CORRELATION = 0.25
MOST_FAR = 0.02
# Innovations.
FEWEST = 30


@dataclass(frozen=True, eq=False)
class Consistency:
    """Agreement of model and measurements: normalised innovations, of the most probable mode,
    and scatter.
    """

    # Of each piece, (T, 2), NaN without a measurement and where filters start.
    innovations: tuple[FloatArray, ...]
    # Median length over that of the model, 1 if the model holds.
    ratio: float
    # Of successive ones, 0 if the model holds.
    correlation: float
    # Share that is longer than 99.9 % of those of the model.
    far: float
    # Standard deviation of the measurements by their third differences, over that of the model; NaN
    # if they are too few, and with a radar, whose noise depends on the range.
    scatter: float
    # Number of innovations.
    count: int

    def warnings(self, model: TrackModel) -> list[str]:
        """Return a plain sentence for everything that does not fit."""
        if self.count < FEWEST:
            return [f"only {self.count} innovations: whether the model fits cannot be checked"]
        found = []
        given, better = (
            ", ".join(f"{radius:.4g}" for radius in some)
            for some in (model.radii, model.better_radii)
        )
        if self.scatter > LARGEST_SCATTER or self.scatter < 1.0 / LARGEST_SCATTER:
            found.append(
                f"the measurements scatter {_times(self.scatter)} what R says: check units and R"
            )
        elif not 1.0 / LARGEST_RATIO <= self.ratio <= LARGEST_RATIO:
            found.append(
                f"residuals are {_times(self.ratio)} what the model says: check units, R, Q and"
                " radii"
            )
        elif better:
            found.append(
                f"turns of radius {given} do not explain the recording, {better} does: check units"
                " and radii"
            )
        elif not model.turns and "radii" not in model.estimated:
            found.append(
                f"turns of radius {given} explain the recording no better than straight motion:"
                " check units and radii, if there are turns"
            )
        elif abs(self.correlation) > max(LARGEST_CORRELATION, 4.0 / math.sqrt(2.0 * self.count)):
            found.append(
                f"successive residuals are correlated by {self.correlation:.2f}: the model does not"
                " fit (motion other than lines and arcs, smoothed positions, or wrong radii)"
            )
        if self.far > MOST_FAR:
            found.append(
                f"{self.far:.1%} of the residuals are outliers, more than three standard"
                " deviations off"
            )
        return found


def _times(ratio: float) -> str:
    return f"{ratio:.2g} times" if ratio < 10.0 else f"{ratio:.0f} times"


def check_consistency(
    grid: TickGrid,
    model: TrackModel,
    lengths: Sequence[int] = (),
) -> Consistency:
    """Return what the normalised innovations of a recording, of `lengths` between known
    switches, say of a model.
    """
    scale = math.sqrt(model.measurement_variance)
    longest = max(min(LONGEST_CHUNK, -(-grid.total // LANES)), SHORTEST_CHUNK)
    places = cut(grid, longest)
    process = model.process_variance * model.tau**2 / model.measurement_variance
    assumed = imm_model(1.0, process, NEVER if lengths else model.duration, len(model.radii))
    chunks = chunks_at(grid, places, scale, lengths)
    white = recorded_pass(chunks, np.array(model.radii) / scale, assumed).white
    innovations = [np.full((len(piece.measurements), 2), np.nan) for piece in grid.pieces]
    for k, (index, first, end) in enumerate(places):
        innovations[index][first:end] = white[k // LANES, : end - first, :, k % LANES]
    joined = np.concatenate([np.vstack([one, np.full((1, 2), np.nan)]) for one in innovations])
    squared = (joined**2).sum(1)
    count = int((~np.isnan(squared)).sum())
    noise = noise_estimate(grid) if grid.radar is None else None
    scatter = math.nan if noise is None else math.sqrt(noise / model.measurement_variance)
    if not count:
        return Consistency(tuple(innovations), math.nan, 0.0, 0.0, scatter, 0)
    # A single outlier must not decide.
    near = np.clip(joined, -5.0, 5.0)
    products = near[1:] * near[:-1]
    total = float(np.nanmean(near**2))
    correlation = (
        float(np.nanmean(products)) / total if total and (~np.isnan(products)).any() else 0.0
    )
    ratio = math.sqrt(float(np.nanmedian(squared)) / CHI_SQUARE_MEDIAN)
    far = float((squared > FAR * max(ratio, 1.0) ** 2).sum()) / count
    return Consistency(tuple(innovations), ratio, correlation, far, scatter, count)
