"""One trajectory on which two deciders differ, told in a picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.patches import Patch
from numpy.typing import NDArray

from agents.interface.decider_colours import COLOURS
from agents.interface.output_files import whole_file
from baselines.deciders.decider import Decider
from hybrid_env.core.records import TRACE_COLUMNS
from hybrid_env.options import WorldOptions
from hybrid_env.registration import make_vector_env
from hybrid_env.rendering.modes import mode_colour, mode_name

WRONG = "#CC3311"


@dataclass(frozen=True)
class Flight:
    """What a decider did on one episode.

    Attributes:
        name: of the decider.
        trace: (T, len(TRACE_COLUMNS)), a row a tick.
        ends: (K,) tick of the episode at which each segment ends.
        decided: (K,) tick of the episode of each decision.
        true_modes, modes: (K,) true and decided.
        correct: (K,) as rewarded.
        reward: of a segment, mean.
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
        """(T,) a column of the trace."""
        return self.trace[:, TRACE_COLUMNS.index(name)]


def fly(name: str, decider: Decider, env_id: str, seed: int, **options: Any) -> Flight:
    """Run a decider on the episode of a seed, tick by tick."""
    longest = make_vector_env(env_id, 1, **options).options.longest_segment
    env = make_vector_env(env_id, 1, tick_info=False, trace_rows=2 * longest, **options)
    observation, _ = env.reset(seed=seed)
    traces = [env.world.traced(0)]
    state: Any = None
    start = np.ones(1, np.bool_)
    decided: list[dict[str, Any]] = []
    rewards = 0.0
    while True:
        actions, state = decider.predict(observation, state=state, episode_start=start, deterministic=True)
        observation, reward, start, _, info = env.step(np.asarray(actions))
        traces.append(env.world.traced(0))
        rewards += float(reward[0])
        if "decided_mode" in info:
            decided.append({key: values[0] for key, values in info.items() if not key.startswith("_")})
        if start[0]:
            break
    ends = np.cumsum([one["decided_length"] for one in decided])
    begins = ends - [one["decided_length"] for one in decided]
    return Flight(
        name, np.concatenate(traces), ends, begins + [one["ticks"] for one in decided],
        np.array([one["decided_true_mode"] for one in decided]),
        np.array([one["decided_mode"] for one in decided]),
        np.array([one["correct"] for one in decided]), rewards / len(decided),
    )  # fmt: skip


def draw_duel(first: Flight, second: Flight, world: WorldOptions, title: str, path: Path) -> None:
    """The way in the plane with both estimates, and over time the true mode and what each follows, as PNG."""
    canvas = Canvas(figsize=(11, 7.5), layout="constrained")
    FigureCanvasAgg(canvas)
    above, below = canvas.subplots(2, 1, height_ratios=(3, 1.1))
    above.plot(first.column("x"), first.column("y"), color="0.2", linewidth=1.2, label="true way", zorder=3)
    every = slice(None, None, 4)
    measured = first.column("measured_x")[every], first.column("measured_y")[every]
    above.plot(*measured, ".", color="0.8", markersize=2.5, zorder=1, label="every fourth measurement")
    for flight, colour, marker in ((first, COLOURS[0], "s"), (second, COLOURS[3], "o")):
        x, y = flight.column("estimate_x"), flight.column("estimate_y")
        above.plot(x, y, color=colour, linewidth=1.4, alpha=0.8, label=f"estimate of {flight.name}", zorder=2)
        for tick, correct in zip(flight.decided, flight.correct, strict=True):
            edge = colour if correct else WRONG
            at = first.column("x")[tick - 1], first.column("y")[tick - 1]
            above.plot(*at, marker, markersize=8, markerfacecolor="none", markeredgecolor=edge,
                       markeredgewidth=1.8, zorder=4)  # fmt: skip
    for flight, marker in ((first, "s"), (second, "o")):
        above.plot([], [], marker, color="0.3", markerfacecolor="none", label=f"{flight.name} declares")
    above.plot([], [], "D", color=WRONG, markerfacecolor="none", label="wrongly, whatever the shape")
    for begin in (0, *first.ends[:-1]):
        at = first.column("x")[begin], first.column("y")[begin]
        above.plot(*at, "|", color="0.2", markersize=11, zorder=4)
    above.plot([], [], "|", color="0.2", markersize=11, linestyle="none", label="switch")
    _frame(above, first)
    above.set_xlabel("x, m")
    above.set_ylabel("y, m")
    above.legend(frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))

    rows = ("truth", first.name, second.name)
    begins = np.concatenate([[0], first.ends[:-1]])
    for begin, end, mode in zip(begins, first.ends, first.true_modes, strict=True):
        below.barh(0, end - begin, left=begin, color=mode_colour(int(mode), world.radii), edgecolor="white")
    for row, flight in ((1, first), (2, second)):
        for begin, end, tick, mode, correct in zip(
            begins, flight.ends, flight.decided, flight.modes, flight.correct, strict=True
        ):
            below.barh(row, tick - begin, left=begin, color="0.92", edgecolor="white")
            colour = mode_colour(int(mode), world.radii)
            below.barh(row, end - tick, left=tick, color=colour, edgecolor="white" if correct else WRONG,
                       linewidth=1 if correct else 2.2)  # fmt: skip
            below.text(begin + 2, row, str(tick - begin), va="center", fontsize=8.5)
    below.set_yticks(range(3), rows)
    below.invert_yaxis()
    below.set_xlim(0, first.ends[-1])
    below.set_xlabel("ticks of the episode")
    below.spines[["top", "right", "left"]].set_visible(False)
    used = np.unique(np.concatenate([first.true_modes, first.modes, second.modes])).tolist()
    handles = [
        Patch(color=mode_colour(mode, world.radii), label=mode_name(mode, world.radii)) for mode in used
    ]
    handles.append(Patch(color="0.92", label="waiting, with its ticks"))
    handles.append(Patch(facecolor="white", edgecolor=WRONG, linewidth=2, label="wrong"))
    below.legend(handles=handles, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    rewards = "; ".join(f"{flight.name} {flight.reward:+.2f}" for flight in (first, second))
    canvas.suptitle(f"{title}\nReward a segment: {rewards}")
    with whole_file(path) as part:
        canvas.savefig(part, dpi=120)


def _frame(axes: Any, flight: Flight) -> None:
    x, y = flight.column("x"), flight.column("y")
    span = max(np.ptp(x), np.ptp(y))
    axes.set_xlim(x.min() - 0.08 * span, x.max() + 0.08 * span)
    axes.set_ylim(y.min() - 0.08 * span, y.max() + 0.08 * span)
    axes.set_aspect("equal")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
