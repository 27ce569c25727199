"""Figure of the learning curve of a training run."""

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.layout_engine import ConstrainedLayoutEngine

from agents.figures.curve_labels import label_curves
from agents.figures.decider_colours import decider_style
from agents.interface.output_files import atomic_file
from agents.training.learning_curve import REWARD_KEY, LearningCurve, learning_points
from agents.training.run_folder import read_metrics


def draw_learning_curve(folder: Path, path: Path, curve: LearningCurve) -> None:
    """Write the mean reward of a run against training time and environment steps as PNG.

    Args:
        folder: run folder.
        path: of the figure.
        curve: of the run. A dashed line is its classical rule at the best threshold.
    """
    canvas = Canvas(figsize=(10, 4), layout=ConstrainedLayoutEngine(wspace=0.05), dpi=120)
    FigureCanvasAgg(canvas)
    points = learning_points(read_metrics(folder))
    rewards = [row[REWARD_KEY] for row in points]
    agent, reference = decider_style(folder.name), decider_style(curve.wording.rule)
    columns = {
        "training time, s": [row["seconds"] for row in points],
        "environment steps, millions": [row["step"] / 1e6 for row in points],
    }
    panels = canvas.subplots(1, len(columns), sharey=True)
    curves = []
    for axes, (label, values) in zip(panels, columns.items(), strict=True):
        lines = axes.plot(values, rewards, marker=agent.marker, markersize=3.5, color=agent.colour)
        names = [folder.name]
        if points:
            level = points[-1][curve.reference_key]
            lines.append(axes.axhline(level, color=reference.colour, linestyle="--"))
            names.append(f"{curve.wording.rule} at its best threshold")
        curves.append(list(zip(lines, names, strict=True)))
        axes.set_xlabel(label)
        axes.set_xlim(left=0)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel(f"mean reward per {curve.wording.unit}")
    if points:
        for axes, named in zip(panels, curves, strict=True):
            label_curves(axes, named)
    with atomic_file(path) as part:
        canvas.savefig(part)
