"""The part of `hybridtrack compare` for environments with unknown switch moments."""

from pathlib import Path

from rich.console import Console

from agents.comparison.figures import tradeoff
from agents.comparison.statement_report import chosen_table, equal_table
from agents.comparison.statement_study import StatementComparison, StatementPlan, compare_statements
from agents.comparison.tracks import record_track
from agents.figures.canvas import save_figure
from agents.figures.tracks import track_figure
from agents.interface.output_files import output_folder, write_json
from agents.interface.parallel import Workers
from agents.interface.progress import progress_display


def run_statement_comparison(plan: StatementPlan, workers: Workers, out: Path) -> None:
    """Evaluate, print the tables and write the figures and compare.json.

    Raises:
        ArgumentError: a decider is unknown, or the output folder cannot be written.
    """
    plan.families()  # reject invalid deciders before any file is written
    folder = output_folder("out", out)
    console = Console(emoji=False)
    with progress_display(console) as progress:
        result = compare_statements(plan, workers, progress)
    console.print(chosen_table(result))
    console.print(equal_table(result))
    save_figure(tradeoff(result), folder / "compare.png")
    _draw_largest_difference(result, folder / "episode.png")
    write_json(folder / "compare.json", result.as_json())
    files = "compare.png, episode.png, compare.json"
    console.print(f"Files in {folder}: {files}", markup=False, highlight=False)


def _draw_largest_difference(result: StatementComparison, path: Path) -> None:
    entries = [result.entries[0]] + ([result.best] if result.best is not result.entries[0] else [])
    plan, index = result.plan, result.largest_difference()
    records = []
    for entry in entries:
        family = entry.curve.family
        decider = family.make(family.thresholds[entry.chosen])
        name = entry.name.replace("$", r"\$")  # Matplotlib would read it as a formula
        records.append(record_track(name, decider, plan.env_id, plan.seed + index, **plan.options))
    title = f"{plan.env_id.rpartition(':')[2]}, seed {plan.seed + index}"
    if len(entries) > 1:
        title += f": largest difference in reward among {plan.tracks:,} tracks"
    lines = [title, *(f"{record.name}: {record.summary}" for record in records)]
    save_figure(track_figure(records, result.world.radii, "\n".join(lines)), path)
