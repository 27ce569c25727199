"""Filters that estimate a trajectory without decisions. `pieces` smooths along modes that are
known, `turns` filters turns whose radius is not, `forecast` looks ahead, and `mixture` joins normal
distributions. May import: `hybrid_env`. Never another room of `baselines`, nor `agents`.
"""
