"""What several studies do with their calls and results: many at once, then files."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import joblib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.progress import track

from baselines import Estimate


def in_parallel(calls: Sequence[Any], jobs: int, stage: str) -> list[Any]:
    """Return the results of `joblib.delayed` calls in their order; -1 jobs are one on each core."""
    with joblib.parallel_config(backend="loky", n_jobs=jobs, inner_max_num_threads=1):
        results = joblib.Parallel(return_as="generator")(calls)
        return list(track(results, stage, len(calls)))


def save_results(path: Path, text: str, content: Any, figure: Figure | None = None) -> None:
    """Print a text, and write it, its values and a figure, a file each: path.md, .json, .png."""
    print(text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.with_suffix(".md").write_text(text, encoding="utf-8")
    values = json.dumps(content, indent=2, default=Estimate.as_json)
    path.with_suffix(".json").write_text(values + "\n", encoding="utf-8")
    if figure is not None:
        figure.savefig(path.with_suffix(".png"))
    print(f"Files: {path}.md, .json{', .png' if figure else ''}")


def draw_estimates(
    axes: Axes, places: Any, estimates: Sequence[Estimate], horizontal: bool = False, **style: Any
) -> None:
    """Draw estimates with their intervals over places (n,), or beside them."""
    value, low, high = np.array([[*vars(estimate).values()] for estimate in estimates]).T
    bars = value - low, high - value
    if horizontal:
        axes.errorbar(value, places, xerr=bars, **style)
    else:
        axes.errorbar(places, value, yerr=bars, **style)


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    head, *lines = (f"| {' | '.join(row)} |\n" for row in (heads, *rows))
    return "".join([head, "|" + "---|" * len(heads) + "\n", *lines])


def with_half(estimate: Estimate, digits: int = 3, sign: str = "") -> str:
    """Return the value of an estimate and half the width of its interval; "+" shows the sign."""
    half = 0.5 * (estimate.high - estimate.low)
    return f"{estimate.value:{sign}.{digits}f} ± {half:.{digits}f}"


def in_brackets(estimate: Estimate, digits: int, sign: str = "") -> str:
    """Return the value of an estimate with its confidence interval in one line; "+" shows the
    signs.
    """
    value, low, high = (f"{number:{sign}.{digits}f}" for number in vars(estimate).values())
    return f"{value} [{low}, {high}]" if np.isfinite(estimate.value) else "not reached"
