"""Scores of statements of any origin, `score(times, truth, statements)`, with intervals and
differences.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np

from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores
from baselines.scoring.timelines import (
    NOTHING,
    Timeline,
    TimelineCounts,
    count_timeline,
    statistics,
)
from hybrid_env.checks import (
    AnyArray,
    ArgumentError,
    Positive,
    check_array,
    checked,
    dimensions,
    reject,
)


@dataclass(frozen=True, eq=False)
class TimelineScores:
    """Scores of one or several sets of statements on the same tracks.

    Attributes:
        scores: figures `TimelineCounts` of every track, or of every block of a single track, by the
            name of the set.
        timelines: of every track, by the name of the set.
        modes: names of the modes, by whose indices the timelines are.
        period: time in which false changes are counted.
        normal: mode away from which a false change is a false alarm; None without one.
    """

    scores: dict[str, Scores]
    timelines: dict[str, list[Timeline]]
    modes: tuple[Any, ...]
    period: float
    normal: Any = None

    @property
    def tracks(self) -> int:
        """Number of tracks."""
        return len(next(iter(self.timelines.values())))

    @property
    def unit(self) -> str:
        """What is drawn with replacement for the intervals: tracks, blocks of a single one, or
        nothing.
        """
        units = next(iter(self.scores.values())).episodes
        return "tracks" if self.tracks > 1 else f"{units} blocks" if units > 1 else ""

    @cached_property
    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """The figures of `statistics` by set and name; bounds are NaN if there are no intervals."""
        return {name: self._estimates(scores) for name, scores in self.scores.items()}

    @cached_property
    def differences(self) -> dict[str, dict[str, Estimate]]:
        """The figures of each other set less those of the first on the same tracks, with paired
        intervals.
        """
        first, *others = self.scores
        return {name: self._estimates(self.scores[name], self.scores[first]) for name in others}

    def as_json(self) -> dict[str, Any]:
        """Return figures and differences as plain values."""
        figures, less_first = (
            {
                name: {key: estimate.as_json() for key, estimate in estimates.items()}
                for name, estimates in sets.items()
            }
            for sets in (self.estimates, self.differences)
        )
        return {
            "tracks": self.tracks,
            "intervals_over": self.unit or None,
            "period": self.period,
            "modes": [str(mode) for mode in self.modes],
            "scored": float(next(iter(self.scores.values())).of("scored", 0).sum()),
            "figures": figures,
            "less_first": less_first,
        }

    def _estimates(self, scores: Scores, other: Scores | None = None) -> dict[str, Estimate]:
        estimate = scores.estimate if other is None else partial(scores.difference, other)
        estimates = {key: estimate(statistic) for key, statistic in statistics(self.period).items()}
        if self.unit:
            return estimates
        return {key: Estimate(each.value, math.nan, math.nan) for key, each in estimates.items()}


Samples: TypeAlias = tuple[AnyArray, list[Any]]
"""Times (n,) and modes (n,) of one track; None where there is no mode."""


def score(
    times: Any,
    truth: Any,
    statements: Any,
    *,
    statement_times: Any = None,
    per: float = 3600.0,
    normal: Any = None,
) -> TimelineScores:
    """Score statements of any origin: agreement, delay, misses, false changes, with 95 % intervals.

    A sample of the truth, and a statement, holds until the next one; the last time of the truth
    ends the track. A list of switches with a last row at the end is therefore as good as samples.
    Modes are numbers or strings; where the truth is None, NaN or "", nothing is scored, and where a
    statement is, none is right. Intervals are bootstrapped over tracks, for a single track over up
    to 20 blocks of equal time with two switches on average; with fewer than 10 blocks there are
    none.

    Args:
        times: (n,) increasing times of the truth, numbers or datetimes (seconds); a list of them
            for several tracks.
        truth: (n,) true modes, or a list of such arrays.
        statements: (n,) stated modes, or a list of such arrays; of several sets a dict by their
            names.
        statement_times: as `statements`, with their times; None are those of the truth. Both may be
            empty, of a track on which nothing is stated.
        per: time in which false changes are counted, in the unit of the times; an hour if these are
            seconds.
        normal: true mode, away from which a false change is a false alarm, counted in the time in
            which it is true.
    """
    period = checked("per", per, Positive)
    true = _tracks("times", times, "truth", truth)
    sets = dict(statements) if isinstance(statements, Mapping) else {"statements": statements}
    codes: dict[Any, int] = {}
    moments = [(clock, [_code(mode, codes) for mode in modes]) for clock, modes in true]
    known = len(codes)
    if not known:
        raise ArgumentError(
            "truth has no mode: expected at least one sample that is not None, NaN or ''"
        )
    if normal is not None and normal not in codes:
        raise reject(
            "normal",
            normal,
            "a mode of the truth, such as " + ", ".join(map(str, list(codes)[:5])),
        )
    timelines = {}
    for name, stated in sets.items():
        place = f"statements[{name!r}]" if isinstance(statements, Mapping) else "statements"
        clocks = (
            statement_times.get(name) if isinstance(statement_times, Mapping) else statement_times
        )
        given = ("times", times) if clocks is None else ("statement_times", clocks)
        of_set = _tracks(*given, place, stated, may_be_empty=True)
        if len(of_set) != len(true):
            raise ArgumentError(
                f"{place} has {len(of_set)} tracks: expected {len(true)}, as the truth"
            )
        of_set = [
            track if track[1] else (clock[:1], [None])
            for track, (clock, _) in zip(of_set, true, strict=True)
        ]
        coded = [(clock, [_code(mode, codes) for mode in modes]) for clock, modes in of_set]
        spoken = {mode for _, modes in coded for mode in modes} - {NOTHING}
        if spoken and min(spoken) >= known:
            shown = sorted({str(mode) for _, modes in of_set for mode in modes})[:5]
            modes = ", ".join(str(mode) for mode in list(codes)[:known][:5])
            raise reject(place, shown, f"modes of the truth, such as {modes}")
        timelines[name] = [_merge(*pair, place) for pair in zip(moments, coded, strict=True)]
    scores = {name: _scores(name, tracks, codes.get(normal)) for name, tracks in timelines.items()}
    return TimelineScores(scores, timelines, tuple(codes), period, normal)


def _tracks(
    name: str,
    times: Any,
    word: str,
    modes: Any,
    may_be_empty: bool = False,
) -> list[Samples]:
    """Return the tracks of one or several arrays of times and modes; those of statements may be
    empty.
    """
    first = next(iter(times), 0.0) if dimensions(times) == 1 else times
    if dimensions(times) == 1 and (isinstance(first, str) or dimensions(first) != 1):
        times = [times]
        modes = [modes]
    if len(times) != len(modes) or not len(times):
        raise ArgumentError(
            f"{word} has {len(modes)} tracks: expected {len(times)}, as {name}, at least one"
        )
    tracks = []
    for number, (clock, values) in enumerate(zip(times, modes, strict=True)):
        place = name if len(times) == 1 else f"{name}[{number}]"
        if dimensions(values) != 1 or len(values) != len(clock):
            shape = np.shape(values)
            raise ArgumentError(
                f"{word} has shape {shape} for {len(clock)} {place}: expected one mode for each"
            )
        moments = np.zeros(0) if may_be_empty and not len(clock) else _times(place, clock)
        tracks.append((moments, np.asarray(values, object).tolist()))
    return tracks


def _times(name: str, values: Any) -> AnyArray:
    """Return checked increasing times, floats or datetime64[ns]."""
    array = np.asarray(values)
    if array.dtype.kind == "O" and all(isinstance(value, datetime) for value in array.flat):
        zoned = (value.astimezone(UTC) if value.tzinfo else value for value in array.tolist())
        array = np.array([value.replace(tzinfo=None) for value in zoned], "datetime64[ns]")
    if array.dtype.kind in "mMU":
        try:
            array = array.astype("timedelta64[ns]" if array.dtype.kind == "m" else "datetime64[ns]")
        except ValueError:
            raise reject(name, values, "an array of numbers or datetimes") from None
    else:
        array = check_array(name, values, (None,))
    wrong = np.flatnonzero(~(array[1:] > array[:-1]))
    if wrong.size:
        raise reject(
            f"{name}[{wrong[0] + 1}]",
            str(array[wrong[0] + 1]),
            f"a time after {array[wrong[0]]}",
        )
    return array


def _code(mode: Any, codes: dict[Any, int]) -> int:
    """Return the index of a mode, for which `codes` grows; `NOTHING` for a missing one."""
    value = mode.item() if isinstance(mode, np.generic) else mode
    # Pandas, whose types of a missing mode these are, is not imported.
    missing = type(value).__name__ in ("NAType", "NaTType")
    if value is None or missing or value == "" or value != value:
        return NOTHING
    return codes.setdefault(value, len(codes))


def _merge(true: Samples, stated: Samples, name: str) -> Timeline:
    """Return truth and statements at the moments at which either has a sample, until the end of
    the truth.
    """
    true_times = true[0]
    stated_times = stated[0]
    if true_times.dtype.kind != stated_times.dtype.kind:
        raise reject(
            name,
            str(stated_times[0]),
            f"times as those of the truth, such as {true_times[0]}",
        )
    if stated_times[0] > true_times[-1]:
        raise reject(
            name,
            str(stated_times[0]),
            f"a first time before the end of the truth, {true_times[-1]}",
        )
    clock = np.union1d(true_times, stated_times)
    clock = clock[(clock >= true_times[0]) & (clock <= true_times[-1])]
    rows = np.searchsorted(true_times, clock, "right") - 1
    modes = np.array(true[1])[rows]
    at = np.searchsorted(stated_times, clock, "right") - 1
    spoken = np.where(at >= 0, np.array(stated[1])[at], NOTHING)
    scored = modes != NOTHING
    # Where the truth is not known the mode before goes on, so that its return is no switch.
    known = np.maximum.accumulate(np.where(scored, np.arange(len(clock)), -1))
    modes = modes[np.where(known < 0, int(scored.argmax()), known)]
    seconds = clock - clock[0]
    if seconds.dtype.kind != "f":
        seconds = seconds / np.timedelta64(1, "s")
    weights = np.where(scored, np.append(np.diff(seconds), 0.0), 0.0)
    # A list of switches has no samples.
    denser = max(true_times, stated_times, key=len)
    samples = np.isin(clock, denser) & scored
    # The end.
    samples[-1] = False
    return Timeline(seconds, modes, spoken, scored, weights, samples)


def _scores(name: str, tracks: Sequence[Timeline], normal: int | None) -> Scores:
    """Return the scores of one set, with a row for each track, or each block of equal time with two
    switches of a single one.
    """
    blocks = None
    times = tracks[0].times
    count = min(20, int((np.diff(tracks[0].modes) != 0).sum()) // 2)
    # Fewer blocks give no intervals.
    if len(tracks) == 1 and count >= 10:
        blocks = np.minimum((count * (times / times[-1])).astype(int), count - 1)
    rows = np.concatenate([count_timeline(track, normal, blocks) for track in tracks])
    return Scores(name, "", (0.0,), TimelineCounts._fields, rows[..., None])
