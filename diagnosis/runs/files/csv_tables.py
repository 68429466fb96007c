"""CSV files as tables, read as the JSON file beside them says."""

from collections.abc import Collection
from pathlib import Path
from typing import Any

import pandas as pd

from ..columns.columns import Layout
from ..columns.side_car import refuse_encoding

# What pandas makes of Ctrl-C while it reads from memory, where nothing else can fail.
READ_INTERRUPTED = "Calling read(nbytes) on source failed"


def _options(layout: Layout) -> dict[str, Any]:
    units = [layout.skip + 1] if layout.units_line else []
    return {
        "sep": layout.separator,
        "encoding": layout.encoding,
        "skiprows": [*range(layout.skip), *units],
        "index_col": False,
    }


def csv_names(path: Path, layout: Layout) -> list[str]:
    """The names of the columns as they stand there, one that is there twice included.

    Raises:
        InputError: the text is in another encoding.
        OSError, ValueError: it cannot be read.
    """
    try:
        first = pd.read_csv(
            path, nrows=1, header=None, dtype=str, keep_default_na=False, **_options(layout)
        )
    except UnicodeDecodeError:
        refuse_encoding(path, layout)
        raise
    return [name.strip() for name in first.iloc[0]]


def csv_table(path: Path, layout: Layout, wanted: Collection[str]) -> pd.DataFrame:
    """The columns of some names, those of them that there are.

    Raises:
        InputError: the text is in another encoding.
        OSError, ValueError: it cannot be read.
        KeyboardInterrupt: the user has asked for the end.
    """
    try:
        with open(path, "rb") as content:  # a long log does not fit into memory twice
            return pd.read_csv(
                content,
                usecols=lambda name: str(name).strip() in wanted,
                decimal=layout.decimal,
                skipinitialspace=True,
                **_options(layout),
            ).rename(columns=str.strip)
    except UnicodeDecodeError:
        refuse_encoding(path, layout)
        raise
    except pd.errors.ParserError as error:
        if READ_INTERRUPTED in str(error):
            raise KeyboardInterrupt from error
        raise
