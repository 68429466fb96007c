"""The library of C functions: compiled at its first use on a computer, kept in the cache, loaded.

It is a convenience. Whatever uses it has a body in Python that gives the same bytes, and takes that
where there is no library.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from functools import cache
from pathlib import Path

from filelock import FileLock, Timeout
from platformdirs import user_cache_path

from ..files import atomic_write

FOLDER = Path(__file__).parent
SOURCES = ("loop.c", "rows.c", "powers.py")
# No product and sum in one rounding, no operation left out: the bits are to be those of Python.
OPTIONS = ("-std=c99", "-O3", "-w", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
SYSTEM = ("gcc", "cc", "clang")
# Longest wait for another process that compiles, and for a compiler [s]; chosen: zig compiles what every
# program needs when it is used first, which takes minutes.
PATIENCE = 600.0


def asks_for_plain_loop() -> bool:
    """Whether the user wants nothing compiled, for comparison."""
    return os.environ.get("CYBERSHIP_LOOP") == "plain"


class NoLibraryError(Exception):
    """There is no library; the message says why."""


def library(with_zig: bool = False) -> ctypes.CDLL:
    """The loaded library.

    Args:
        with_zig: whether zig (extra ``native``) may compile it, where the system has no compiler: that
            takes minutes once.

    Raises:
        NoLibraryError: none is in the cache, and none can be made.
    """
    found = _found(with_zig)
    if isinstance(found, str):
        raise NoLibraryError(found)
    return found


@cache
def _found(with_zig: bool) -> ctypes.CDLL | str:
    """The library, or why there is none: asked once in a process."""
    content = b"".join((FOLDER / name).read_bytes() for name in SOURCES)
    key = repr((content, OPTIONS, platform.machine(), sysconfig.get_platform()))
    name = f"loop_{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    chosen = os.environ.get("CYBERSHIP_CACHE")
    folder = Path(chosen) if chosen else user_cache_path("cybership")
    path = folder / f"{name}{'.dll' if os.name == 'nt' else '.so'}"
    try:
        if not path.is_file():
            folder.mkdir(parents=True, exist_ok=True)
            with FileLock(folder / "loop.lock", timeout=PATIENCE):
                if not path.is_file():
                    _compile(path, with_zig)
        return ctypes.CDLL(str(path))
    except NoLibraryError as error:
        return str(error)
    except (OSError, Timeout, subprocess.SubprocessError) as error:
        return f"the library of C functions cannot be made or loaded: {error}"


def _compile(path: Path, with_zig: bool) -> None:
    from .powers import powers_of_ten

    command = _compiler(with_zig)
    with tempfile.TemporaryDirectory(prefix="cybership_") as work:
        (Path(work) / "powers.h").write_text(powers_of_ten())
        with atomic_write(path) as scratch:
            files = [str(FOLDER / source) for source in SOURCES if source.endswith(".c")]
            built = Path(work) / "built"
            linked = [] if os.name == "nt" else ["-lm"]
            done = subprocess.run(
                [*command, *OPTIONS, "-I", work, "-o", str(built), *files, *linked],
                capture_output=True,
                text=True,
                errors="replace",
                check=False,
                timeout=PATIENCE,
                cwd=work,
            )
            if done.returncode != 0 or not built.is_file():
                said = [line for line in done.stderr.splitlines() if "error" in line.lower()]
                raise NoLibraryError(
                    f"compiler '{command[0]}' fails: {said[0] if said else 'no message'}"
                )
            shutil.copyfile(built, scratch)


def _compiler(with_zig: bool) -> list[str]:
    for name in SYSTEM:
        if path := shutil.which(name):
            return [path]
    from importlib.util import find_spec

    if find_spec("ziglang") is None:
        raise NoLibraryError(
            "there is no C compiler (gcc, cc or clang); pip install 'cybership[native]' brings one"
        )
    if not with_zig:
        raise NoLibraryError(
            'there is no C compiler of the system (gcc, cc or clang); "native": true lets zig compile, '
            "which takes minutes the first time"
        )
    return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline", "-fno-sanitize=all"]
