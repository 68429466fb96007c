"""Files that appear in a folder together, when all of them are whole."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from cosim import InputError


@contextmanager
def together(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """A scratch folder, the files in which move to ``out`` in the end.

    If anything goes wrong before, ``out`` is as it was. A file of these names that was there and is not
    made again goes away, for it would tell of another result.

    Args:
        out: a folder, made if it is not there.
        names: of the files.

    Raises:
        InputError: the folder cannot be written to.
    """
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        try:
            out.mkdir(parents=True, exist_ok=True)
            scratch = TemporaryDirectory(prefix=".new-", dir=out)
        except OSError as error:
            raise InputError(f"cannot write to '{out}': {error.strerror or error}") from None
        with scratch as folder:
            yield Path(folder)
            for name in names:
                new = Path(folder) / name
                if new.exists():
                    os.replace(new, out / name)
                else:
                    (out / name).unlink(missing_ok=True)
    finally:
        with suppress(OSError):  # not empty: it has the files
            for folder in made:
                folder.rmdir()
