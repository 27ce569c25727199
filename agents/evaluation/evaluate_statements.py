"""Evaluation of deciders of `HybridTrackQuickest-v0` at given thresholds: table and metrics."""

from dataclasses import replace
from typing import Any

from rich.console import Console

from agents.evaluation.statement_curve import REWARD, mean_of, sweep_statements
from agents.evaluation.statement_deciders import statement_decider
from agents.evaluation.statement_table import statement_figures, statement_table
from agents.interface.progress import progress_display
from hybrid_env.quickest_options import QuickestOptions
from hybrid_env.registration import make_track_vector_env


def evaluate_statements(
    deciders: tuple[str, ...], env_id: str, options: dict[str, Any], tracks: int, seed: int
) -> list[dict[str, Any]]:
    """Evaluate deciders on the same tracks, print a table, and return the metrics of each.

    Args:
        deciders: one or more names with optional thresholds, see `statement_decider`.
        env_id: registered id of an environment with unknown switch moments.
        options: of the environment.
        tracks: number of tracks of one episode each.
        seed: of the first track.

    Raises:
        ArgumentError: a name, a threshold or an option is not allowed.
    """
    world = make_track_vector_env(env_id, 1, **options).options
    assert isinstance(world, QuickestOptions)
    families = []
    for name in deciders:
        family, threshold, _ = statement_decider(name, world)
        families.append(replace(family, thresholds=(threshold,)))
    console = Console(emoji=False)
    curves = []
    with progress_display(console) as progress:
        task = progress.add_task("Evaluating", total=len(families), note="")
        for number, family in enumerate(families):
            progress.update(task, note=family.name)

            def show(share: float, finished: int = number) -> None:
                progress.update(task, completed=finished + share)

            curves.append(sweep_statements(family, world, tracks, seed, show))
        progress.update(task, note="")
    first = curves[0]
    differences = [None, *(curve.difference(first, mean_of(REWARD)) for curve in curves[1:])]
    figures = [statement_figures(curve) for curve in curves]
    title = f"{env_id.rpartition(':')[2]}: {tracks:,} tracks of {world.ticks:,} ticks"
    console.print(statement_table(figures, title, "", differences, figures[0].name))
    return [
        {"decider": name, "tracks": tracks} | one.as_json()
        for name, one in zip(deciders, figures, strict=True)
    ]
