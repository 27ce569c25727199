"""Figure of ATE against multiple models: error, delay and wrong statements over the measurement
variance.
"""

from matplotlib.figure import Figure

from agents.figures.curves import Axis, Curve, Panel, curve_figure
from agents.figures.decider_colours import FURTHER_STYLES, decider_style
from studies.papers.multiple_models import COMPARED, MULTIPLE_MODELS, VARIANCES
from studies.papers.reproduction import Reproduction


def draw(result: Reproduction) -> dict[str, Figure]:
    """Return the figure by its file name."""
    styles = dict(zip(MULTIPLE_MODELS, FURTHER_STYLES, strict=False)) | {
        "ATE": decider_style("ATE (SPRT)")
    }
    variances = Axis("R, m²", log=True, ticks={variance: f"{variance:g}" for variance in VARIANCES})
    rows = []
    for metric in COMPARED:
        panels = []
        for title, found in result.examples.items():
            curves = []
            for name, estimates in found.items():
                style = styles.get(name) or decider_style(name)
                curves.append(Curve(name, style, VARIANCES, [one[metric] for one in estimates]))
            panels.append(Panel(title, variances, Axis(metric, log=metric == "nRMSE"), curves))
        rows.append(panels)
    return {"multiple_models.png": curve_figure(rows, (18.0, 12.0))}
