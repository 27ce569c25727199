"""Command line of the study: `python -m studies.filters`."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from filterpy.common import Q_continuous_white_noise
from filterpy.kalman import IMMEstimator
from filterpy.kalman import KalmanFilter as FilterpyKalman

from agents import run_command
from studies.filters.imm import IMMFilter
from studies.filters.kalman import KalmanFilter
from studies.filters.motion_models import MotionModel
from studies.results import markdown_table, save_results

# Spectral densities of the white acceleration of a steady and an agile model [m^2/s^3].
NOISES = (0.01, 1.0)


def both() -> tuple[IMMFilter, Any]:
    """Return the IMM filter of a steady and an agile model on one axis, and that of filterpy."""
    ours = IMMFilter(
        [KalmanFilter(MotionModel("CV", 1, noise), 1.0) for noise in NOISES], sojourns=10.0
    )
    ours.begin_from([[0.0, 1.0]], np.eye(2))
    peers = []
    for noise in NOISES:
        peer = FilterpyKalman(dim_x=2, dim_z=1)
        peer.x, peer.P = np.array([[0.0], [1.0]]), np.eye(2)
        peer.F = np.array([[1.0, 1.0], [0.0, 1.0]])
        peer.H = np.array([[1.0, 0.0]])
        peer.Q = Q_continuous_white_noise(2, 1.0, noise)
        peers.append(peer)
    return ours, IMMEstimator(peers, ours.probabilities[0], ours.transition(1.0))


def agile(deviations: float, steps: int = 20) -> tuple[float, float]:
    """Return the probability of the agile model by filterpy and by ours, after measurements at 1
    m/s of which the last one lies some standard deviations from the prediction of this model.
    """
    ours, peer = both()
    for k in range(1, steps + 1):
        ours.predict(1.0)
        peer.predict()
        measured = float(k)
        if k == steps:
            model = ours.filters[1]
            spread = np.sqrt(model.covariance[0, 0, 0] + 1.0)
            measured = model.state[0, 0] + deviations * spread
        ours.update([[measured]])
        peer.update(np.array([[measured]]))
    return float(peer.mu[1]), float(ours.probabilities[0, 1])


@dataclass(kw_only=True)
class Filters:
    """Put an outlier into the IMM filters of filterpy and of this study."""

    out: Path = Path("results")
    """Folder for filters.md and filters.json."""

    def run(self) -> None:
        """Print the table and write the files."""
        rows = [(deviations, *agile(deviations)) for deviations in (2.0, 5.0, 30.0, 40.0, 60.0)]
        heads = ["standard deviations", "P(agile), filterpy", "P(agile), here"]
        cells = [[f"{each:g}", f"{peer:.4f}", f"{ours:.4f}"] for each, peer, ours in rows]
        save_results(self.out / "filters", markdown_table(heads, cells), rows)


if __name__ == "__main__":
    sys.exit(run_command(Filters, "python -m studies.filters"))
