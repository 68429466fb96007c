"""The table that a command writes as a file: its options, what is refused, and its form."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cosim import InputError

if TYPE_CHECKING:
    import pandas as pd

KINDS = (".csv", ".parquet")


def table_options(made: argparse.ArgumentParser, says: str) -> None:
    """Add ``--out FILE``, with what its help says, and ``--overwrite``."""
    made.add_argument("--out", type=Path, required=True, metavar="FILE", help=says)
    made.add_argument("--overwrite", action="store_true", help="replace an existing file too")


def table_target(options: argparse.Namespace) -> Path:
    """The file that the options name.

    Raises:
        InputError: it is of another kind, or exists and is not to be replaced.
    """
    out: Path = options.out
    if out.suffix not in KINDS:
        raise InputError(f"'{out}' ends neither in .csv nor in .parquet")
    if out.exists() and not options.overwrite:
        raise InputError(f"'{out}' exists; --overwrite replaces it")
    return out


def write_table(table: "pd.DataFrame", path: Path) -> None:
    """Write a table by the ending of the file's name."""
    if path.suffix == ".csv":
        table.to_csv(path, index=False)
    else:
        table.to_parquet(path, index=False)
