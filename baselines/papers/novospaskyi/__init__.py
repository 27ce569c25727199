"""Novospaskyi 2025: g-h and Kalman filters on simulated radar tracks of flights, and better filters
beside them.

A. Novospaskyi, "Analysis of the efficiency of GH and Kalman filters for tracking moving objects under
different noise models", master's thesis (in Ukrainian), National University of Kyiv-Mohyla Academy, 2025.

- `flights`: random curves, the aircraft, and a point mass that flies them.
- `radars`: placement, scans, noise, and errors as the thesis computes them.
- `filters`: the compared filters. `tuning`: their parameters by Optuna, resumable.
- `dataset`: flights and measurements as files. `scores`: errors and forecasts of filters on them.
- `study`: `reproduce`. `tables`: the published values, the results, and why KF CV fails in the thesis.

What the thesis does not state is inferred from its unfiltered rows and its tables 3.1 to 3.4; each
constant says so where it stands.
"""

from typing import Any

__all__ = ["RUNS", "reproduce"]


def __getattr__(name: str) -> Any:
    """Import the study when it is needed: the data set does not need Optuna."""
    if name not in __all__:
        raise AttributeError(name)
    from baselines.papers.novospaskyi import study

    return getattr(study, name)
