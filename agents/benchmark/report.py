"""Measurements as a table, as Markdown and as a figure."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from rich import box
from rich.table import Table

from agents.benchmark.timing import Measurement
from agents.interface.output_files import atomic_file


def _words(one: Measurement) -> tuple[str, str, str, str, str]:
    spread = "" if one.low == one.high else f"{one.low:.3g} to {one.high:.3g}"
    goal = "" if one.goal is None else f"{'<=' if one.at_most else '>='} {one.goal:g}"
    return (
        f"{one.value:,.3g} {one.unit}".strip(),
        spread,
        goal,
        {True: "met", False: "not met", None: ""}[one.met],
        one.detail,
    )


def table(found: Sequence[Measurement], title: str) -> Table:
    """For the terminal."""
    made = Table(title=title, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for head in ("measurement", "median", "range", "goal", ""):
        made.add_column(
            head, justify="left" if head == "measurement" else "right", no_wrap=head != "measurement"
        )
    group = ""
    for one in found:
        if one.group != group:
            made.add_section()
            made.add_row(f"[bold]{one.group}[/]")
            group = one.group
        value, spread, goal, met, _ = _words(one)
        style = {"met": "green", "not met": "red"}.get(met, "")
        made.add_row(f"  {one.name}", value, spread, goal, f"[{style}]{met}[/]" if style else "")
    return made


def markdown(found: Sequence[Measurement], title: str) -> str:
    """The same as Markdown, with absolute times."""
    lines = [
        f"{title}.",
        "",
        "| measurement | median | range | goal | | times |",
        "|---|---|---|---|---|---|",
    ]
    lines += [f"| {one.group}: {one.name} | " + " | ".join(_words(one)) + " |" for one in found]
    return "\n".join(lines) + "\n"


def draw(found: Sequence[Measurement], title: str, path: Path) -> None:
    """Speed ratios as bars on a logarithmic axis, with their goals as marks."""
    ratios = [one for one in found if one.unit == "x"]
    figure = Figure(figsize=(11, 1.2 + 0.3 * max(len(ratios), 3)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    places = range(len(ratios))
    colours = ["#bbbbbb" if one.met is None else "#228833" if one.met else "#ee6677" for one in ratios]
    axes.barh(places, [one.value for one in ratios], color=colours, height=0.7)
    goals = [(place, one.goal) for place, one in zip(places, ratios, strict=True) if one.goal is not None]
    if goals:
        axes.plot(
            [goal for _, goal in goals], [place for place, _ in goals], "k|", markersize=12, label="goal"
        )
        axes.legend(loc="lower right", frameon=False)
    axes.set_xscale("log")
    axes.axvline(1.0, color="0.5", linewidth=0.8)
    axes.set_yticks(list(places), [f"{one.group}: {one.name}" for one in ratios], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("speed ratio, ours over theirs")
    axes.set_title(title)
    axes.spines[["top", "right"]].set_visible(False)
    with atomic_file(path) as part:
        figure.savefig(part, dpi=110)
