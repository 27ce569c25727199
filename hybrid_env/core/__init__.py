"""The compiled core. Every formula of the model is a scalar function, compiled by numba; most can
also be called from Python.

In a tick of `kernel`, `true_object` moves the object by `motion` and `noise` and measures it, for
radars by `polar`; the bank in `banks` predicts and corrects every filter; `observation_row` writes
the row. `announced` and `unknown` say what is done to a track with announced and with unknown
switches, `kernels` has the entry points. `memory` declares, allocates and finds records, arrays and
parameters. `compilation` has the compiler options and the folder of numba's cache; `bitcode` has
kernels compiled by a build; `elementary` has log, exp, sine and cosine; `vectors` has vectors and
symmetric matrices as tuples, and `arrays` the types of arrays. The folder imports numpy, numba with
its llvmlite, and its own files.
"""
