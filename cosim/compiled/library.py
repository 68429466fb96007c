"""The library of the step loop in C: compiled at its first use on a computer, kept in the cache, loaded.

An entry of the cache that is not whole is compiled again, and that is said.

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
from functools import cache
from pathlib import Path
from typing import NamedTuple

from filelock import Timeout

from cybership.scratch_folder import environment_with
from cybership.user_cache import RefusedError, cache_folder, kept

SOURCE = Path(__file__).parent / "loop.c"
# No product and sum in one rounding, no operation left out: the bits are to be those of Python.
OPTIONS = ("-std=c99", "-O3", "-w", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off")
SYSTEM = ("gcc", "cc", "clang")
PLATFORMS = ("linux64", "win64", "darwin64")  # of FMI 2.0, for which FMUs can be compiled
# Longest wait for another process that compiles, and for a compiler [s]; chosen: zig compiles what every
# program needs when it is used first, which takes minutes.
PATIENCE = 600.0


def asks_for_plain_loop() -> bool:
    """Whether the user wants nothing compiled, for comparison."""
    return os.environ.get("CYBERSHIP_LOOP") == "plain"


NATIVE = (
    "compile the FMUs of the project and the step loop, or neither; results are the same "
    "(default: compiled, if the system has a C compiler)"
)


def kind_of(native: bool | None) -> str:
    """Which of the project's own FMUs ran, and how to change that; empty where none did."""
    if native is None:
        return ""
    return "native FMUs (--no-native: Python ones)" if native else "FMUs in Python (--native: compiled)"


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
    if found.library is None:
        raise NoLibraryError(found.reason)
    return found.library


def prepare_library(native: bool | str) -> str:
    """Make the library now, if a run will want it: that may take a while, and an interrupt may end it.

    Args:
        native: of a scenario: False wants none, True lets zig compile.

    Returns:
        What the user should know; usually empty.
    """
    return "" if native is False or asks_for_plain_loop() else _found(native is True).note


def compiles(native: bool | str) -> bool:
    """Whether the project's own FMUs are compiled.

    Args:
        native: of a scenario; ``"auto"`` where a compiler of the system has made the library, or where
            the FMUs came compiled.
    """
    return _compiles_itself() if native == "auto" else bool(native)


@cache
def _compiles_itself() -> bool:
    """Asked once in a process, so that its runs have FMUs of one kind."""
    import fmpy  # takes a while, and most programs compile nothing

    if fmpy.platform not in PLATFORMS:
        return False
    if any(map(shutil.which, SYSTEM)):
        return _found(False).library is not None
    listing = [sys.executable, "-m", "fmus.build", "--list", "--native"]
    done = subprocess.run(listing, capture_output=True, text=True, check=False)
    return done.returncode == 0 and done.stdout.strip() != ""


class FoundLibrary(NamedTuple):
    """The library, or the reason why there is none, and what the user should know."""

    library: ctypes.CDLL | None
    reason: str = ""
    note: str = ""


def entry_of(cache: Path) -> Path:
    """Where the library is kept in a cache, for this source and computer."""
    key = repr((SOURCE.read_bytes(), OPTIONS, platform.machine(), sysconfig.get_platform()))
    name = f"loop_{hashlib.sha256(key.encode()).hexdigest()[:16]}"
    return cache / f"{name}{'.dll' if os.name == 'nt' else '.so'}"


@cache
def _found(with_zig: bool) -> FoundLibrary:
    """The library, or why there is none: asked once in a process."""
    if (folder := cache_folder()) is None:
        return FoundLibrary(
            None, "this user has no home folder; set CYBERSHIP_CACHE to a folder for the loop"
        )
    path, note = entry_of(folder), ""

    def make(work: Path) -> Path:
        nonlocal note
        if path.exists():
            note = f"the step loop in the cache was damaged, and is compiled again: '{path}'"
        return _compiled(work, with_zig)

    try:
        return FoundLibrary(ctypes.CDLL(str(kept(folder, path, make, PATIENCE))), note=note)
    except RefusedError as error:
        return FoundLibrary(None, str(error), f"{error}; the plain step loop runs")
    except NoLibraryError as error:
        return FoundLibrary(None, str(error), note)
    except (OSError, Timeout, subprocess.SubprocessError) as error:
        return FoundLibrary(None, f"the library of C functions cannot be made or loaded: {error}", note)


def _compiled(work: Path, with_zig: bool) -> Path:
    command = _compiler(with_zig)
    built = work / "built"
    linked = [] if os.name == "nt" else ["-lm"]
    done = subprocess.run(
        [*command, *OPTIONS, "-o", str(built), str(SOURCE), *linked],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        timeout=PATIENCE,
        cwd=work,
        env=environment_with(work),
    )
    if done.returncode != 0 or not built.is_file():
        said = [line for line in done.stderr.splitlines() if "error" in line.lower()]
        raise NoLibraryError(f"compiler '{command[0]}' fails: {said[0] if said else 'no message'}")
    try:
        ctypes.CDLL(str(built))
    except OSError as error:
        raise NoLibraryError(f"compiler '{command[0]}' wrote no library: {error}") from None
    return built


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
            'the system has no C compiler (gcc, cc or clang); "native": true lets zig compile, '
            "which takes minutes the first time"
        )
    return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline", "-fno-sanitize=all"]
