"""The radius that is known after a decision, beside the radii of the bank."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from matplotlib.figure import Figure
from scipy import stats

from baselines import Estimate, FixedTimeDecider, OnlineTracker
from hybrid_env import WorldOptions, simulate
from studies.pictures import draw_estimates
from studies.results import in_parallel, markdown_table

SPEED, RADIUS = 2.0, 5.0
# Ticks from the switch to the decision, and since the decision.
DECISION = 10
SINCE = 0, 5, 10, 20, 30, 40, 50

# A row of the table, as in JSON: variance, ratio, radius, since, error, square, tracks.
Row = dict[str, Any]


def evaluate(
    variances: Sequence[float], ratios: Sequence[float], tracks: int, seed: int, jobs: int
) -> list[Row]:
    """Return rows of all measurement variances and true radii over that of the bank."""
    calls = [
        delayed(evaluate_turn)(variance, ratio, tracks, seed)
        for variance in variances
        for ratio in ratios
    ]
    return [row for rows in in_parallel(calls, jobs, "turns") for row in rows]


def evaluate_turn(variance: float, ratio: float, tracks: int, seed: int) -> list[Row]:
    """Return rows of turns to the left with a measurement variance and a true radius: the median
    error over the true radius and, of the estimated one, the mean square of the error over the
    stated deviation.
    """
    radius = ratio * RADIUS
    ticks = DECISION + SINCE[-1]
    run = simulate(f"L{ticks}r{radius}", tracks, seed, measurement_variance=variance)
    options: dict[str, Any] = {
        "bank": "anchor_aware",
        "measurement_variance": variance,
        "initial_error": (0.3, 0.2 * variance),
        "scheme": f"random 1x{ticks}-{ticks}",
    }
    tracker = OnlineTracker(WorldOptions(radii=(RADIUS,), **options), FixedTimeDecider(DECISION))
    places = np.array(SINCE) + DECISION - 1
    # Process noise changes the speed and not the turn rate.
    truth = np.hypot(run.truth[:, places, 1], run.truth[:, places, 3]) * radius / SPEED
    generator = np.random.default_rng(seed)
    found = []
    for measurements in run.measurements:
        error = generator.normal(size=4) * np.sqrt(tracker.options.start_variances)
        begin = np.array([0.0, 0.0, 0.0, SPEED]) + error
        found.append(run_track(tracker, begin, measurements))
    # (tracks, places, 3): mode, radius and its deviation.
    values = np.array(found)[:, places]
    left = (values[..., 0] == 1).all(1)
    estimated, deviations = values[left, :, 1], values[left, :, 2]
    radii = {"estimated": estimated, "fixed": np.full(estimated.shape, RADIUS)}
    squares = ((estimated - truth[left]) / deviations) ** 2
    rows = []
    for name, of_tracks in radii.items():
        errors = np.abs(of_tracks - truth[left]) / radius
        for k, since in enumerate(SINCE):
            rows.append(
                {
                    "variance": variance,
                    "ratio": ratio,
                    "radius": name,
                    "since": since,
                    "error": median_of(errors[:, k]),
                    "square": float(squares[:, k].mean()) if name == "estimated" else None,
                    "tracks": int(left.sum()),
                }
            )
    return rows


def run_track(tracker: OnlineTracker, begin: Any, measurements: Any) -> list[list[float]]:
    """Return mode, radius and its deviation at every tick of a segment."""
    tracker.begin(begin)
    tracker.switch()
    estimates = [tracker.update(point) for point in measurements]
    return [[now.mode, now.turn.radius, now.turn.radius_deviation] for now in estimates]


def median_of(values: Any) -> Estimate:
    """Return the median of independent values with its 95 % interval."""
    interval = stats.quantile_test(values).confidence_interval(0.95)
    return Estimate(float(np.median(values)), float(interval.low), float(interval.high))


def markdown(rows: Sequence[Row]) -> str:
    """Return the table: median errors in percent of the true radius."""
    lines = []
    for (variance, ratio, name), here in pd.DataFrame(rows).groupby(
        ["variance", "ratio", "radius"], sort=False
    ):
        cells = [f"{variance:g}", f"{ratio:g}", name]
        cells += [percent(error) for error in here.error]
        lines.append(cells)
        if name == "estimated":
            squares = [f"{square:.2f}" for square in here.square]
            lines.append(["", "", "squared error over variance", *squares])
    head = ["R", "true radius", "radius", *(f"{since} ticks" for since in SINCE)]
    return markdown_table(head, lines)


def percent(error: Estimate) -> str:
    """Return an error in percent with half the width of its interval."""
    return f"{100 * error.value:.1f} ± {50 * (error.high - error.low):.1f}"


def figure(rows: Sequence[Row]) -> Figure:
    """Draw the errors since the decision, a panel for each measurement variance."""
    frame = pd.DataFrame(rows)
    panels = list(frame.groupby("variance", sort=False))
    canvas = Figure(figsize=(4.0 * len(panels) + 2.0, 4.0), layout="constrained")
    styles = {"estimated": "-", "fixed": ":"}
    every = canvas.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for (variance, of_variance), axes in zip(panels, every, strict=True):
        curves = of_variance.groupby(["ratio", "radius"], sort=False)
        colours = {ratio: f"C{k}" for k, ratio in enumerate(of_variance.ratio.unique())}
        for (ratio, name), curve in curves:
            draw_estimates(
                axes,
                curve.since,
                curve.error,
                color=colours[ratio],
                linestyle=styles[name],
                label=f"{name}, true radius x {ratio:g}",
            )
        axes.set(title=f"R = {variance:g}", xlabel="ticks since the decision", yscale="log")
    every[0].set_ylabel("median error of the radius / true radius")
    handles, labels = every[-1].get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=8)
    return canvas
