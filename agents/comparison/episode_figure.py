"""Figure of one episode with the decisions of two deciders."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch
from numpy.typing import NDArray

from agents.interface.decider_colours import DeciderStyle, decider_styles
from agents.interface.output_files import atomic_file
from baselines.rules.decider import Decider
from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.rendering.modes import mode_colour, mode_name

TRUE_TRACK = "0.72"
MEASUREMENT = "0.6"
UNDECIDED = "0.92"
NAME_LENGTH = 0.009  # of a character, as a share of the time axis


@dataclass(frozen=True)
class EpisodeRecord:
    """Decisions and estimates of one decider in one episode of T ticks and K segments.

    Attributes:
        name: name of the decider.
        trace: (T, len(TRACE_COLUMNS)) values of each tick.
        ends: (K,) tick of the episode at which each segment ends.
        decided: (K,) tick of the episode of each decision.
        true_modes: (K,) true mode of each segment.
        modes: (K,) decided mode of each segment.
        correct: (K,) whether each decision is correct, as the reward counts it.
        reward: mean reward per segment.
    """

    name: str
    trace: NDArray[np.float64]
    ends: NDArray[np.int64]
    decided: NDArray[np.int64]
    true_modes: NDArray[np.int64]
    modes: NDArray[np.int64]
    correct: NDArray[np.bool_]
    reward: float

    def column(self, name: str) -> NDArray[np.float64]:
        """(T,) column of the trace."""
        return self.trace[:, TRACE_COLUMNS.index(name)]


def record_episode(name: str, decider: Decider, env_id: str, seed: int, **options: Any) -> EpisodeRecord:
    """Run a decider on one episode and record every tick.

    Args:
        name: name of the decider.
        decider: the decider.
        env_id: registered id of the environment.
        seed: seed of the episode.
        options: keyword arguments of the environment.
    """
    longest = make_vector_env(env_id, 1, **options).options.longest_segment
    env = make_vector_env(env_id, 1, tick_info=False, trace_rows=2 * longest, **options)
    observation, _ = env.reset(seed=seed)
    traces = [env.world.read_trace(0)]
    state: Any = None
    start = np.ones(1, np.bool_)
    decided: list[dict[str, Any]] = []
    rewards = 0.0
    while True:
        actions, state = decider.predict(observation, state=state, episode_start=start, deterministic=True)
        observation, reward, start, _, info = env.step(np.asarray(actions))
        traces.append(env.world.read_trace(0))
        rewards += float(reward[0])
        if "decided_mode" in info:
            decided.append({key: values[0] for key, values in info.items() if not key.startswith("_")})
        if start[0]:
            break
    ends = np.cumsum([one["decided_length"] for one in decided])
    begins = ends - [one["decided_length"] for one in decided]
    return EpisodeRecord(
        name, np.concatenate(traces), ends, begins + [one["ticks"] for one in decided],
        np.array([one["decided_true_mode"] for one in decided]),
        np.array([one["decided_mode"] for one in decided]),
        np.array([one["correct"] for one in decided]), rewards / len(decided),
    )  # fmt: skip


def draw_episode(
    first: EpisodeRecord, second: EpisodeRecord, world: WorldOptions, title: str, path: Path
) -> None:
    """Write `episode_figure` as PNG."""
    canvas = episode_figure(first, second, world, title)
    with atomic_file(path) as part:
        canvas.savefig(part)


def episode_figure(first: EpisodeRecord, second: EpisodeRecord, world: WorldOptions, title: str) -> Canvas:
    """The track with the estimates and decisions of two deciders, and their modes over time.

    Args:
        first: record of one decider.
        second: record of the other on the same episode.
        world: options of the environment.
        title: first line of the title.
    """
    canvas = Canvas(figsize=(11, 8), layout="constrained", dpi=120)
    FigureCanvasAgg(canvas)
    track, timeline = canvas.subplots(2, 1, height_ratios=(3, 1.1))
    records = (first, second)
    styles = decider_styles([record.name for record in records])
    _draw_track(track, records, [styles[record.name] for record in records])
    _draw_timeline(timeline, records, world)
    rewards = ", ".join(f"{record.name} {record.reward:+.2f}" for record in records)
    canvas.suptitle(f"{title}\nMean reward per segment: {rewards}")
    return canvas


def _draw_track(axes: Any, records: Sequence[EpisodeRecord], styles: Sequence[DeciderStyle]) -> None:
    first = records[0]
    x, y = first.column("x"), first.column("y")
    axes.plot(x, y, color=TRUE_TRACK, linewidth=4, label="true track", zorder=1)
    every = slice(None, None, 4)
    axes.plot(
        first.column("measured_x")[every], first.column("measured_y")[every], ".", color=MEASUREMENT,
        markersize=2.5, zorder=2, label="every fourth measurement",
    )  # fmt: skip
    begins = [0, *first.ends[:-1]]
    axes.plot(x[begins], y[begins], "|", color="0.2", markersize=12, zorder=4, label="mode switch")
    handles = list(axes.lines)
    labels = [line.get_label() for line in axes.lines]
    for record, style in zip(records, styles, strict=True):
        estimate = record.column("estimate_x"), record.column("estimate_y")
        axes.plot(*estimate, color=style.colour, linewidth=1.2, zorder=3)
        handles.append(axes.lines[-1])
        for correct in (True, False):
            ticks = record.decided[record.correct == correct] - 1
            markers = axes.plot(
                x[ticks], y[ticks], linestyle="none", marker=style.marker, markersize=9, zorder=5,
                color=style.colour, markerfacecolor=style.colour if correct else "white", markeredgewidth=1.6,
            )  # fmt: skip
            handles += markers
        labels += [f"{record.name}: {what}" for what in ("estimate", "correct decision", "wrong decision")]
    span = max(np.ptp(x), np.ptp(y))
    axes.set_xlim(x.min() - 0.08 * span, x.max() + 0.08 * span)
    axes.set_ylim(y.min() - 0.08 * span, y.max() + 0.08 * span)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.legend(handles, labels, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_timeline(axes: Any, records: Sequence[EpisodeRecord], world: WorldOptions) -> None:
    first = records[0]
    begins = np.concatenate([[0], first.ends[:-1]])
    axes.set_xlim(0, first.ends[-1])
    for begin, end, mode in zip(begins, first.ends, first.true_modes, strict=True):
        _draw_mode(axes, 0, (begin, end), int(mode), world)
    for row, record in enumerate(records, start=1):
        for begin, end, tick, mode, correct in zip(
            begins, record.ends, record.decided, record.modes, record.correct, strict=True
        ):
            axes.barh(row, tick - begin, left=begin, color=UNDECIDED, edgecolor="white")
            axes.text((begin + tick) / 2, row, str(tick - begin), va="center", ha="center", fontsize=8.5)
            _draw_mode(axes, row, (tick, end), int(mode), world, bool(correct))
    axes.set_yticks(range(1 + len(records)), ["true mode", *(record.name for record in records)])
    axes.invert_yaxis()
    axes.set_xlabel("tick of the episode")
    axes.spines[["top", "right", "left"]].set_visible(False)
    handles = [
        Patch(color=UNDECIDED, label="before the decision (ticks)"),
        Patch(facecolor="0.6", edgecolor="white", hatch="xxx", label="wrong mode"),
    ]
    axes.legend(handles=handles, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_mode(
    axes: Any, row: int, ticks: tuple[int, int], mode: int, world: WorldOptions, correct: bool = True
) -> None:
    """A bar in the colour of a mode, with its name where the bar is long enough."""
    begin, end = ticks
    colour = mode_colour(mode, world.radii)
    axes.barh(row, end - begin, left=begin, color=colour, edgecolor="white", hatch=None if correct else "xxx")
    name = mode_name(mode, world.radii)
    if (end - begin) / axes.get_xlim()[1] > NAME_LENGTH * len(name):
        axes.text(
            (begin + end) / 2, row, name, va="center", ha="center", fontsize=8.5,
            color="white" if np.mean(to_rgb(colour)) < 0.55 else "black",
            bbox={"facecolor": colour, "edgecolor": "none", "pad": 1.5},
        )  # fmt: skip
