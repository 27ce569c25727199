"""Filters that estimate a trajectory without decisions.

All filters of kinematic models have the interface of `track_filter.TrackFilter`; `run_filter.run_filter` runs one over
a recording (T, B, d) with times (T,) or (T, B).

    model = MotionModel("CV", axes=3, noise=1.0)               # motion_models: CV, CA, CJ
    cv = KalmanFilter(model, noise=25.0, start_deviations=(50.0,), robust=StudentT())     # kalman, robust
    filtered = run_filter(cv, measurements, times)             # .positions, .velocities, .log_likelihoods
    smoothed = smooth(model, filtered, times)                  # smoother: fixed interval

Besides `kalman` there are `imm`, `particles`, and `multiple_models` for turns of known radii. `turns` and `turn_beam`
state modes of recorded flights by filters for known turn rates.

May import: `hybrid_env`. Never another room of `baselines`, nor `agents`.
"""
