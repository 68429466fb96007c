"""Cells of a table as numbers: floats, and date stamps as seconds."""

from pathlib import Path

import numpy as np
import pandas as pd

from cosim import InputError

from ..columns.columns import SHOWN, Layout
from ..columns.side_car import decimal_comma


def date_stamps(cells: pd.Series, where: str) -> np.ndarray | None:
    """Seconds since the first of a column of date stamps (ISO 8601), NaN where empty; None: numbers."""
    if not pd.api.types.is_datetime64_any_dtype(cells):
        try:
            if not np.isnan(np.asarray(pd.to_numeric(cells, errors="coerce"), float)).all():
                return None
        except (TypeError, ValueError, OverflowError):  # lists and the like in a Parquet file
            return None
        cells = cells.astype("string").str.replace(",", ".")
    stamps = pd.to_datetime(cells, errors="coerce", utc=True, format="ISO8601")
    wrong = np.flatnonzero(stamps.isna() & cells.notna())
    if stamps.isna().all():
        return None
    if wrong.size:
        text = str(cells.iloc[wrong[0]])[:SHOWN]
        raise InputError(f"{where}: {cells.name} = {text!r} is no date stamp of ISO 8601")
    return np.asarray((stamps - stamps.dropna().iloc[0]).dt.total_seconds(), float)


def numbers(cells: pd.Series, path: Path, layout: Layout) -> np.ndarray:
    """A column as floats; empty cells are NaN."""
    try:
        found = np.asarray(pd.to_numeric(cells, errors="coerce"), float)
    except (TypeError, ValueError, OverflowError):  # lists, times and the like in a Parquet file
        raise InputError(f"'{path}': {cells.name} is not a column of numbers") from None
    wrong = np.flatnonzero(np.isnan(found) & np.asarray(cells.notna()))
    if wrong.size:
        text = str(cells.iloc[wrong[0]])[:SHOWN]
        hint = decimal_comma(path, layout, text)
        raise InputError(f"'{path}': {cells.name} = {text!r} is not a number{hint}")
    return found
