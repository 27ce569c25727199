"""The command `hybridtrack bench`: speed compared with common alternatives."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

Group = Literal[
    "single",
    "vector",
    "quickest",
    "threads",
    "banks",
    "bank",
    "online",
    "study",
    "training",
    "growth",
    "startup",
]
ALL: tuple[Group, ...] = get_args(Group)


@dataclass(kw_only=True)
class Bench:
    """Measure the speed of environment, bank, tracker, study and training, against CartPole and filterpy."""

    groups: Annotated[tuple[Group, ...], tyro.conf.Positional] = ALL
    """Groups to measure; all by default, in about three minutes."""
    out: Path = Path("results")
    """Folder for bench.json, bench.md and bench.png."""

    def run(self) -> None:
        """Measure, print the table, write the files."""
        import datetime
        import importlib.util
        import os
        import platform

        from rich.console import Console

        from agents.benchmark.measurements import GROUPS
        from agents.benchmark.report import draw, markdown, table
        from agents.benchmark.timing import Measurement
        from agents.interface.output_files import atomic_file, output_folder, write_json
        from agents.interface.progress import progress_display

        folder = output_folder("out", self.out)
        console = Console(emoji=False)
        machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
        title = f"{datetime.date.today():%Y-%m-%d}, {machine}"
        if importlib.util.find_spec("filterpy") is None:
            console.print("filterpy is not installed: skipping its comparisons (pip install filterpy)")
        found: list[Measurement] = []
        with progress_display(console) as progress:
            task = progress.add_task("Measuring", total=len(self.groups), note="")
            for group in self.groups:
                for measurement in GROUPS[group]():
                    found.append(measurement)
                    progress.update(task, note=measurement.name)
                progress.advance(task)
            progress.update(task, note="")
        console.print(table(found, title))
        write_json(folder / "bench.json", {"title": title, "measurements": [asdict(one) for one in found]})
        with atomic_file(folder / "bench.md") as part:
            part.write_text(markdown(found, title), encoding="utf-8")
        draw(found, title, folder / "bench.png")
        console.print(f"Files in {folder}: bench.json, bench.md, bench.png", markup=False, highlight=False)
