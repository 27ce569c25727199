"""Deciders on the same recordings: what they state, how often they change it for a few rows only,
and what they cost.
"""

import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from joblib import delayed

from agents import find_decider, track_recording
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
}
"""Heads of tables, with the key and the digits of a value; changes and pieces are counted in 1,000
rows.
"""
HINDSIGHT = "hindsight"
"""In place of a decider: rows are decided from all rows."""
SHORT = {
    key: Statistic((key, "rows"), lambda pieces, rows: 1000.0 * pieces / rows)
    for key in ("below_3", "below_5")
}

# A row of the table, as in JSON: values as `Estimate` or numbers.
Row = dict[str, Any]
# A recording, and by decider its stated modes (n,), indices as in `TrackedRecording`, with the
# letters S, L and R, None where the object seems to stand still.
Statements = tuple[SimulatedRecording, dict[str, Any], dict[str, Any]]


def state(name: str, kind: str, seed: int, ticks: int, deciders: Sequence[str]) -> Statements:
    """Track one recording by all deciders, or with hindsight. What the first finds is given to the
    others, so that the model is fitted once.
    """
    recording = record(name, kind.removesuffix(", known radius"), seed, ticks)
    given: dict[str, Any] = {}
    if kind.endswith("known radius"):
        given["radii"] = (TARGETS[name].radius,)
    stated = {}
    letters = {}
    for decider in deciders:
        live = decider != HINDSIGHT
        rule = decider if live else None
        tracked = track_recording(*recording[:2], live=live, decider=rule, **given)
        model = tracked.model
        given = {
            "radii": model.radii,
            "measurement_variance": model.measurement_variance,
            "process_variance": model.process_variance,
            "durations": f"geometric {model.duration!r}",
        }
        stated[decider] = tracked.modes
        letters[decider] = tracked.of_modes(tracked.modes)[0]
    return recording, stated, letters


def evaluate(
    deciders: Sequence[str],
    worlds: Sequence[tuple[str, str]],
    tracks: int,
    ticks: int,
    seed: int,
    jobs: int,
) -> list[Row]:
    """Return rows of all deciders, the first of which others are compared with, on all recordings
    and on those of each object and kind.
    """
    calls = [
        delayed(state)(*world, seed + k, ticks, deciders) for world in worlds for k in range(tracks)
    ]
    results = in_parallel(calls, jobs, "recordings")
    rows = compare("all", results, deciders)
    for row in rows:
        if row["decider"] != HINDSIGHT:
            row |= costs(row["decider"], results[0][0])
    for part, world in enumerate(worlds):
        here = results[part * tracks : (part + 1) * tracks]
        rows += compare(", ".join(world), here, deciders)
    return rows


def compare(world: str, results: Sequence[Statements], deciders: Sequence[str]) -> list[Row]:
    """Return a row of each decider on some recordings."""
    recordings = [result[0] for result in results]
    clocks = [np.arange(float(len(recording.times))) for recording in recordings]
    sets = {decider: [letters[decider] for _, _, letters in results] for decider in deciders}
    scores = score(clocks, [recording.modes for recording in recordings], sets, per=1000.0)
    hours = sum(recording.times[-1] for recording in recordings) / 3600.0
    rows = []
    for decider in deciders:
        lengths = [
            np.diff(np.flatnonzero(np.diff(each[decider], prepend=-2))) for _, each, _ in results
        ]
        counts = [
            [(of_track < 3).sum(), (of_track < 5).sum(), len(clock)]
            for of_track, clock in zip(lengths, clocks, strict=True)
        ]
        pieces = Scores(decider, "", (0.0,), (*SHORT, "rows"), np.array(counts, float)[..., None])
        values = scores.estimates[decider]
        less = scores.differences.get(decider, {})
        rows.append(
            {
                "recordings": world,
                "decider": decider,
                **values,
                **{key: pieces.estimate(statistic) for key, statistic in SHORT.items()},
                "right_less_first": less.get("agreement"),
                "wrong_less_first": less.get("false_changes"),
                "shortest": int(min(np.concatenate(lengths), default=0)),
                # Of the sum over all recordings, which is the mean times their number.
                "hourly": scores.scores[decider].of("false", 0).sum() / hours,
                # As in HybridTrackQuickest-v0.
                "reward": values["agreement"].value - 0.005 * values["false_changes"].value,
            }
        )
    return rows


def costs(decider: str, recording: SimulatedRecording) -> Row:
    """Return the time of a measurement of a live tracker [us], the least of three runs, and the
    time until a new process has the decider [s].
    """
    tracked = track_recording(*recording[:2])
    options = tracked.model.unknown_switches(None, len(recording.times))
    tracker = OnlineTracker(options, find_decider(decider, options), scales=tracked.model.scales)
    rows = list(zip(recording.positions.tolist(), recording.times.tolist(), strict=True))
    passed = []
    for _ in range(3):
        tracker.begin()
        start = time.perf_counter()
        for position, moment in rows:
            tracker.update(tuple(position), moment)
        passed.append(time.perf_counter() - start)
    code = (
        "from agents import find_decider, track_recording; from hybrid_env import QuickestOptions;"
        f" find_decider({decider!r}, QuickestOptions())"
    )
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True)
    seconds = time.perf_counter() - start
    return {"row_us": 1e6 * min(passed) / len(recording.times), "start_s": seconds}


def markdown(rows: Sequence[Row]) -> str:
    """Return the table."""
    changed = {"right_less_first": 4, "wrong_less_first": 2}
    numbers = {"shortest": 0, "hourly": 1, "reward": 4, "row_us": 0, "start_s": 1}
    lines = [
        [
            row["recordings"],
            row["decider"],
            *(in_brackets(row[key], digits) for key, digits in COLUMNS.values()),
            *(
                in_brackets(row[key], digits, sign="+") if row[key] else ""
                for key, digits in changed.items()
            ),
            *(f"{row[key]:.{digits}f}" if key in row else "" for key, digits in numbers.items()),
        ]
        for row in rows
    ]
    names = [*changed, *numbers]
    return markdown_table(["recordings", "decider", *COLUMNS, *names], lines)
