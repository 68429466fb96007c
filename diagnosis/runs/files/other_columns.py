"""Columns of a measured run beside pose and commands: targets, errors, what a controller asked for."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from cosim import InputError

from ..columns.columns import Layout, read_layout
from .csv_tables import csv_table


def other_columns(path: Path, names: Iterable[str]) -> dict[str, np.ndarray]:
    """Those of some columns that a file has.

    Args:
        path: a CSV or Parquet file; a MATLAB file has none.
        names: of columns in SI.

    Returns:
        Name -> values (n,), NaN where a cell is empty or not a number.

    Raises:
        InputError: the file cannot be read.
    """
    wanted = set(names)
    if path.suffix == ".mat":
        return {}
    layout = read_layout(path) or Layout()
    try:
        is_parquet = path.suffix == ".parquet"
        table = pd.read_parquet(path) if is_parquet else csv_table(path, layout, wanted)
    except (OSError, ValueError) as error:
        text = " ".join(str(error).split())
        raise InputError(f"'{path}' cannot be read as a table: {text}") from None
    kept = [str(name) for name in table.columns if name in wanted]
    return {n: np.asarray(pd.to_numeric(table[n], errors="coerce"), float) for n in kept}
