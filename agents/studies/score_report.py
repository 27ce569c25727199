"""Tables and picture of scores of statements."""

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from rich.markup import escape
from rich.table import Table

from agents.evaluation.cells import estimate_cell, filled_table
from agents.figures.canvas import legend_beside, new_canvas
from agents.figures.tracks import UNDECIDED_COLOUR, draw_timelines, wrong_patch
from baselines.scoring.score import TimelineScores

HEADS = {
    "agreement": ("agreement\n%", 1, 100.0),
    "delay": ("delay\ns", 2, 1.0),
    "misses": ("misses\n%", 1, 100.0),
    "full_delay": ("delay,\nall", 2, 1.0),
    "false_changes": ("false\n/{per}", 2, 1.0),
    "false_per_1000": ("false\n/1000", 2, 1.0),
    "false_alarms": ("alarms\n/{per}", 2, 1.0),
    "changes_per_switch": ("changes", 2, 1.0),
}
"""Heading, digits and factor of each figure."""

NOTES = """delay: from a switch to the first right statement.
misses: switches followed by another one before that.
delay, all: without it, until the next switch or the end of the track.
false: changes to a mode that is not true until the next change, per {per} or 1,000 samples.
changes: of the statement, per switch."""
MOST_TRACKS = 4  # in the picture


def score_tables(result: TimelineScores, per: str) -> list[Table]:
    """Return the table of figures, and that of the differences if there are several sets."""
    first, *others = result.scores
    seconds = float(result.scores[first].of("scored", 0).sum())
    missing = "No intervals: they need several tracks, or one of at least 20 switches."
    over = f"± half width of the 95 % interval over {result.unit}." if result.unit else missing
    count = f"{result.tracks} track" + "s" * (result.tracks > 1)
    title = f"Statements on {count}, {seconds / result.period:.4g} {per} scored"
    notes = NOTES.format(per=per)
    if result.normal is not None:
        notes += f"\nalarms: false changes away from {result.normal}, per {per} in which it is true."
    contents = [(title, f"{over}\n{notes}", result.estimates, "")]
    if others:
        contents.append((f"Less that of {first}, on the same tracks", over, result.differences, "+"))
    heads = {key: head for key, head in HEADS.items() if key != "false_alarms" or result.normal is not None}
    shown = ("statements", *(head.format(per=per) for head, *_ in heads.values()))
    tables = []
    for title, caption, rows, sign in contents:
        lines = []
        for name, figures in rows.items():
            cells = [estimate_cell(figures[key], scale, digits, sign=sign) for key, (_, digits, scale) in heads.items()]
            lines.append((escape(name), *cells))
        tables.append(filled_table(title, shown, lines, caption))
    return tables


def score_figure(result: TimelineScores) -> Figure:
    """Return a picture of truth and statements over time on the first tracks; wrong ones are hatched."""
    tracks = min(result.tracks, MOST_TRACKS)
    canvas = new_canvas((10.0, 0.8 + tracks * (0.6 + 0.3 * (1 + len(result.timelines)))))
    grid = canvas.subplots(tracks, 1, squeeze=False)[:, 0]
    colours = [to_hex(colormaps["tab10"](k % 10)) for k in range(len(result.modes))]
    for number, axes in enumerate(grid):
        lines = {name: timelines[number] for name, timelines in result.timelines.items()}
        clock = np.unique(np.concatenate([line.times for line in lines.values()]))
        at = {name: np.searchsorted(line.times, clock[:-1], "right") - 1 for name, line in lines.items()}
        first = next(iter(lines))
        true = np.where(lines[first].scored, lines[first].modes, -1)[at[first]]
        rows = {"truth": true} | {name: line.stated[at[name]] for name, line in lines.items()}
        wrong = {name: (rows[name] != true) & (true >= 0) & (rows[name] >= 0) for name in lines}
        draw_timelines(axes, clock, rows, colours, "t [s]", wrong=wrong, edge_width=0.0)
    handles = [Patch(color=colour, label=str(mode)) for colour, mode in zip(colours, result.modes, strict=True)]
    handles += [Patch(color=UNDECIDED_COLOUR, label="nothing"), wrong_patch("wrong statement")]
    legend_beside(grid[0], handles=handles)
    return canvas
