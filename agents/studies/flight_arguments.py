"""The part of `hybridtrack compare` for recorded flights: its flags, and what is done with them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(kw_only=True)
class FlightArguments:
    """Flags of recorded flights."""

    flights: tuple[str, ...] | None = None
    """Compare on recorded flights of the package 'traffic': without a value on those of the tiers, else on
    these ids file:icao24:k."""
    source: Path | None = None
    """With --flights: folder or wheel of the package 'traffic'; by default where it is installed."""
    tier: tuple[str, ...] = ("A", "B", "C", "D", "stress")
    """With --flights: tiers of quality, and flights with special manoeuvres, which no total contains."""
    form: Literal["native", "semi-real"] = "native"
    """With --flights: as reported, or the smoothed flight with white noise in the setting of
    HybridTrackQuickest-v0, whose deciders are then compared, 'shipped' among them."""

    def compare_flights(self, deciders: tuple[str, ...], out: Path) -> None:
        """Compare, print the tables and write flights.json and a picture of each flight.

        Args:
            deciders: names with optional thresholds; without any the default ones.
            out: output folder.

        Raises:
            ArgumentError: a name is unknown, there are no samples, or the output folder cannot be written.
        """
        from rich.console import Console

        from agents.evaluation.flights import FlightTask
        from agents.figures.canvas import save_figure
        from agents.interface.output_files import output_folder, write_json
        from agents.interface.progress import progress_display
        from agents.studies.flights_report import flight_figure, flight_tables, flights_json
        from agents.studies.flights_study import compare_on_flights, steps
        from baselines.recordings.flights.metrics import STATISTICS
        from hybrid_env.checks import reject

        task = FlightTask(self.source, self.flights or (), self.tier, self.form)
        task.check()
        if len(set(deciders)) < len(deciders):
            raise reject("deciders", deciders, "different names")
        names = {name: task.label(name) for name in deciders or task.compared}
        console = Console(emoji=False)
        with progress_display(console) as progress:
            bar = progress.add_task("Flights", total=steps(task, len(names)) + 1, note="")

            def note(text: str) -> None:
                progress.update(bar, note=text, advance=1)

            result = compare_on_flights(task, names, note)
            folder = output_folder("out", out)
            note("pictures")
            agreements = list(result.scores.values())[-1].some
            for k, flight in enumerate(result.flights):
                stated = {label: result.stated[name][k] for name, label in reversed(names.items())}
                agreement = float(agreements([k]).curve(STATISTICS["agreement"])[0])
                title = (
                    f"{flight.identity}, tier {flight.tier.name}: {next(iter(stated))} agrees {agreement:.1%}"
                )
                path = folder / f"{flight.identity.replace(':', '-')}.png"
                save_figure(flight_figure(flight, result.labels[k], stated, title), path)
        write_json(folder / "flights.json", flights_json(result))
        for table in flight_tables(result):
            console.print(table)
        console.print(
            f"Files in {folder}: flights.json, a picture of each flight", markup=False, highlight=False
        )
