"""Filters that estimate a trajectory without decisions. All filters of kinematic models have the
interface of `track_filter.TrackFilter`; `run_filter.run_filter` runs one over a recording (T, B,
d), and `smoother.smooth` its output backwards. `pieces` smooths along modes that are known, and
`turns` filters turns whose radius is not. May import: `hybrid_env`. Never another room of
`baselines`, nor `agents`.
"""
