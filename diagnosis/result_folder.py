"""Files that appear in a folder together, when all of them are whole."""

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp

from cosim import InputError
from cosim.interrupts import Held


@contextmanager
def together(out: Path, names: Sequence[str]) -> Iterator[Path]:
    """A scratch folder, the files in which move to ``out`` in the end.

    If anything goes wrong before, ``out`` is as it was. A file of these names that was there and is not
    made again goes away, for it would be of another result. Interrupts act while the files are made;
    while folders are made, files move and the scratch folder goes, they wait.

    Args:
        out: a folder, made if it is not there.
        names: of the files.

    Raises:
        InputError: the folder cannot be written to.
    """
    with Held() as interrupts:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        scratch = None
        try:
            try:
                out.mkdir(parents=True, exist_ok=True)
                scratch = Path(mkdtemp(prefix=".new-", dir=out))
            except OSError as error:
                raise InputError(f"cannot write to '{out}': {error.strerror or error}") from None
            interrupts.allow()
            yield scratch
            interrupts.hold()
            interrupts.act()
            for name in names:
                new = scratch / name
                if new.exists():
                    os.replace(new, out / name)
                else:
                    (out / name).unlink(missing_ok=True)
            interrupts.finish()
        finally:
            interrupts.hold()
            if scratch:
                shutil.rmtree(scratch, ignore_errors=True)
            with suppress(OSError):  # not empty: it has the files
                for folder in made:
                    folder.rmdir()
