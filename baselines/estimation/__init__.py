"""Filters that estimate a trajectory without decisions.

All filters of kinematic models have the interface of `track_filter.TrackFilter`; `run_filter.run_filter` runs one over
a recording (T, B, d) with times (T,) or (T, B), and `smoother.smooth` its output backwards.

    cv = KalmanFilter(MotionModel("CV", axes=3, noise=1.0), 25.0, start_deviations=(50.0,), robust=StudentT())
    filtered = run_filter(cv, measurements, times)             # .positions, .velocities, .log_likelihoods

`turns` and `turn_beam` state modes of recorded flights by filters for known turn rates.

May import: `hybrid_env`. Never another room of `baselines`, nor `agents`.
"""
