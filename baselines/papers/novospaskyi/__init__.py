"""Novospaskyi 2025: g-h and Kalman filters on simulated radar tracks of flights, and better filters
beside them. A. Novospaskyi, "Analysis of the efficiency of GH and Kalman filters for tracking
moving objects under different noise models", master's thesis (in Ukrainian), National University of
Kyiv-Mohyla Academy, 2025. What it does not state is inferred from its unfiltered rows and its
tables 3.1 to 3.4; each constant says so.
"""

from typing import Any


def reproduce(*args: Any, **options: Any) -> Any:
    """`study.reproduce`, imported when it is called: the data set does not need Optuna."""
    from baselines.papers.novospaskyi import study

    return study.reproduce(*args, **options)
