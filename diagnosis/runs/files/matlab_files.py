"""The MATLAB files that NTNU publishes of CyberShip Enterprise 1; docs/measurements.md."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cosim import InputError

from ..columns.columns import FIVE, POSE, POWER

MATLAB = "cse1_data"
# Its first rows. Of the two power settings the first is that of the bow by hand, and that of the VSP in
# dynamic positioning.
ROWS = ("time", "x", "y", "z", "roll", "pitch", "psi", *FIVE, "first power", "second power")
# The settings in dynamic positioning, at which the thrusters give their nominal force.
FULL_VSP, FULL_BOW = 0.4, 0.5


def read_matlab(path: Path) -> dict[str, np.ndarray]:
    """Signals of one of NTNU's files: one matrix, one column for each sample.

    Raises:
        InputError: not such a file.
    """
    try:
        from scipy.io import loadmat  # most runs are no MATLAB files

        data = np.asarray(loadmat(path)[MATLAB], float)
        if data.ndim != 2 or data.shape[0] < len(ROWS) or not data.size:
            raise ValueError(f"a matrix of shape {data.shape}")
    except KeyError:
        raise InputError(f"'{path}' is not a measured run: it has no '{MATLAB}'") from None
    except Exception as error:  # a broken file makes the reader stumble in many ways
        raise InputError(f"'{path}' is not a measured run: {' '.join(str(error).split())}") from None
    rows: dict[str, np.ndarray] = dict(zip(ROWS, data, strict=False))
    return {s: rows[s] for s in ("time", *POSE, *FIVE)} | dict(zip(POWER, _power(rows), strict=True))


def _power(rows: Mapping[str, np.ndarray]) -> np.ndarray:
    """Thrust of VSP and bow thruster (2, n), of that in dynamic positioning, by the power settings.

    The settings hold for stretches. In those that a controller steers, both VSP have the same sway
    command. The VSP's thrust goes with the square of their speed (2.11), the bow thruster's with its
    limit.
    """
    bow, vsp = rows["first power"], rows["second power"]
    alike = np.isclose(rows["u2"], rows["u4"])
    stretch = np.cumsum(
        np.diff(bow, prepend=bow[0]).astype(bool) | np.diff(vsp, prepend=vsp[0]).astype(bool)
    )
    steered = (np.bincount(stretch, alike) > 0.5 * np.bincount(stretch))[stretch]
    vsp, bow = np.where(steered, (bow, vsp), (vsp, bow))
    return np.array([(np.maximum(vsp, 0.0) / FULL_VSP) ** 2, np.maximum(bow, 0.0) / FULL_BOW])
