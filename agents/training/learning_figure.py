"""The picture of a training: reward against seconds and against steps."""

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from agents.interface.decider_colours import COLOURS
from agents.interface.output_files import whole_file
from agents.training.learning_curve import REWARD_KEY, SPRT_KEY, learning_points
from agents.training.run_folder import read_metrics


def draw_learning(folder: Path, path: Path) -> None:
    """The learning curve of a run, and the SPRT at its best threshold as a line, as PNG."""
    canvas = Canvas(figsize=(10, 4), layout="constrained")
    FigureCanvasAgg(canvas)
    by_time, by_steps = canvas.subplots(1, 2, sharey=True)
    points = learning_points(read_metrics(folder))
    rewards, colour = [row[REWARD_KEY] for row in points], COLOURS[3]
    by_time.plot([row["seconds"] for row in points], rewards, "o-", ms=3.5, color=colour, label=folder.name)
    by_steps.plot([row["step"] / 1e6 for row in points], rewards, "o-", ms=3.5, color=colour)
    for axes, unit in ((by_time, "seconds of training"), (by_steps, "million environment steps")):
        if points:
            axes.axhline(
                points[-1][SPRT_KEY], color=COLOURS[0], linestyle="--", label="SPRT at its best threshold"
            )
        axes.set_xlabel(unit)
        axes.set_xlim(left=0)
        axes.grid(alpha=0.25)
        axes.spines[["top", "right"]].set_visible(False)
    by_time.set_ylabel("mean reward a segment")
    by_time.legend(frameon=False, loc="lower right")
    with whole_file(path) as part:
        canvas.savefig(part, dpi=120)
