"""Frames of an episode with unknown switch moments: truth, statements and probabilities."""

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from numpy.typing import NDArray

from hybrid_env.options import ModelOptions
from hybrid_env.rendering.evidence import EvidencePanel, probability_panel
from hybrid_env.rendering.evidence_axes import THRESHOLD_STYLE
from hybrid_env.rendering.figure import EpisodeFigure, Renderer
from hybrid_env.rendering.modes import mode_colour, mode_name
from hybrid_env.rendering.quickest_history import ACTIVE, QuickestHistory
from hybrid_env.rendering.track_axes import track_legend

RIBBONS = {"true": -0.12, "stated": -0.26}
"""Height of the ribbon of true modes and of that of stated modes, below the axis of probabilities."""


class ProbabilityAxes:
    """The artists of the right-hand panel: probabilities of the modes, true and stated modes as ribbons.

    Args:
        axes: empty axes.
        options: of the world.
        panel: label and threshold.

    Attributes:
        artists: artists that change from frame to frame, in drawing order.
    """

    def __init__(self, axes: Any, options: ModelOptions, panel: EvidencePanel):
        axes.set_ylim(-0.36, 1.05)
        axes.set_yticks(
            [*RIBBONS.values(), 0.0, 0.25, 0.5, 0.75, 1.0], [*RIBBONS, "0", "", "0.5", "", "1"], fontsize=8
        )
        axes.set_xlabel("time [ticks]", fontsize=9)
        axes.set_ylabel(panel.label, fontsize=9)
        for threshold in panel.thresholds:
            axes.axhline(threshold.levels[0], **THRESHOLD_STYLE)
        colours = [mode_colour(mode, options.radii) for mode in range(options.hypotheses)]
        self._curves = [axes.plot([], [], color=colour, linewidth=1.3)[0] for colour in colours]
        self._ribbons = {
            name: [
                axes.plot([], [], color=colour, linewidth=9, solid_capstyle="butt")[0] for colour in colours
            ]
            for name in RIBBONS
        }
        self.artists: list[Artist] = [*self._curves]
        for lines in self._ribbons.values():
            self.artists += lines

    def update(self, history: QuickestHistory) -> None:
        """Show the episode so far."""
        probabilities = history.probabilities
        time = np.arange(1.0, len(probabilities) + 1.0)
        for mode, curve in enumerate(self._curves):
            curve.set_data(time, probabilities[:, mode])
        modes: dict[str, NDArray[Any]] = {"true": history.true_modes, "stated": history.trace[:, ACTIVE]}
        edges = np.repeat(time, 2) + np.tile([-0.5, 0.5], len(time))
        for name, lines in self._ribbons.items():
            for mode, line in enumerate(lines):
                line.set_data(edges, np.where(np.repeat(modes[name] == mode, 2), RIBBONS[name], np.nan))


class QuickestFigure(EpisodeFigure):
    """The figure with both panels and the legends; see `EpisodeFigure`."""

    def _create_evidence(self, axes: Any, panel: EvidencePanel) -> ProbabilityAxes:
        return ProbabilityAxes(axes, self.options, panel)

    def _add_legends(self, panel: EvidencePanel) -> None:
        self._add_legend(track_legend(), 0.095)
        self._add_threshold_legend(panel)

    def _title_text(self, history: QuickestHistory) -> str:
        radii = self.options.radii
        parts = [f"tick {len(history.trace)}", f"true mode {mode_name(int(history.true_modes[-1]), radii)}"]
        stated = history.trace[:, ACTIVE]
        if len(stated) > 1:
            last = stated[-1] if history.finished else stated[-2]
            parts.append(f"last statement {mode_name(int(last), radii)}")
        return "  |  ".join(parts)


class QuickestRenderer(Renderer):
    """Draws an episode with unknown switch moments, frame by frame; see `Renderer`.

    Args:
        options: of the world.
        human: whether frames are shown in a window instead of being returned.
        panel: what the panel of probabilities shows; None shows those of the bank.
    """

    def __init__(self, options: ModelOptions, human: bool, panel: EvidencePanel | None = None):
        super().__init__(options, human, panel or probability_panel())

    def _create_figure(self) -> QuickestFigure:
        return QuickestFigure(self.options, self.panel)
