"""Whether the model fits a recording: if it does, innovations of the interacting multiple model
bank divided by their standard deviations are white, with a variance of 1. Bar-Shalom, Li and
Kirubarajan 2001, "Estimation with applications to tracking and navigation", section 5.4.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from baselines.recordings.imm_pass import SHORTEST_CHUNK, chunks_at, cut, recorded_pass
from baselines.recordings.model_fit import NEVER, TrackModel
from baselines.recordings.scatter import noise_estimate
from baselines.recordings.ticks import TickGrid
from hybrid_env.checks import FloatArray
from hybrid_env.compiled import LANES


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
        largest_correlation = 0.25
        largest_scatter = 3.0
        largest_ratio = 1.5
        # Innovations.
        if self.count < 30:
            return [f"only {self.count} innovations: whether the model fits cannot be checked"]
        sentences = []
        given, better = (
            ", ".join(f"{radius:.4g}" for radius in some)
            for some in (model.radii, model.better_radii)
        )
        if self.scatter > largest_scatter or self.scatter < 1.0 / largest_scatter:
            sentences.append(
                f"the measurements scatter {_times(self.scatter)} what R says: check units and R"
            )
        elif not 1.0 / largest_ratio <= self.ratio <= largest_ratio:
            sentences.append(
                f"residuals are {_times(self.ratio)} what the model says: check units, R, Q and"
                " radii"
            )
        elif better:
            sentences.append(
                f"turns of radius {given} do not explain the recording, {better} does: check units"
                " and radii"
            )
        elif not model.turns and "radii" not in model.estimated:
            sentences.append(
                f"turns of radius {given} explain the recording no better than straight motion:"
                " check units and radii, if there are turns"
            )
        elif abs(self.correlation) > max(largest_correlation, 4.0 / math.sqrt(2.0 * self.count)):
            sentences.append(
                f"successive residuals are correlated by {self.correlation:.2f}: the model does not"
                " fit (motion other than lines and arcs, smoothed positions, or wrong radii)"
            )
        if self.far > 0.02:
            sentences.append(
                f"{self.far:.1%} of the residuals are outliers, more than three standard"
                " deviations off"
            )
        return sentences


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
    # Ticks; the filters start anew at the beginning of each chunk.
    longest = max(min(2048, -(-grid.total // LANES)), SHORTEST_CHUNK)
    places = cut(grid, longest)
    assumed = replace(
        model,
        measurement_variance=1.0,
        process_variance=model.process_variance * model.tau**2 / model.measurement_variance,
        duration=NEVER if lengths else model.duration,
    )
    chunks = chunks_at(grid, places, scale, lengths)
    white = recorded_pass(chunks, np.array(model.radii) / scale, assumed.of_bank).white
    innovations = [np.full((len(piece.measurements), 2), np.nan) for piece in grid.pieces]
    for k, (index, first, end) in enumerate(places):
        innovations[index][first:end] = white[k // LANES, : end - first, :, k % LANES]
    joined = np.concatenate(
        [np.vstack([of_piece, np.full((1, 2), np.nan)]) for of_piece in innovations]
    )
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
    known = total and not np.isnan(products).all()
    correlation = float(np.nanmean(products)) / total if known else 0.0
    # Median of the squared length of a normalised innovation in two dimensions.
    ratio = math.sqrt(float(np.nanmedian(squared)) / (2.0 * math.log(2.0)))
    # Squared length that a normalised innovation exceeds with probability 0.001.
    far = float((squared > 13.8 * max(ratio, 1.0) ** 2).sum()) / count
    return Consistency(tuple(innovations), ratio, correlation, far, scatter, count)
