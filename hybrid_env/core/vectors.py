"""Vectors and symmetric matrices in compiled code: tuples of numbers, and upper triangles row by
row. numba compiles a loop over a tuple as a loop over memory, which does not become SIMD code; each
of these functions is one instruction for every number.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import combinations_with_replacement
from typing import Any

from numba import types

from hybrid_env.core.compilation import intrinsic

Vector = tuple[float, ...]


def _code(result: Any, arguments: Sequence[Any], compute: Callable[..., Any]) -> Any:
    """Return the signature and the code of an intrinsic. compute: builds the instructions from the
    builder and the arguments, and returns the result; tuples are lists.
    """

    def unpacked(builder: Any, kind: Any, value: Any) -> Any:
        if not isinstance(kind, types.BaseTuple):
            return value
        parts: Any = kind
        values = [builder.extract_value(value, k) for k in range(len(parts))]
        return [unpacked(builder, *pair) for pair in zip(parts, values, strict=True)]

    def packed(context: Any, builder: Any, kind: Any, values: Any) -> Any:
        if not isinstance(kind, types.BaseTuple):
            return values
        kinds: Any = kind
        parts = zip(kinds, values, strict=True)
        return context.make_tuple(
            builder, kind, [packed(context, builder, *pair) for pair in parts]
        )

    def build(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        pairs = zip(arguments, values, strict=True)
        lists = [unpacked(builder, kind, value) for kind, value in pairs]
        return packed(context, builder, result, compute(builder, *lists))

    return result(*arguments), build


@intrinsic
def choose(_typing: Any, condition: Any, vector: Any, other: Any) -> Any:
    """Return the vector where the condition is True, else the other one, without a branch."""

    def compute(builder: Any, chosen: Any, values: Any, others: Any) -> Any:
        return [builder.select(chosen, *pair) for pair in zip(values, others, strict=True)]

    return _code(vector, (condition, vector, other), compute)


@intrinsic
def combination(_typing: Any, factors: Any, vectors: Any) -> Any:
    """Return a u + b v + ... of factors (a, b, ...) and vectors (u, v, ...)."""

    def compute(builder: Any, factors: Any, vectors: Any) -> Any:
        pairs = zip(factors, vectors, strict=True)
        terms = [[builder.fmul(factor, value) for value in vector] for factor, vector in pairs]
        return [reduce(builder.fadd, values) for values in zip(*terms, strict=True)]

    return _code(vectors[0], (factors, vectors), compute)


@intrinsic
def transposed(_typing: Any, rows: Any) -> Any:
    """Return the columns of a matrix from its rows."""
    column = types.UniTuple(types.float64, len(rows))
    result = types.UniTuple(column, len(rows[0]))
    return _code(result, (rows,), lambda _, values: list(zip(*values, strict=True)))


def _symmetric(entries: Sequence[Any]) -> list[list[Any]]:
    """Return the rows of a symmetric matrix from its upper triangle."""
    n = next(n for n in range(len(entries)) if n * (n + 1) == 2 * len(entries))
    places = list(combinations_with_replacement(range(n), 2))
    return [[entries[places.index((min(i, k), max(i, k)))] for k in range(n)] for i in range(n)]


def _dot(builder: Any, vector: Sequence[Any], other: Sequence[Any]) -> Any:
    """Return the inner product of two vectors."""
    pairs = zip(vector, other, strict=True)
    return reduce(builder.fadd, [builder.fmul(*pair) for pair in pairs])


@intrinsic
def rows_of(_typing: Any, triangle: Any) -> Any:
    """Return the rows of a symmetric matrix."""
    n = len(_symmetric(range(len(triangle))))
    row = types.UniTuple(types.float64, n)
    matrix = types.UniTuple(row, n)
    return _code(matrix, (triangle,), lambda _, entries: _symmetric(entries))


@intrinsic
def widened(_typing: Any, triangle: Any) -> Any:
    """Return a covariance with variances that are larger by a bound of the rounding errors of a
    prediction or correction. What is calculated from it is positive semidefinite in spite of them.
    """

    def compute(builder: Any, entries: Any) -> Any:
        result = list(entries)
        for k, row in enumerate(_symmetric(range(len(entries)))):
            variance = entries[row[k]]
            result[row[k]] = builder.fmul(variance, variance.type(1.0 + 1e-14))
        return result

    return _code(triangle, (triangle,), compute)


def resized(states: int) -> Any:
    """Return the compiled function of the covariance of some states that returns that of the first
    `states` of them, or of so many of which the last ones have no variance.
    """

    @intrinsic
    def resize(_typing: Any, triangle: Any) -> Any:
        result = types.UniTuple(types.float64, states * (states + 1) // 2)

        def compute(_builder: Any, entries: Any) -> Any:
            given = len(_symmetric(entries))
            pairs = combinations_with_replacement(range(states), 2)
            nothing = entries[0].type(0.0)
            return [_symmetric(entries)[i][k] if k < given else nothing for i, k in pairs]

        return _code(result, (triangle,), compute)

    return resize


def conditioned(state: int) -> Any:
    """Return the compiled function (P, p, R / sigma, 1 / sigma) of a covariance P, its row p of a
    state that is measured with the variance R, and sigma = p_state + R: P - p p' / sigma, whose row
    of the state is p R / sigma, which avoids cancellation.
    """

    @intrinsic
    def condition(_typing: Any, triangle: Any, row: Any, left: Any, inverse: Any) -> Any:
        def compute(builder: Any, entries: Any, values: Any, left: Any, inverse: Any) -> Any:
            scaled = [builder.fmul(value, inverse) for value in values]
            result = []
            pairs = combinations_with_replacement(range(len(values)), 2)
            for entry, (i, k) in zip(entries, pairs, strict=True):
                if state in (i, k):
                    result.append(builder.fmul(values[k if i == state else i], left))
                else:
                    result.append(builder.fsub(entry, builder.fmul(scaled[i], values[k])))
            return result

        return _code(triangle, (triangle, row, left, inverse), compute)

    return condition


@intrinsic
def upper_triangle(_typing: Any, rows: Any) -> Any:
    """Return the triangle of a symmetric matrix from its rows."""
    pairs = list(combinations_with_replacement(range(len(rows)), 2))
    result = types.UniTuple(types.float64, len(pairs))
    return _code(result, (rows,), lambda _, values: [values[k][i] for i, k in pairs])


@intrinsic
def minus_square(_typing: Any, triangle: Any, vector: Any, factor: Any) -> Any:
    """Return P - factor v v' of a symmetric matrix P and a vector v."""

    def compute(builder: Any, entries: Any, values: Any, factor: Any) -> Any:
        scaled = [builder.fmul(value, factor) for value in values]
        products = [
            builder.fmul(scaled[i], values[k])
            for i, k in combinations_with_replacement(range(len(values)), 2)
        ]
        return [builder.fsub(*pair) for pair in zip(entries, products, strict=True)]

    return _code(triangle, (triangle, vector, factor), compute)


@intrinsic
def product(_typing: Any, rows: Any, vector: Any) -> Any:
    """Return A v of a matrix A, given by its rows, and a vector v."""

    def compute(builder: Any, rows: Any, values: Any) -> Any:
        return [_dot(builder, row, values) for row in rows]

    return _code(types.UniTuple(types.float64, len(rows)), (rows, vector), compute)


@intrinsic
def sandwich(_typing: Any, rows: Any, triangle: Any) -> Any:
    """Return A P A' of a matrix A, given by its rows, and a symmetric matrix P, both (n, n)."""

    def compute(builder: Any, rows: Any, entries: Any) -> Any:
        left = [[_dot(builder, row, column) for column in _symmetric(entries)] for row in rows]
        places = combinations_with_replacement(range(len(rows)), 2)
        return [_dot(builder, left[i], rows[k]) for i, k in places]

    return _code(triangle, (rows, triangle), compute)
