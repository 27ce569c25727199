"""The part of `hybridtrack limits` for the environment with unknown switch moments."""

from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown

from agents.figures.canvas import save_figure
from agents.interface.output_files import atomic_file, output_folder, write_json
from agents.interface.parallel import Workers
from agents.interface.progress import progress_display
from agents.limits.figures import statement_limits
from agents.limits.statement_report import statement_steps_markdown
from agents.limits.statement_study import statement_calls


def run_statement_limits(tracks: int, seed: int, out: Path, workers: Workers) -> None:
    """Evaluate the steps, print the tables and write the files.

    Raises:
        ArgumentError: the output folder cannot be written.
    """
    folder = output_folder("out", out)
    console = Console(emoji=False)
    with progress_display(console) as progress:
        calls = statement_calls(tracks, seed)
        task = progress.add_task("Evaluating", total=len(calls), note="")
        results = workers.results(calls, lambda note: progress.update(task, advance=1, note=note))
        found = [step for _, steps in results for step in steps]
        progress.update(task, note="")
    text = statement_steps_markdown(found)
    console.print(Markdown(text))
    with atomic_file(folder / "limits.md") as part:
        part.write_text(text, encoding="utf-8")
    write_json(folder / "limits.json", {"steps": [one.as_json() for one in found]})
    save_figure(statement_limits(found), folder / "limits.png")
    console.print(f"Files in {folder}: limits.md, limits.json, limits.png", markup=False, highlight=False)
