"""The compiled core: motion, noise, banks of filters, and the kernel that steps many tracks.

Every formula of the model is a scalar function in this folder, compiled by numba and also callable from Python. In a
tick of `kernel`, `true_object` moves the object with the formulas of `motion` and `noise` and measures its position,
for radars with those of `polar`; the bank in `banks` predicts and corrects every filter; `observation_row` writes the
observation. `quickest_kernel` runs the tick with unknown switch moments, `kernels` has the compiled entry points of
each bank. `state` declares all arrays and parameters once, with the records of `records`; `arrays` allocates them and
finds them in compiled code. `compilation` has the compiler options and checks numba's cache; `elementary` has
vectorizable log, exp, sine and cosine. The folder may import numpy, numba and its own files, nothing else of the
project.
"""
