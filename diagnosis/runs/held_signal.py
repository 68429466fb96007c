"""Integral of a signal that is held between edges, as a command is from its row to the next."""

import numpy as np


class Integral:
    """The integral of a signal that is constant between edges, and before and after them.

    Args:
        edges: (K + 1,) [s].
        values: (K, ...).
        before: (...), its value before the first edge.
    """

    def __init__(self, edges: np.ndarray, values: np.ndarray, before: np.ndarray) -> None:
        steps = like(np.diff(edges), values.ndim - 1)
        self.edges, self.values, self.before = edges, values, before
        self._sums = np.concatenate([0.0 * values[:1], np.cumsum(values * steps, axis=0)])

    def __call__(self, time: np.ndarray) -> np.ndarray:
        """The integral from the first edge to times (...) [s]."""
        time, first, last = np.asarray(time), self.edges[0], self.edges[-1]
        columns = self._sums.reshape(len(self._sums), -1).T
        inside = np.stack([np.interp(time, self.edges, column) for column in columns], axis=-1)
        further = self.before.ndim
        found = inside.reshape(*time.shape, *self.before.shape)
        found += like(np.minimum(time - first, 0.0), further) * self.before
        found += like(np.maximum(time - last, 0.0), further) * self.values[-1]
        return found


def like(x: np.ndarray, further: int) -> np.ndarray:
    """An array with further axes of length one behind its own."""
    return x.reshape(*x.shape, *[1] * further)
