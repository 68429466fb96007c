"""Files that appear in a folder together, when all of them are whole, and which folder that is."""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from itertools import count
from pathlib import Path

from cosim import InputError
from cosim.command import complain
from cosim.errors import not_written
from cosim.interrupts import Held
from cosim.process import STATE
from cybership.scratch_folder import Scratch, sweep

# In a folder that nobody chose: the hashes of what the result there was made of.
MADE_OF = ".inputs.json"
LOGS = ("log.csv", "log.parquet")
NEW = ".new-"  # begins the names of scratch folders


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
        made = [f for f in (out, *out.parents) if not os.path.exists(f)]
        scratch = None
        try:
            try:
                scratch = _scratch(out)
                STATE.unfinished(*(folder.absolute() for folder in (scratch.outer, *made)))
            except OSError as error:
                raise InputError(not_written(out, error)) from None
            interrupts.allow()
            yield scratch.path
            interrupts.hold()
            interrupts.act()
            for name in names:
                new = scratch.path / name
                if new.exists():
                    os.replace(new, out / name)
                else:
                    (out / name).unlink(missing_ok=True)
            interrupts.finish()
        finally:
            interrupts.hold()
            if scratch:
                scratch.remove()
            with suppress(OSError):  # not empty: it has the files
                for folder in made:
                    folder.rmdir()
            STATE.unfinished()


def clean(out: Path) -> None:
    """Remove from a folder what calls that were killed have left, and say so."""
    if removed := sweep(out, NEW):
        complain(f"removed {removed} unfinished result(s) of killed calls from '{out}'", "note: ")


def _scratch(out: Path) -> Scratch:
    """A new folder in one that is made if it is not there, though another command may take that away."""
    while True:
        out.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):
            return Scratch(out, NEW)


def sha256(path: Path) -> str:
    """The hash of a file, or of the log in a folder; empty where that cannot be read."""
    if path.is_dir():
        path = next((path / name for name in LOGS if (path / name).is_file()), path)
    try:
        stat = path.stat()
        return _hash(path, stat.st_size, stat.st_mtime_ns)
    except OSError:
        return ""


@lru_cache  # of a run it is asked for when it is read, and when the result is written
def _hash(path: Path, size: int, changed: int) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def default_folder(usual: Path, inputs: Mapping[str, str], overwrite: bool = False) -> Path:
    """The usual folder, or the first of ``usual_2``, ... free or with a result of these files."""
    if overwrite:
        return usual
    for number in count(1):
        folder = usual if number == 1 else usual.with_name(f"{usual.name}_{number}")
        clean(folder)
        if not folder.is_dir() or not any(folder.iterdir()) or _made_of(folder) == [*inputs.values()]:
            return folder
    raise AssertionError


def _made_of(folder: Path) -> object:
    try:
        return json.loads((folder / MADE_OF).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def keep_inputs(folder: Path, inputs: Mapping[str, str]) -> None:
    """Say in a result folder what the result was made of."""
    with suppress(OSError):  # the result is there all the same
        (folder / MADE_OF).write_text(json.dumps([*inputs.values()]), encoding="utf-8")
