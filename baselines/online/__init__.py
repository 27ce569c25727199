"""The deciders on a live sensor, one measurement at a time.

`tracker` has the object that takes a measurement and gives mode, probabilities, estimate and covariance;
`start` has the first estimate from the first measurements.

May import: `hybrid_env`, `baselines.deciders`. Never `agents`.
"""
