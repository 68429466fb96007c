"""The smallest eigenvalue of symmetric matrices in a fixed number of operations.

Householder's tridiagonal form, and Sturm's test in a bisection: the test alone tells whether a matrix
exceeds a bound, at a fraction of the cost of an eigenvalue, and twenty parameters stay affordable.
"""

from collections.abc import Sequence

from ..ops import Condition, Number, fmax, fmin, kernel, sqrt, where

Matrix = Sequence[Sequence[Number]]
# Diagonal and squared off-diagonal of a tridiagonal matrix.
Tridiagonal = tuple[list[Number], list[Number]]

HALVINGS = 50
# A divisor that would be smaller counts as this.
TINY = 1e-150


def dot(a: Sequence[Number], b: Sequence[Number]) -> Number:
    """Sum of products; ``sum`` would round differently from one Python to the next."""
    total = 0.0
    for x, y in zip(a, b, strict=True):
        total = total + x * y
    return total


@kernel
def tridiagonal(matrix: Matrix) -> Tridiagonal:
    """A symmetric matrix (n, n) in tridiagonal form, by Householder's reflections."""
    rest = [list(row) for row in matrix]
    diagonal: list[Number] = []
    squares: list[Number] = []
    while len(rest) > 2:
        diagonal.append(rest[0][0])
        v = rest[0][1:]
        square = dot(v, v)
        squares.append(square)
        norm = sqrt(square)
        v[0] = v[0] + where(v[0] > 0.0, norm, -norm)
        factor = 2.0 / fmax(dot(v, v), TINY)
        rest = [row[1:] for row in rest[1:]]
        w = [factor * dot(row, v) for row in rest]
        half = 0.5 * factor * dot(v, w)
        w = [x - half * y for x, y in zip(w, v, strict=True)]
        for i, row in enumerate(rest):
            for j in range(i + 1):
                row[j] = rest[j][i] = row[j] - v[i] * w[j] - w[i] * v[j]
    diagonal += [row[k] for k, row in enumerate(rest)]
    squares += [row[0] * row[0] for row in rest[1:]]
    return diagonal, squares


def exceed(matrices: Sequence[Tridiagonal], bound: Number) -> Condition:
    """True where all eigenvalues of all matrices are above the bound: all pivots are positive."""
    least = 1.0
    for diagonal, squares in matrices:
        pivot = diagonal[0] - bound
        least = fmin(least, pivot)
        for d, square in zip(diagonal[1:], squares, strict=True):
            pivot = d - bound - square / fmax(pivot, TINY)
            least = fmin(least, pivot)
    return least > 0.0


@kernel
def smallest(matrices: Sequence[Tridiagonal], low: Number = 0.0) -> Number:
    """The smallest of all eigenvalues of all matrices, if above ``low``; else ``low``."""
    high = matrices[0][0][0]
    for diagonal, _ in matrices:
        for d in diagonal:
            high = fmin(high, d)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        above = exceed(matrices, middle)
        low = where(above, middle, low)
        high = where(above, high, middle)
    return low
