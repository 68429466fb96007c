"""MATLAB files as tables, and those of NTNU of CyberShip Enterprise 1; docs/measurements.md."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cosim import InputError
from fmus.ship import Ship

from ..columns.columns import POSE

MATLAB = "cse1_data"
# Its first rows, and those of the five commands. Of the two power settings the first is that forward by
# hand, and that aft in dynamic positioning.
ROWS = ("time", "x", "y", "z", "roll", "pitch", "psi")
COMMANDS = np.s_[7:12]
POWER = np.s_[12:14]
# 1, the settings in dynamic positioning, at which the thrusters give their nominal force.
FULL = (0.4, 0.5)


def fits_matlab(of: Ship) -> bool:
    """Whether these files have the commands of a ship: five of its units, and two power settings."""
    width = COMMANDS.stop - COMMANDS.start
    return len(of.layouts[-1].commands) == width and len(of.power_settings) == len(FULL)


def read_matlab(path: Path, of: Ship) -> dict[str, np.ndarray]:
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
    names = (*of.layouts[-1].commands, *of.power_settings)
    if len(data) < POWER.stop:
        raise InputError(
            f"'{path}' is not a measured run: its matrix has {len(data)} rows; {POWER.stop} are needed"
        )
    given = zip(names, [*data[COMMANDS], *_power(data)], strict=True)
    return {s: rows[s] for s in ("time", *POSE)} | dict(given)


def _power(data: np.ndarray) -> np.ndarray:
    """Thrust of the propellers aft and of the thruster forward (2, n), of that in dynamic positioning.

    The settings hold for stretches. In those that a controller steers, both propellers have the same
    sway command. Their thrust goes with the square of their speed (2.11), that of the thruster forward
    with its limit.
    """
    fore, aft = data[POWER]
    alike = np.isclose(data[COMMANDS][1], data[COMMANDS][3])
    stretch = np.cumsum(
        np.diff(fore, prepend=fore[0]).astype(bool) | np.diff(aft, prepend=aft[0]).astype(bool)
    )
    steered = (np.bincount(stretch, alike) > 0.5 * np.bincount(stretch))[stretch]
    aft, fore = np.where(steered, (fore, aft), (aft, fore))
    return np.array([(np.maximum(aft, 0.0) / FULL[0]) ** 2, np.maximum(fore, 0.0) / FULL[1]])


def matlab_table(path: Path) -> pd.DataFrame:
    """The variables of a file, of the length that most of them have, as columns.

    Those of a struct have its name before a dot, as ``log.time``; rows of a matrix, or its columns where
    there are fewer of these, have their number, as ``eta.1``.

    Raises:
        InputError: not a MATLAB file of version 4 to 7.
    """
    from scipy.io import loadmat  # most runs are no MATLAB files

    try:
        content = loadmat(path, simplify_cells=True)
    except Exception as error:  # a broken file makes the reader stumble in many ways
        text = " ".join(str(error).split())
        raise InputError(f"'{path}': {text}; save it by save(..., '-v7'), or as CSV") from None
    columns = {n: x for name, value in content.items() for n, x in _vectors(name, value)}
    (length, _), *_ = Counter(x.size for x in columns.values()).most_common(1) or [(0, 0)]
    return pd.DataFrame({n: x for n, x in columns.items() if x.size == length})


def _vectors(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    """The vectors of numbers in a variable, by name."""
    if isinstance(value, dict):
        for part, inner in value.items():
            yield from _vectors(f"{name}.{part}", inner)
    elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "biuf":
        yield name, value.astype(value.dtype.newbyteorder("="))
    elif isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "biuf":
        rows = value if value.shape[0] < value.shape[1] else value.T
        native = rows.astype(rows.dtype.newbyteorder("="))
        yield from ((f"{name}.{k}", row) for k, row in enumerate(native, 1))
