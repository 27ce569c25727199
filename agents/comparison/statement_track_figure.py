"""Figure of one track with the statements of one or two deciders."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch
from numpy.typing import NDArray

from agents.comparison.episode_figure import MEASUREMENT
from agents.comparison.figure import DPI
from agents.interface.decider_colours import DeciderStyle, decider_styles
from agents.interface.output_files import atomic_file
from baselines.rules.metrics import StatementMetrics, measure_statements
from baselines.rules.statements import Statements, record_statements
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.rendering.modes import mode_colour, mode_name
from hybrid_env.worlds.quickest_world import QuickestWorld

FloatArray = NDArray[np.float64]
MARKER_SIZES = (12.0, 7.0)  # of the first and of the second decider, whose markers may coincide
MOST_NAMES = 7  # true modes named in the legend


@dataclass(frozen=True)
class TrackRecord:
    """Statements of one decider on one track of T ticks.

    Attributes:
        name: of the decider.
        statements: (T, 1) true and stated modes.
        truth: (T, 4) states [x, vx, y, vy] [m, m/s].
        measurements: (T, 2) [m].
    """

    name: str
    statements: Statements
    truth: FloatArray
    measurements: FloatArray


class _Witness:
    """A decider that notes the object and its measurements, and decides as another one."""

    def __init__(self, decider: Any):
        self.decider, self.predict = decider, decider.predict
        self.truth: list[FloatArray] = []
        self.measurements: list[FloatArray] = []

    def observe(self, world: QuickestWorld) -> NDArray[Any]:
        self.truth.append(world.field("truth")[0].copy())
        self.measurements.append(world.field("measurement")[0].copy())
        observe = getattr(self.decider, "observe", None)
        observed: NDArray[Any] = world.observations if observe is None else observe(world)
        return observed


def record_track(name: str, decider: Any, options: QuickestOptions, seed: int) -> TrackRecord:
    """Run a decider on one track and note every tick.

    Args:
        name: of the decider.
        decider: as in `record_statements`.
        options: of the environment.
        seed: of the track.
    """
    witness: Any = _Witness(decider)
    statements = record_statements(witness, 1, seed, **vars(options))
    return TrackRecord(name, statements, np.array(witness.truth), np.array(witness.measurements))


def draw_track(records: Sequence[TrackRecord], world: QuickestOptions, title: str, path: Path) -> None:
    """Write `track_figure` as PNG."""
    canvas = track_figure(records, world, title)
    with atomic_file(path) as part:
        canvas.savefig(part)


def track_figure(records: Sequence[TrackRecord], world: QuickestOptions, title: str) -> Canvas:
    """The track with the changes of the statements, and true and stated modes over time.

    Args:
        records: of one or two deciders on the same track.
        world: options of the environment.
        title: first line of the title.
    """
    canvas = Canvas(figsize=(11, 8), layout="constrained", dpi=DPI)
    FigureCanvasAgg(canvas)
    track, timeline = canvas.subplots(2, 1, height_ratios=(3, 0.5 + 0.3 * len(records)))
    styles = decider_styles([record.name for record in records])
    _draw_track(track, records, styles, world)
    _draw_timeline(timeline, records, world)
    lines = [title]
    for record in records:
        metrics = measure_statements(record.statements, world.change_cost)
        lines.append(f"{record.name}: {_summary(metrics, len(record.truth))}")
    canvas.suptitle("\n".join(lines))
    return canvas


def _summary(metrics: StatementMetrics, ticks: int) -> str:
    right, reward = f"{100 * metrics.right[0]:.1f} %", f"{metrics.reward[0]:.3f}"
    delay = f"mean delay {metrics.mean_delay:.1f} ticks" if metrics.delays.size else "no switch detected"
    wrong = round(1e-3 * ticks * float(metrics.wrong_changes[0]))
    return f"{right} of the ticks right, {delay}, {wrong} changes to a wrong mode, mean reward {reward}"


def _draw_track(
    axes: Any, records: Sequence[TrackRecord], styles: dict[str, DeciderStyle], world: QuickestOptions
) -> None:
    first = records[0]
    x, y = first.truth[:, 0], first.truth[:, 2]
    axes.plot(
        *first.measurements[::4].T, ".", color=MEASUREMENT, markersize=2.5, zorder=1,
        label="every fourth measurement",
    )  # fmt: skip
    for begin, end, mode in runs(first.statements.true_modes[:, 0]):
        stop = min(end + 1, len(x))
        axes.plot(x[begin:stop], y[begin:stop], color=mode_colour(mode, world.radii), linewidth=3, zorder=2)
    handles, labels = [axes.lines[0]], [axes.lines[0].get_label()]
    for record, size in zip(records, MARKER_SIZES, strict=False):
        style = styles[record.name]
        true, stated = (modes[:, 0] for modes in record.statements)
        changed = np.flatnonzero(np.diff(stated, prepend=stated[:1]) != 0)
        for right in (True, False):
            ticks = changed[(true == stated)[changed] == right]
            handles += axes.plot(
                x[ticks], y[ticks], linestyle="none", marker=style.marker, markersize=size, zorder=5,
                color=style.colour, markerfacecolor=style.colour if right else "white", markeredgewidth=1.6,
            )  # fmt: skip
            labels.append(f"{record.name}: {'right' if right else 'wrong'} change")
    axes.set_aspect("equal", adjustable="datalim")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.legend(handles, labels, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_timeline(axes: Any, records: Sequence[TrackRecord], world: QuickestOptions) -> None:
    true = records[0].statements.true_modes[:, 0]
    axes.set_xlim(0, len(true))
    for row, modes in enumerate([true, *(record.statements.stated_modes[:, 0] for record in records)]):
        for begin, end, key in runs(2 * modes + (modes == true)):
            axes.barh(
                row, end - begin, left=begin, color=mode_colour(key // 2, world.radii), edgecolor="white",
                linewidth=0.3, hatch=None if key % 2 else "xxx",
            )  # fmt: skip
    axes.set_yticks(range(1 + len(records)), ["true mode", *(record.name for record in records)])
    axes.invert_yaxis()
    axes.set_xlabel("tick of the episode")
    axes.spines[["top", "right", "left"]].set_visible(False)
    handles = [
        Patch(color=mode_colour(mode, world.radii), label=mode_name(mode, world.radii))
        for mode in np.unique(true).tolist()[:MOST_NAMES]
    ]
    handles.append(Patch(facecolor="0.6", edgecolor="white", hatch="xxx", label="wrong statement"))
    axes.legend(handles=handles, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def runs(values: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Return (first tick, tick after the last, value) of each run of equal values, 0-based."""
    begins = np.flatnonzero(np.diff(values, prepend=values[0] - 1))
    return list(
        zip(begins.tolist(), [*begins[1:].tolist(), len(values)], values[begins].tolist(), strict=True)
    )
