"""Uncertainty of the model error by commands of rows that are missing.

Commands are held from each row to the next. Where m rows of period h are missing between two, a command
that changed may have done so in any of them: the later one acted for 0, h ... or m h [s] before its own
row, each as likely as the others, h^2 m (2 m + 1) / 6 in the mean square.
"""

import numpy as np

from ..runs.row_order import missing_rows
from .ship_model import Model
from .weak_form import WeakWindows


def command_variance(w: WeakWindows, model: Model) -> np.ndarray:
    """Variance (K, 3) of the model error by commands of missing rows [N2, N2, N2 m2]; 0 without any."""
    step = np.diff(w.run.time)
    missing = missing_rows(w.run.time)
    early = float(np.median(step)) ** 2 * missing * (2.0 * missing + 1.0) / 6.0
    change = np.diff(w.run.tau_cmd @ model.effective_thrust.T, axis=0)
    square = early[:, None] * (change / step[:, None]) ** 2
    return np.asarray(w.held[:, :-1].power(2) @ square)
