"""The compiled core: motion, noise, banks of Kalman filters, and the kernel that steps many tracks.

Every formula of the model is a scalar function in this folder, compiled by numba and also callable from
Python. `kernel` runs a tick in this order:

1. `true_object` moves the object with the formulas of `motion` and `noise`, and measures its position.
2. `published_bank` or `anchor_aware_bank` (selected in `bank_operations`) predicts and corrects every filter
   with the formulas of `kalman` or `extended_kalman`; `student_bank` has the robust likelihood,
   `irregular_ticks` a tick without a measurement, and `merging` the mean over the bank.
3. `observation_row` writes the observation.

`quickest_kernel` runs the tick with unknown switch moments: the same object, the bank of `imm_bank`, whose
filters are those of `coordinated_turn` and whose output is that of `imm_merging`, and the observation of
`quickest_row`. `online_kernel` runs the tick of both with a measurement from outside, without an object.

`kernels` has the compiled entry points, `kernel_arrays` the arrays at the addresses of their parameters, and
`first_estimate` the start of an episode. `records` and `quickest_records` define the data types,
`compilation` the compiler options, `elementary` vectorizable log, exp, sine and cosine, and `memory`
allocates aligned arrays.

The folder may import numpy, numba and its own files, nothing else of the project. After a change run
`pytest tests/hybrid_env` and `make bench ARGS="single vector"`.
"""
