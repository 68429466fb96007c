"""Do native FMUs give the same numbers on Windows? ``python -m benchmarks.windows_numbers``.

Builds every component for Linux and for Windows, and steps both from a program in C with no Python in
its process, the one for Windows under Wine: 1,000 steps of 0.01 s with random inputs. The mathematical
libraries differ, and with them the last digits; exit code 1 if an output is farther off than 1e-12, or
1e-12 of its largest value where that is more than 1.
"""

import argparse
import os
import random
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fmus.build import build, native_targets
from fmus.declare import discover, variables, width
from fmus.ship import ship

HOST = Path(__file__).parent / "fmu_host.c"
# Where Debian and others have what runs programs for 64-bit Windows.
WINE = shutil.which("wine64") or shutil.which("wine") or shutil.which("/usr/lib/wine/wine64")
SYSTEM_COMPILER = shutil.which("cc") or shutil.which("gcc")
PROGRAMS = {
    "linux64": [str(SYSTEM_COMPILER)],
    "win64": [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu", "-mcpu=baseline"],
}
LINKED = {"linux64": ["-ldl"], "win64": []}
ROWS, STEP, TOLERANCE = 1000, 0.01, 1e-12


def host(target: str, folder: Path) -> list[str]:
    """Build the program that steps an FMU; the beginning of the command that runs it."""
    program = folder / f"host_{target}.exe"
    command = [*PROGRAMS[target], "-w", "-o", str(program), str(HOST), *LINKED[target]]
    subprocess.run(command, check=True)
    return [str(program)] if target == "linux64" else [str(WINE), str(program)]


def inputs(component: Any, rows: int = ROWS) -> np.ndarray:
    """Random inputs, the same on every platform, shape (rows, inputs)."""
    rng = random.Random(component.name)
    return np.array([[rng.uniform(-0.5, 0.5) for _ in variables(component.inputs)] for _ in range(rows)])


def stepped(
    program: Sequence[str], fmu: Path, component: Any, rows: np.ndarray
) -> tuple[np.ndarray, str]:
    """The outputs after a step with each row of inputs, and what the program says at its end."""
    (library,) = fmu.glob(f"binaries/{'win64/*.dll' if len(program) > 1 else 'linux64/*.so'}")
    guid = str(ElementTree.parse(fmu / "modelDescription.xml").getroot().get("guid"))
    widths = [width(part) for part in (component.params, component.inputs, component.outputs)]
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    done = subprocess.run(
        [*program, library, guid, *map(str, [*widths, len(rows), STEP])],
        input=text,
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(fmu.parent / "wine")},
    )
    *lines, last = done.stdout.splitlines()
    return np.array([[float(cell) for cell in line.split()] for line in lines]), last


def deviation(found: np.ndarray, other: np.ndarray) -> float:
    """How far two runs are apart, relative to an output's largest value where that is more than 1."""
    return float(np.max(np.abs(found - other) / np.maximum(1.0, np.max(np.abs(other), axis=0))))


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.windows_numbers", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="components (all)")
    options = parser.parse_args(arguments)
    if None in (WINE, SYSTEM_COMPILER, find_spec("ziglang")):
        print("needs Wine, a C compiler, and zig (pip install 'cybership[native]')")
        return 2
    good = True
    with TemporaryDirectory(prefix="windows_") as work:
        folder = Path(work)
        programs = {target: host(target, folder) for target in PROGRAMS}
        for component in [
            c for _, c in discover(ship()) if not options.names or c.name in options.names
        ]:
            (archive,) = build([component.name], native=native_targets(",".join(PROGRAMS)))
            zipfile.ZipFile(archive).extractall(folder / component.name)
            rows = inputs(component)
            linux, windows = (
                stepped(program, folder / component.name, component, rows)[0]
                for program in programs.values()
            )
            apart = deviation(windows, linux)
            good &= apart <= TOLERANCE
            print(f"{component.name:30}{apart:.1e}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
