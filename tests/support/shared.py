"""What is made once in a session and used by all its worker processes."""

import hashlib
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest
from filelock import FileLock

T = TypeVar("T")
# The folder of the session, from its first test on. A process that a test starts has none.
_session: list[Path] = []


def shared_folder(factory: pytest.TempPathFactory) -> Path:
    """The temporary folder of the session, which under pytest-xdist holds those of the workers."""
    own = factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


def once(folder: Path, make: Callable[[Path], object]) -> Path:
    """A folder that the first process to ask for it fills; others wait for it.

    Args:
        folder: below the shared folder.
        make: fills the folder that it is given; where it fails, the next one tries again.
    """
    with FileLock(folder.with_name(f"{folder.name}.lock")):
        done = folder.with_name(f"{folder.name}.done")
        if not done.exists():
            folder.mkdir(exist_ok=True)
            make(folder)
            done.touch()
    return folder


def keep_in(folder: Path) -> None:
    """Where :func:`kept` keeps what it has made."""
    _session[:] = [folder]


def kept(make: Callable[..., T], *arguments: object) -> T:
    """What a function makes of its arguments, made by the first process of the session that asks.

    Everyone gets a copy of their own, to be changed at will. Where there is no session it is made each time.

    Args:
        make: a function of a module, whose result can be pickled.
        arguments: can be pickled too.
    """
    if not _session:
        return make(*arguments)
    content = pickle.dumps((make.__module__, make.__qualname__, arguments))
    name = f"{make.__name__}_{hashlib.sha256(content).hexdigest()[:16]}"

    def write(folder: Path) -> None:
        (folder / "result").write_bytes(pickle.dumps(make(*arguments)))

    return pickle.loads((made_once(name, write) / "result").read_bytes())


def made_once(name: str, make: Callable[[Path], object]) -> Path:
    """A folder of the session with this name, that the first process to ask for it fills."""
    return once(_session[0] / name, make)
