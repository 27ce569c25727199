"""Deciders on the same recordings: what they state, and how often they change it for a few rows
only.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from joblib import delayed
from matplotlib import colormaps
from matplotlib.figure import Figure

from agents import track_recording
from baselines import OnlineTracker, Scores, Statistic, score
from studies.recordings.objects import TARGETS, SimulatedRecording, record
from studies.results import in_brackets, in_parallel, markdown_table

COLUMNS = {
    "right rows": ("agreement", 3),
    "delay, rows": ("delay", 1),
    "missed": ("misses", 3),
    "wrong changes": ("false_changes", 2),
    "pieces below 3 rows": ("below_3", 2),
    "pieces below 5 rows": ("below_5", 2),
    "switches within a row": ("within_1", 2),
    "within three": ("within_3", 2),
    "inside the 95 % interval": ("inside", 3),
    "RMSE of position": ("position", 2),
    "of velocity": ("velocity", 2),
}
"""Heads of tables, with the key and the digits of a value; changes and pieces are counted in 1,000
rows; RMSE are in units of sqrt(R), and of sqrt(R) over a tick.
"""
HINDSIGHT = "hindsight"
"""In place of a decider: rows are decided from all rows; `hindsight:10` from those up to ten ticks
later.
"""
NEAR = 25
"""A true switch without a statement of its mode within so many rows has no interval."""


def _quotient(numbers: Any, of: Any) -> Any:
    """Return quotients, NaN where the divisor is 0."""
    return np.divide(numbers, of, out=np.full_like(numbers, np.nan), where=of > 0.0)


def _root(squares: Any, of: Any) -> Any:
    """Return roots of quotients, likewise."""
    return np.sqrt(_quotient(squares, of))


STATISTICS = {
    "below_3": Statistic(("below_3", "rows"), lambda short, rows: 1000.0 * short / rows),
    "below_5": Statistic(("below_5", "rows"), lambda short, rows: 1000.0 * short / rows),
    "within_1": Statistic(("within_1", "switches"), _quotient),
    "within_3": Statistic(("within_3", "switches"), _quotient),
    "inside": Statistic(("inside", "intervals"), _quotient),
    "position": Statistic(("position", "estimates"), _root),
    "velocity": Statistic(("velocity", "estimates"), _root),
}
"""Of what `counts` returns, by key."""

# A row of the table, as in JSON: values as `Estimate` or numbers.
Row = dict[str, Any]
# A recording, and by decider the letters S, L and R that it states, None where the object seems to
# stand still, and what `counts` returns.
Statements = tuple[SimulatedRecording, dict[str, Any], dict[str, dict[str, float]]]


def state(name: str, kind: str, seed: int, deciders: Sequence[str]) -> Statements:
    """Track one recording by all deciders, or with hindsight. What the first finds is given to the
    others, so that the model is fitted once.
    """
    recording = record(name, kind.removesuffix(", known radius"), seed)
    given: dict[str, Any] = {}
    if kind.endswith("known radius"):
        given["radii"] = (TARGETS[name].radius,)
    letters = {}
    counted = {}
    for decider in deciders:
        live = not decider.startswith(HINDSIGHT)
        rule = decider if live else None
        tracked = track_recording(*recording[:2], live=live, decider=rule, **given)
        model = tracked.model
        given = {
            "radii": model.radii,
            "measurement_variance": model.measurement_variance,
            "process_variance": model.process_variance,
            "durations": f"geometric {model.duration!r}",
        }
        modes, estimates, intervals = tracked.modes, tracked.estimates, {}
        if decider not in (rule, HINDSIGHT):
            modes, estimates = settle(recording, tracked, int(decider.partition(":")[2]))
        elif not live:
            intervals = dict(zip(tracked.pieces[:, 0].tolist(), tracked.moments, strict=True))
        letters[decider] = tracked.of_modes(modes)[0]
        errors = (estimates - recording.states) / TARGETS[name].deviation
        errors[:, 1::2] *= TARGETS[name].tau
        counted[decider] = counts(recording, letters[decider], errors, intervals)
    return recording, letters, counted


def settle(recording: SimulatedRecording, tracked: Any, lag: int) -> tuple[Any, Any]:
    """Return the modes (n,) and the estimates (n, 4) of a recording that a live tracker decides
    `lag` ticks later; the last rows without later ones.

    Args:
        recording: of the n rows.
        tracked: the same, whose model the tracker has.
        lag: in ticks.
    """
    tracker = OnlineTracker.from_recording(tracked, gate=None, lag=lag)
    times = recording.times - recording.times[0]
    ticks = np.rint(times / tracker.tau).astype(int)
    late = times - tracker.tau * ticks
    rows = dict(zip(ticks.tolist(), range(len(ticks)), strict=True))
    settled = []
    for tick in range(ticks[-1] + 1 + lag):
        row = rows.get(tick)
        point = (
            None if row is None else tracker.units.measured(recording.positions[row], times[row])
        )
        now = tracker.advance(1, point, 0.0 if row is None else float(late[row]))
        if now.settled is not None:
            settled.append((now.settled.mode, now.settled.estimate))
    modes, estimates = (np.array(values)[ticks] for values in zip(*settled, strict=True))
    estimates[:, ::2] += late[:, None] * estimates[:, 1::2]
    return modes, estimates


def counts(
    recording: SimulatedRecording, stated: Any, errors: Any, intervals: dict[int, Any]
) -> dict[str, float]:
    """Return how many rows, short pieces and true switches a recording has; how many switches are
    stated within one and three rows of the true one, and of those within `NEAR` rows how many lie
    in the interval that is given; and the sums of squared errors.

    Args:
        recording: of n rows.
        stated: (n,) letters S, L and R.
        errors: (n, 4) of the estimates, in the units of `COLUMNS`.
        intervals: times of the two ends of an interval by the row at which a piece begins.
    """
    begins = np.flatnonzero(stated != np.append("", stated[:-1]))
    lengths = np.diff(begins)
    switches = np.flatnonzero(recording.modes[1:] != recording.modes[:-1]) + 1
    beside = []
    inside = []
    for row in switches:
        same = begins[stated[begins] == recording.modes[row]]
        nearest = int(same[np.abs(same - row).argmin()]) if same.size else -1
        beside.append(abs(nearest - row) if same.size else np.inf)
        if beside[-1] < NEAR and nearest in intervals:
            low, high = intervals[nearest]
            inside.append(low <= recording.times[row] <= high)
    return {
        "rows": len(stated),
        "below_3": np.sum(lengths < 3),
        "below_5": np.sum(lengths < 5),
        "switches": len(switches),
        "within_1": np.sum(np.array(beside) <= 1),
        "within_3": np.sum(np.array(beside) <= 3),
        "intervals": len(inside),
        "inside": np.sum(inside),
        "estimates": np.sum(~np.isnan(errors[:, 0])),
        "position": np.nansum(errors[:, ::2] ** 2),
        "velocity": np.nansum(errors[:, 1::2] ** 2),
    }


def evaluate(
    deciders: Sequence[str], worlds: Sequence[tuple[str, str]], tracks: int, seed: int, jobs: int
) -> list[Row]:
    """Return rows of all deciders, the first of which others are compared with, on all recordings
    and on those of each object and kind, so many of each.
    """
    calls = [delayed(state)(*world, seed + k, deciders) for world in worlds for k in range(tracks)]
    results = in_parallel(calls, jobs, "recordings")
    rows = compare("all", results, deciders)
    for part, world in enumerate(worlds):
        here = results[part * tracks : (part + 1) * tracks]
        rows += compare(", ".join(world), here, deciders)
    return rows


def compare(world: str, results: Sequence[Statements], deciders: Sequence[str]) -> list[Row]:
    """Return a row of each decider on some recordings."""
    recordings = [result[0] for result in results]
    clocks = [np.arange(float(len(recording.times))) for recording in recordings]
    sets = {decider: [letters[decider] for _, letters, _ in results] for decider in deciders}
    scores = score(clocks, [recording.modes for recording in recordings], sets, per=1000.0)
    hours = sum(recording.times[-1] for recording in recordings) / 3600.0
    rows = []
    for decider in deciders:
        of_tracks = [counted[decider] for _, _, counted in results]
        columns = tuple(of_tracks[0])
        numbers = np.array([[*of_track.values()] for of_track in of_tracks], float)
        pieces = Scores(decider, "", (0.0,), columns, numbers[..., None])
        values = scores.estimates[decider]
        less = scores.differences.get(decider, {})
        rows.append(
            {
                "recordings": world,
                "decider": decider,
                **values,
                **{key: pieces.estimate(statistic) for key, statistic in STATISTICS.items()},
                "right_less_first": less.get("agreement"),
                "wrong_less_first": less.get("false_changes"),
                # From the sum over all recordings, which is the mean times their number.
                "hourly": scores.scores[decider].of("false", 0).sum() / hours,
                # As in HybridTrackQuickest-v0.
                "reward": values["agreement"].value - 0.005 * values["false_changes"].value,
            }
        )
    return rows


def markdown(rows: Sequence[Row]) -> str:
    """Return the table."""
    changed = {"right_less_first": 4, "wrong_less_first": 2}
    numbers = {"hourly": 1, "reward": 4}
    lines = [
        [
            row["recordings"],
            row["decider"],
            *(in_brackets(row[key], digits) for key, digits in COLUMNS.values()),
            *(
                in_brackets(row[key], digits, sign="+") if row[key] else ""
                for key, digits in changed.items()
            ),
            *(f"{row[key]:.{digits}f}" for key, digits in numbers.items()),
        ]
        for row in rows
    ]
    names = [*changed, *numbers]
    return markdown_table(["recordings", "decider", *COLUMNS, *names], lines)


def draw_lags(rows: Sequence[Row]) -> Figure | None:
    """Draw the right rows against the number of ticks after which a row is decided, in all
    recordings and in the objects and kinds; None without such deciders.
    """
    lags = {f"{HINDSIGHT}:{lag}": lag for lag in range(1000)}
    drawn = [row for row in rows if row["decider"] in lags]
    if not drawn:
        return None
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    axes.set_title("How many rows are right if a live tracker decides some ticks later?")
    axes.set_xlabel("ticks between a measurement and the decision of its mode")
    axes.set_ylabel("share of right rows")
    worlds = {row["recordings"]: None for row in drawn}
    for number, world in enumerate(worlds):
        here = [row for row in rows if row["recordings"] == world]
        late = [row for row in here if row["decider"] in lags]
        places = [lags[row["decider"]] for row in late]
        right = [row["agreement"].value for row in late]
        # All come first.
        colour, width = (colormaps["tab20"](number), 1.0) if number else ("black", 2.5)
        axes.plot(places, right, color=colour, linewidth=width, label=world)
        for row in here:
            if row["decider"] == HINDSIGHT:
                end = row["agreement"].value
                axes.plot([places[-1]], [end], ">", color=colour, clip_on=False)
    axes.grid(alpha=0.3)
    axes.legend(
        title="recordings (at the right:\nall rows known)",
        fontsize=9,
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
    )
    return figure
