"""The part of `hybridtrack compare` for recorded flights."""

from pathlib import Path

from rich.console import Console

from agents.comparison.figures import flight_figure
from agents.comparison.flights_report import (
    differences_table,
    flights_json,
    flights_table,
    late_table,
    sensitivity_table,
)
from agents.comparison.flights_study import FlightPlan, compare_on_flights, steps
from agents.figures.canvas import save_figure
from agents.interface.output_files import output_folder, write_json
from agents.interface.progress import progress_display
from baselines.recordings.flights.metrics import figures


def run_flight_comparison(plan: FlightPlan, out: Path) -> None:
    """Compare, print the tables and write flights.json and a picture of each flight.

    Raises:
        ArgumentError: a name is unknown, there are no samples, or the output folder cannot be written.
    """
    plan.check()
    console = Console(emoji=False)
    with progress_display(console) as progress:
        task = progress.add_task("Flights", total=steps(plan) + 1, note="")

        def note(text: str) -> None:
            progress.update(task, note=text, advance=1)

        result = compare_on_flights(plan, note)
        folder = output_folder("out", out)
        note("pictures")
        for k, flight in enumerate(result.flights):
            stated = {label: result.stated[name][k] for name, label in reversed(plan.labels.items())}
            first = next(iter(stated))
            values = figures([result.counts[list(plan.labels)[-1]][k]])
            title = f"{flight.identity}, tier {flight.tier.name}: {first} agrees {values.agreement:.1%}"
            picture = flight_figure(flight, result.labels[k], stated, title)
            save_figure(picture, folder / f"{flight.identity.replace(':', '-')}.png")
    write_json(folder / "flights.json", flights_json(result))
    console.print(flights_table(result))
    if len(plan.labels) > 1:
        console.print(differences_table(result))
    if result.plan.form == "native":
        console.print(late_table(result))
        console.print(sensitivity_table(result))
    console.print(f"Files in {folder}: flights.json, a picture of each flight", markup=False, highlight=False)
