"""Scores of statements of any origin, `score(times, truth, statements)`, with intervals and
differences.
"""

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np

from baselines.scoring.estimates import Estimate
from baselines.scoring.scores import Scores
from baselines.scoring.timelines import (
    NO_MODE,
    Timeline,
    TimelineCounts,
    count_timeline,
    statistics,
)
from hybrid_env.checks import AnyArray, IntArray, Positive, check_array, checked, dimensions, reject


@dataclass(frozen=True, eq=False)
class TimelineScores:
    """Scores of one or several sets of statements on the same tracks.

    Attributes:
        scores: values `TimelineCounts` of every track, or of every block of a single track, by the
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
        """The values of `statistics` by set and name; bounds are NaN if there are no intervals."""
        return {name: self._estimates(scores) for name, scores in self.scores.items()}

    @cached_property
    def differences(self) -> dict[str, dict[str, Estimate]]:
        """The values of each other set less those of the first on the same tracks, with paired
        intervals.
        """
        first, *others = self.scores
        return {name: self._estimates(self.scores[name], self.scores[first]) for name in others}

    def as_json(self) -> dict[str, Any]:
        """Return values and differences as plain values."""
        values, less_first = (
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
            "figures": values,
            "less_first": less_first,
        }

    def _estimates(self, scores: Scores, other: Scores | None = None) -> dict[str, Estimate]:
        estimate = scores.estimate if other is None else partial(scores.difference, other)
        estimates = {key: estimate(statistic) for key, statistic in statistics(self.period).items()}
        if self.unit:
            return estimates
        return {key: Estimate(each.value, math.nan, math.nan) for key, each in estimates.items()}


Samples: TypeAlias = tuple[AnyArray, IntArray]
"""Times (n,) and indices of the modes (n,) of one track, `NO_MODE` where there is no mode."""


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
    indices: dict[Any, int] = {}
    true = _tracks("times", times, "truth", truth, indices)
    modes = list(indices)
    known = ", ".join(map(str, modes[:5]))
    if not modes:
        raise reject("truth", truth, "at least one mode that is not None, NaN or ''")
    if normal is not None and normal not in modes:
        raise reject("normal", normal, f"a mode of the truth, such as {known}")
    sets = dict(statements) if isinstance(statements, Mapping) else {"statements": statements}
    timelines = {}
    for name, stated in sets.items():
        clocks = statement_times
        if isinstance(statement_times, Mapping):
            clocks = statement_times.get(name)
        given = ("times", times) if clocks is None else ("statement_times", clocks)
        tracks = _tracks(*given, name, stated, indices)
        spoken = {index for _, of_track in tracks for index in of_track.tolist()} - {NO_MODE}
        if len(tracks) != len(true) or (spoken and min(spoken) >= len(modes)):
            allowed = f"{len(true)} tracks with modes of the truth, such as {known}"
            raise reject(name, stated, allowed)
        timelines[name] = [_merge(*pair) for pair in zip(true, tracks, strict=True)]
    scores = {
        name: _scores(name, tracks, indices.get(normal)) for name, tracks in timelines.items()
    }
    return TimelineScores(scores, timelines, tuple(indices), period, normal)


def _tracks(name: str, times: Any, word: str, modes: Any, indices: dict[Any, int]) -> list[Samples]:
    """Return the tracks of one or several arrays of times and modes; a new mode gets an index."""
    if dimensions(next(iter(times), 0.0)) == 0:
        times = [times]
        modes = [modes]
    if [dimensions(clock) for clock in times] != [dimensions(values) for values in modes]:
        raise reject(word, modes, f"{len(times)} tracks, as {name}")
    tracks = []
    for clock, values in zip(times, modes, strict=True):
        if len(values) != len(clock):
            raise reject(word, values, f"{len(clock)} modes, one for each of {name}")
        stated = [_index(mode, indices) for mode in np.asarray(values, object).tolist()]
        tracks.append((_times(name, clock), np.array(stated, int)))
    return tracks


def _times(name: str, values: Any) -> AnyArray:
    """Return checked increasing times, floats or datetime64[ns]."""
    array = np.asarray(values)
    if not array.size:
        return array
    if array.dtype.kind in "MU" or isinstance(array.flat[0], datetime):
        with warnings.catch_warnings():
            # Times with a zone become those of UTC.
            warnings.simplefilter("ignore", UserWarning)
            array = array.astype("datetime64[ns]")
    else:
        array = check_array(name, values, (None,))
    wrong = np.flatnonzero(~(array[1:] > array[:-1])) + 1
    if wrong.size:
        k = wrong[0]
        raise reject(f"{name}[{k}]", str(array[k]), f"a time after {array[k - 1]}")
    return array


def _index(mode: Any, indices: dict[Any, int]) -> int:
    """Return the index of a mode, `NO_MODE` for a missing one."""
    # Pandas, whose types of a missing mode these are, is not imported.
    missing = type(mode).__name__ in ("NAType", "NaTType")
    if mode is None or missing or mode == "" or mode != mode:
        return NO_MODE
    return indices.setdefault(mode, len(indices))


def _merge(true: Samples, stated: Samples) -> Timeline:
    """Return truth and statements at the moments at which either has a sample, until the end of
    the truth.
    """
    true_times = true[0]
    # Times of none have no type.
    stated_times = stated[0] if len(stated[0]) else true_times[:0]
    if stated_times.dtype.kind != true_times.dtype.kind:
        allowed = f"times as those of the truth, such as {true_times[0]}"
        raise reject("statement_times", str(stated_times[0]), allowed)
    clock = np.union1d(true_times, stated_times)
    clock = clock[(clock >= true_times[0]) & (clock <= true_times[-1])]
    modes = true[1][np.searchsorted(true_times, clock, "right") - 1]
    # Before the first statement nothing is stated.
    spoken = np.append(NO_MODE, stated[1])[np.searchsorted(stated_times, clock, "right")]
    scored = modes != NO_MODE
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
