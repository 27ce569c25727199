"""The compiled core. Every formula of the model is a scalar function, compiled by numba and also
callable from Python.

In a tick of `kernel`, `true_object` moves the object by `motion` and `noise` and measures it, for
radars by `polar`; the bank in `banks` predicts and corrects every filter; `observation_row` writes
the row. `quickest_kernel` runs the tick with unknown switch moments, `kernels` has the entry
points. `memory` declares, allocates and finds records, arrays and parameters.
`compilation` has the compiler options and checks numba's cache; `elementary` has log, exp, sine and
cosine. The folder imports numpy, numba and its own files.
"""
