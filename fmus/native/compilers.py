"""C compilers: that of the system for this platform, zig (extra ``native``) for all others.

Options keep the compiler from changing a bit of a result: no product and sum in one rounding, no library
function of its own, and the processor that every computer of the platform has at least.
"""

from __future__ import annotations

import importlib.util
import platform
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cybership.scratch_folder import environment_with

NO_ZIG = "needs zig: pip install 'cybership[native]'"
OPTIONS = (
    "-std=c99", "-O1", "-w", "-fPIC", "-shared", "-fvisibility=hidden",
    "-ffp-contract=off", "-fno-builtin", "-fno-math-errno",
)  # fmt: skip
SYSTEM = ("gcc", "cc", "clang")


class CompilerError(Exception):
    """There is no compiler for a platform, or it fails; the message says which and how."""


@dataclass(frozen=True)
class Platform:
    """A platform of FMI 2.0.

    Attributes:
        suffix: of a shared library there.
        triples: the machines that its library runs on, as zig calls them.
        linked: options behind the files, where a linker looks for libraries.
    """

    suffix: str
    triples: tuple[str, ...]
    linked: tuple[str, ...] = ()


TARGETS = {
    # glibc as old as that of the oldest Linux still in use; the library binds its own names first.
    "linux64": Platform(".so", ("x86_64-linux-gnu.2.17",), ("-Wl,-Bsymbolic", "-lm")),
    "win64": Platform(".dll", ("x86_64-windows-gnu",)),
    "darwin64": Platform(".dylib", ("x86_64-macos", "aarch64-macos")),
}


def this_platform() -> str:
    """FMI's name of the platform that this runs on; Python's where FMI 2.0 has none."""
    machine = platform.machine().lower()
    if sys.platform == "darwin":
        return "darwin64"
    if machine in ("x86_64", "amd64") and sys.maxsize > 2**32:
        if sys.platform.startswith("linux"):
            return "linux64"
        if sys.platform == "win32":
            return "win64"
    return f"{sys.platform} on {machine}"


@dataclass(frozen=True)
class Compiler:
    """How to make the library of a platform.

    Attributes:
        commands: one for each machine that the library is for, without files.
        linked: options behind the files.
        version: what it says of itself.
    """

    commands: tuple[tuple[str, ...], ...]
    linked: tuple[str, ...]
    version: str


def compiler_for(target: str) -> Compiler:
    """The compiler for a platform.

    Raises:
        CompilerError: there is none.
    """
    linked = TARGETS[target].linked
    if target == this_platform():
        for name in SYSTEM:
            if path := shutil.which(name):
                machines = ("-arch", "x86_64", "-arch", "arm64") if target == "darwin64" else ()
                return Compiler(((path, *OPTIONS, *machines),), linked, _version([path]))
    if importlib.util.find_spec("ziglang") is None:
        here = target == this_platform()
        what = "there is no C compiler (gcc, cc or clang), so this" if here else target
        raise CompilerError(f"{what} {NO_ZIG}")
    zig = (sys.executable, "-m", "ziglang")
    own = ("-s", "-fno-sanitize=all", "-mcpu=baseline")
    commands = [(*zig, "cc", "-target", t, *own, *OPTIONS) for t in TARGETS[target].triples]
    return Compiler(tuple(commands), linked, _version(zig))


def _version(command: Sequence[str]) -> str:
    argument = "version" if len(command) > 1 else "--version"
    done = subprocess.run([*command, argument], capture_output=True, text=True, check=False)
    return done.stdout.strip()


def compiled(source: Path, target: str, work: Path) -> bytes:
    """The library of a platform.

    Args:
        source: C file; what it includes lies in its folder or in ``work``.
        target: key of :data:`TARGETS`.
        work: folder for what comes into being on the way.

    Raises:
        CompilerError: the compiler says no, and what.
    """
    made: list[bytes] = []
    compiler = compiler_for(target)
    for k, command in enumerate(compiler.commands):
        library = work / f"{target}_{k}{TARGETS[target].suffix}"
        arguments = [*command, "-I", str(work), "-o", str(library), str(source), *compiler.linked]
        done = subprocess.run(
            arguments, capture_output=True, text=True, check=False, cwd=work, env=environment_with(work)
        )
        if done.returncode != 0 or not library.is_file():
            said = [line for line in done.stderr.splitlines() if line.strip()]
            why = next((line for line in said if "error" in line.lower()), " ".join(said[:1]))
            raise CompilerError(f"compiler '{command[0]}' fails for {target}: {why or 'no message'}")
        made.append(library.read_bytes())
    return made[0] if len(made) == 1 else universal(made)


# Mach-O files of several machines in one ("universal"): the magic number of the header, and how many low
# bits of a file's offset are zero, as macOS wants it for the pages of 16 KiB of arm64.
FAT_MAGIC = 0xCAFEBABE
ALIGNMENT = 14


def universal(libraries: Sequence[bytes]) -> bytes:
    """Mach-O libraries of several machines as one file."""
    header = struct.pack(">II", FAT_MAGIC, len(libraries))
    whole = bytearray(-(-(len(header) + 20 * len(libraries)) >> ALIGNMENT << ALIGNMENT) * b"\0")
    for library in libraries:
        kind, subkind = struct.unpack_from("<II", library, 4)
        whole += bytes(-len(whole) % (1 << ALIGNMENT))
        header += struct.pack(">IIIII", kind, subkind, len(whole), len(library), ALIGNMENT)
        whole += library
    whole[: len(header)] = header
    return bytes(whole)
