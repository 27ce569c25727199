"""What is known of a tracked recording: its tables, row by row and piece by piece."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baselines.recordings.altitude import VerticalMotion
from baselines.recordings.decisions import RowDecisions
from baselines.recordings.imm_pass import TrackModel
from baselines.recordings.recording import Recording
from baselines.recordings.ticks import Piece, TickGrid
from baselines.recordings.track_modes import letter, names_of_modes
from hybrid_env.checks import AnyArray, BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class TrackedRecording:
    """A recording of n rows with its M modes, in its own units.

    Rows before the first and after the last measurement, inside of gaps, and in parts in which the
    object stands still for a decider that knows no stop have mode -1 and NaN.

    Attributes:
        recording: as it was read.
        model: noise, radii and durations that the filters assume, and which of them were estimated.
        wind: (2,) velocity of the medium, a wind or a current; 0 without a sign of one. Speeds and
            radii are those in the medium, estimates those over ground.
        decider: of a live sensor with this model: its name, with its threshold.
        modes: (n,) in `model.all_modes`: by default 0 straight, 1 .. left turns and then right
            turns, in the order of `model.radii`, and the stop if the object stands in a part.
        decided: (n,) False where there is no mode; live also before one was decided: at the start,
            and with known switches in each piece.
        probabilities: (n, M) of the modes at each row, from all measurements, live from those up to
            it.
        estimates: (n, 4) [x, vx, y, vy], likewise.
        covariances: (n, 4, 4) of the estimates.
        turns: (n, 4) speed, its deviation, radius, its deviation, see `baselines.estimation.turns`;
            the radius is infinite where the object moves straight, and NaN where it stands and
            before a decision.
        residuals: (n, 2) normalised innovations, N(0, 1) if the model holds; NaN without one.
        pieces: (K, 4) first row, end, mode and row of the decision of each piece, counted from 0;
            -1 for a piece without a decision, and with hindsight.
        moments: (K, 2) times that hold the begin of each piece with a probability of .95; NaN live.
        vertical: climbs and descents, from all rows; None live and without altitudes.
        grid: its uniform ticks.
        outliers: number of measurements that were not used, because they are far from their
            neighbours.
        standing: number of measurements that were not used, because the object stands still and the
            decider knows no stop.
        warnings: plain sentences about what does not fit.
        durations: law of the durations of the modes [ticks] that was given.
        known_switches: whether the switches were known.
        live: whether a row has what a live sensor would have told, else what all rows say.
    """

    recording: Recording
    model: TrackModel
    wind: FloatArray
    decider: str
    modes: IntArray
    decided: BoolArray
    probabilities: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    turns: FloatArray
    residuals: FloatArray
    pieces: IntArray
    moments: FloatArray
    vertical: VerticalMotion | None
    grid: TickGrid
    outliers: int
    standing: int
    warnings: list[str]
    durations: str | None = None
    known_switches: bool = False
    live: bool = False

    def mode_names(self) -> list[str]:
        """Names of the modes: S, L, R, with the radius if there are several, and stop."""
        return names_of_modes(self.model.all_modes)

    def of_modes(self, modes: IntArray) -> tuple[NDArray[Any], FloatArray]:
        """Return the letters S, L and R or the names, and the radii of modes, empty and NaN where
        there is none.
        """
        of_model = self.model.all_modes
        letters = np.array([*map(letter, of_model), ""])
        radii = [abs(mode.signed_radius) or np.nan for mode in of_model]
        return letters[modes], np.array([*radii, np.nan])[modes]

    def piece_table(self) -> dict[str, Any]:
        """Return the columns of modes.csv. Rows are counted from 1; cells that do not apply are
        empty.
        """
        recording = self.recording
        first, end, modes, when = self.pieces.T
        letters, radii = self.of_modes(modes)
        moments = {"begin": first, "end": end - 1}
        table = self._spans(first, end)
        table |= {"mode": letters, "radius": _unless(np.isnan(radii), radii)}
        if self.live:
            moments["decided"] = when
            table["decided_at"] = _unless(when < 0, recording.times[when])
            table["undecided"] = when < 0
        else:
            table["begin_low"], table["begin_high"] = self.moments.T
        if recording.time_cells is not None:
            table |= {
                f"{name}_time": _unless(rows < 0, recording.time_cells[rows])
                for name, rows in moments.items()
            }
        if self.vertical is not None:
            heights, times = self.vertical.altitudes, recording.times
            with np.errstate(invalid="ignore", divide="ignore"):
                rates = (heights[end - 1] - heights[first]) / (times[end - 1] - times[first])
            table["climb_rate"] = rates
        for name in ("begin", "end"):
            positions = self.estimates[moments[name], ::2]
            table |= {f"{name}_{axis}": positions[:, k] for k, axis in enumerate("xy")}
            table |= self._degrees(f"{name}_", positions)
        return table

    def climb_table(self) -> dict[str, Any]:
        """Return the columns of climbs.csv, of recordings with altitudes."""
        assert self.vertical is not None
        vertical = self.vertical
        first, end = vertical.pieces.T
        return {
            **self._spans(first, end),
            "motion": vertical.words(),
            "climb_rate": vertical.of_pieces[:, 0],
            "climb_rate_deviation": vertical.of_pieces[:, 1],
            "begin_altitude": vertical.altitudes[first],
            "end_altitude": vertical.altitudes[end - 1],
        }

    def row_table(self) -> dict[str, Any]:
        """Return the columns of estimates.csv, nan where there is no number."""
        state = ("x", "vx", "y", "vy")
        recording = self.recording
        triangle = [(i, j) for i in range(4) for j in range(i, 4)]
        letters, radii = self.of_modes(self.modes)
        # The column `radius` is that of the mode.
        turns = ("speed", "speed_deviation", "radius_estimate", "radius_deviation")
        file = {"line": recording.lines, "time": recording.time_cells}
        heights: dict[str, Any] = {}
        if self.vertical is not None:
            names = ("altitude", "estimate_altitude", "climb_rate", "climb_rate_deviation")
            columns = (recording.altitudes, *self.vertical[:3])
            heights = dict(zip(names, columns, strict=True))
        return {
            **self._named(len(recording.times)),
            **{name: cells for name, cells in file.items() if cells is not None},
            "t": recording.times,
            **dict(zip("xy", recording.positions.T, strict=True)),
            **self._degrees("", recording.positions),
            "mode": letters,
            "radius": radii,
            "decided": self.decided,
            **{
                f"p_{n.replace(' ', '_')}": self.probabilities[:, k]
                for k, n in enumerate(self.mode_names())
            },
            **{f"estimate_{name}": self.estimates[:, k] for k, name in enumerate(state)},
            **self._degrees("estimate_", self.estimates[:, ::2]),
            **dict(zip(turns, self.turns.T, strict=True)),
            **heights,
            **{f"cov_{state[i]}_{state[j]}": self.covariances[:, i, j] for i, j in triangle},
            **{f"residual_{axis}": self.residuals[:, k] for k, axis in enumerate("xy")},
        }

    def settings(self) -> dict[str, Any]:
        """Return the content of track.json: what `OnlineTracker.from_recording` needs, and what was
        left out, in plain values.
        """
        recording, model = self.recording, dict(vars(self.model))
        # What only a summary says.
        del model["turns"], model["better_radii"]
        radar = None if recording.radar is None else asdict(recording.radar)
        if radar is not None:
            # A recording has measurements of radars without limits only.
            del radar["period"], radar["range"]
        return {
            "object": recording.name,
            "unit": recording.unit,
            "time_unit": recording.time_unit,
            "epoch": recording.epoch,
            "wind": self.wind.tolist(),
            "projection": None if recording.projection is None else asdict(recording.projection),
            "radar": radar,
            **model,
            "gap": recording.gap,
            "modes": [mode.as_json() for mode in self.model.modes],
            "height_variance": 0.0 if self.vertical is None else self.vertical.variance,
            "durations": self.durations,
            "ticks": self.grid.longest,
            "decider": self.decider,
            "known_switches": self.known_switches,
            "rows": len(recording.times),
            "left_out": dict(recording.left_out),
            "outliers": self.outliers,
            "standing": self.standing,
            "warnings": self.warnings,
        }

    def _spans(self, first: IntArray, end: IntArray) -> dict[str, Any]:
        """Return the columns that say where pieces are, from first row and end of each."""
        return {
            **self._named(len(first)),
            "piece": np.arange(1, len(first) + 1),
            "first_row": first + 1,
            "last_row": end,
            "begin": self.recording.times[first],
            "end": self.recording.times[end - 1],
        }

    def _named(self, rows: int) -> dict[str, list[str]]:
        """Return a column with the name of the object, none for arrays."""
        recording = self.recording
        return {} if recording.lines is None else {"object": [recording.name] * rows}

    def _degrees(self, prefix: str, positions: FloatArray) -> dict[str, FloatArray]:
        """Return the columns of latitude and longitude of positions, none without a projection."""
        projection = self.recording.projection
        if projection is None:
            return {}
        # Rounded to .1 mm, so that those of a file come back as they are there.
        degrees = projection.inverse(*positions.T).round(9)
        return {f"{prefix}lat": degrees[:, 0], f"{prefix}lon": degrees[:, 1]}


def _unless(empty: BoolArray, values: AnyArray) -> AnyArray:
    """Return the cells of a column, which are empty in some rows."""
    cells = values.astype(object)
    cells[empty] = ""
    return cells


def row_results(
    recording: Recording,
    pieces: Sequence[Piece],
    decisions: Sequence[RowDecisions],
    innovations: Sequence[FloatArray],
) -> dict[str, Any]:
    """Return the arrays of a `TrackedRecording`: at its rows what is known at the rows of each
    piece.
    """

    def at_rows(of_pieces: Sequence[Any], empty: float | bool = np.nan) -> Any:
        array = np.full((len(recording.times), *of_pieces[0].shape[1:]), empty)
        for piece, values in zip(pieces, of_pieces, strict=True):
            array[piece.first : piece.end] = values
        return array

    residuals = at_rows(
        [values[piece.ticks] for piece, values in zip(pieces, innovations, strict=True)]
    )
    residuals[~recording.measured] = np.nan
    tables = []
    for piece, of_piece in zip(pieces, decisions, strict=True):
        # First row, end, and row of the decision; not the mode.
        offsets = np.where(of_piece.pieces < 0, 0, piece.first)
        offsets[:, 2] = 0
        tables.append(of_piece.pieces + offsets)
    empty = {"modes": -1, "decided": False}
    of_rows = ("modes", "decided", "probabilities", "estimates", "covariances", "turns")
    return {
        **{
            name: at_rows([getattr(each, name) for each in decisions], empty.get(name, np.nan))
            for name in of_rows
        },
        "residuals": residuals,
        "pieces": np.concatenate(tables),
        "moments": np.concatenate([each.moments for each in decisions]),
    }
