"""Sums of squares over intervals of cells, from sums that are made once.

With d_j 1 in the cells j of some intervals and 0 elsewhere, |C d|^2 and B d take a few additions for
each interval, however long it is: C^T C has a band of the width of a window, and its sums up to each row
and column are kept.
"""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csc_matrix

Spans = Sequence[tuple[int, int]]


class IntervalSums:
    """|C d|^2 and B d of intervals.

    Args:
        columns: C (n, m), one column a cell.
        further: B (p, m).
    """

    def __init__(self, columns: csc_matrix, further: np.ndarray) -> None:
        gram = (columns.T @ columns).tocoo()
        apart = gram.row - gram.col
        lower = apart >= 0
        self.band = int(apart.max(initial=0))
        size = further.shape[1]
        # Column d: the sum of a row up to the d-th place before the diagonal, itself included.
        rows = np.zeros((size, self.band + 2))
        rows[gram.row[lower], apart[lower]] = gram.data[lower]
        diagonal = rows[:, 0].copy()
        self.rows = np.cumsum(rows[:, ::-1], axis=1)[:, ::-1]
        self.squares = np.concatenate([[0.0], np.cumsum(diagonal + 2.0 * self.rows[:, 1])])
        self.further = np.concatenate([np.zeros((len(further), 1)), np.cumsum(further, axis=1)], axis=1)

    def linear(self, spans: Spans) -> np.ndarray:
        """B d (p,) of intervals, the end of each not included."""
        ends = np.array(spans, int).reshape(-1, 2)
        return (self.further[:, ends[:, 1]] - self.further[:, ends[:, 0]]).sum(axis=1)

    def square(self, spans: Spans) -> float:
        """|C d|^2 of intervals of which no two have a cell in common."""
        found, spans = 0.0, sorted(spans)
        for k, (a, b) in enumerate(spans):
            found += self.squares[b] - self.squares[a] - 2.0 * self._before(a, b, a)
            for c, d in spans[:k]:
                if d > a - self.band:
                    found += 2.0 * (self._before(a, b, d) - self._before(a, b, c))
        return float(found)

    def _before(self, a: int, b: int, c: int) -> float:
        """Sum of C^T C over rows from a up to b and columns up to c, which is no more than a."""
        i = np.arange(a, min(b, c + self.band))
        return self.rows[i, i - c + 1].sum()
