"""Novospaskyi 2025: g-h and Kalman filters on simulated radar tracks of flights, and better filters
beside them.

A. Novospaskyi, "Analysis of the efficiency of GH and Kalman filters for tracking moving objects under
different noise models", master's thesis (in Ukrainian), National University of Kyiv-Mohyla Academy, 2025.

- `paths`, `vehicle`: Bezier curves and waypoints; limits, drag and guidance of the aircraft.
- `point_mass`, `quadrotor`, `flights`, `stored_flights`: the flights, by default of a point mass.
- `radars`: placement, scans, noise. `metrics`: errors as the thesis computes them.
- `filters`: the compared filters and their parameters. `tuning`: Optuna, resumable.
- `published`: the published values. `anomaly`: why KF CV fails in the thesis.
- `tasks`, `tables`, `study`: the work, its results, and `reproduce`.

What the thesis does not state is inferred from its unfiltered rows and its tables 3.1 to 3.4; each
constant says so where it stands.
"""

from baselines.papers.novospaskyi.study import RUNS, reproduce

__all__ = ["RUNS", "reproduce"]
