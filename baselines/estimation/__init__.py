"""Filters that estimate a trajectory without decisions.

All filters of kinematic models have one interface, `track_filter.TrackFilter`, for B tracks at once: `begin(B)` or
`begin_from(state, covariance)`, then `predict(dt)` and `update(measurement)` at every moment, and after it `state` (B,
n), `covariance` (B, n, n), `log_likelihood` (B,) and `nis` (B,). A state lists position and derivatives axis by axis. A
measurement is (B, d), NaN where it is missing; its covariance is a number, (d,), (d, d) or (B, d, d).
`run_filter.run_filter` runs a filter over a recording (T, B, d) with times (T,) or (T, B).

    model = MotionModel("CV", axes=3, noise=1.0)               # motion_models: CV, CA, CJ
    cv = KalmanFilter(model, noise=25.0, start_deviations=(50.0,), robust=StudentT())     # kalman, robust
    filtered = run_filter(cv, measurements, times)             # .positions, .velocities, .log_likelihoods
    smoothed = smooth(model, filtered, times)                  # smoother: fixed interval

Besides `kalman` there is `imm`, and `multiple_models` for turns of known radii. `correction` corrects by one component
of a measurement after the other. `turns` and `turn_beam` state modes of recorded flights by filters for known turn
rates.

May import: `hybrid_env`. Never another room of `baselines`, nor `agents`.
"""
