"""The compiled core: motion, noise, Kalman banks, and the kernel that steps many tracks.

Every formula of the model is a scalar function here, compiled by numba and callable from Python too. Data
flows through one tick in this order: `kernel` -> `motion` moves the object -> `noise` perturbs it ->
`published_bank` or `anchor_aware_bank` (chosen in `bank_operations`) predict and correct ->
`observation_row` writes what the policy reads. `records` holds the data types, `compilation` says how
functions are compiled, `elementary` has log, exp, sine and cosine that vectorise, `memory` allocates
aligned arrays.

May import: numpy, numba, and files of this folder. Nothing else of the project. A change here is a change
of compiled code: run `pytest tests/hybrid_env` and `hybridtrack bench single vector`.
"""
