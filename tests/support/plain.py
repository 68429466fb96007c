"""FMUs made with plain pythonfmu, without this project, for tests of what the master does with any FMU."""

import textwrap
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path

from pythonfmu.builder import FmuBuilder

Edits = Sequence[tuple[str, str]]

# Body of ``__init__`` of an FMU with an input x and an output y.
GAIN = """
self.x = 0.0
self.y = 0.0
self.register_variable(Real("x", causality=Fmi2Causality.input))
self.register_variable(Real("y", causality=Fmi2Causality.output))
"""


def make_fmu(folder: Path, name: str, init: str, step: str = "return True", edits: Edits = ()) -> Path:
    """An FMU in a folder.

    Args:
        folder: where it is made.
        name: unique, of its class and its file.
        init: the body of ``__init__``.
        step: the body of ``do_step``.
        edits: (old, new) pairs for the model description.
    """
    script = folder / f"{name}.py"
    script.write_text(
        "import math, os, time\n"
        "from pythonfmu import *\n"
        "from pythonfmu.enums import Fmi2Status\n\n"
        f"class {name}(Fmi2Slave):\n"
        "    def __init__(self, **kwargs):\n"
        "        super().__init__(**kwargs)\n"
        f"{_indent(init)}\n"
        "    def do_step(self, t, h):\n"
        f"{_indent(step)}\n"
    )
    fmu = FmuBuilder.build_FMU(script, dest=folder)
    if edits:
        _edit(fmu, edits)
    return fmu


def _indent(text: str) -> str:
    return textwrap.indent(textwrap.dedent(text), 8 * " ")


def _edit(fmu: Path, edits: Edits) -> None:
    with zipfile.ZipFile(fmu) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    xml = content["modelDescription.xml"].decode()
    for old, new in edits:
        assert old in xml, old
        xml = xml.replace(old, new)
    content["modelDescription.xml"] = xml.encode()
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)


def with_unit(name: str, base: str) -> list[tuple[str, str]]:
    """Edits of a model description that give all its Reals a unit, defined by attributes of BaseUnit."""
    definition = f'<UnitDefinitions><Unit name="{name}"><BaseUnit {base}/></Unit></UnitDefinitions>'
    return [("<LogCategories>", f"{definition}<LogCategories>"), ("<Real", f'<Real unit="{name}"')]


def ramp_and_gain(
    make: Callable[..., Path], ramp_edits: Edits = (), gain_edits: Edits = ()
) -> dict[str, object]:
    """A scenario of two foreign FMUs: a ramp, and a gain with a parameter that only it knows.

    Args:
        make: makes an FMU, as the fixture ``plain_fmu`` does.
        ramp_edits: of the description of the ramp.
        gain_edits: of that of the gain.
    """
    ramp = make(
        "Ramp",
        "self.y = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))",
        "self.y += h\nreturn True",
        ramp_edits,
    )
    gain = make(
        "Gain",
        "self.u = 0.0\nself.y = 0.0\nself.k = 1.0\n"
        "self.register_variable(Real('u', causality=Fmi2Causality.input))\n"
        "self.register_variable(Real('y', causality=Fmi2Causality.output))\n"
        "self.register_variable(Real('k', start=1.0, causality=Fmi2Causality.parameter,"
        " variability=Fmi2Variability.tunable))",
        "self.y = self.k * self.u\nreturn True",
        gain_edits,
    )
    return {
        "name": "chain", "step": 0.25, "stop": 1.0, "algorithm": "jacobi",
        "fmus": {"ramp": {"path": str(ramp)}, "gain": {"path": str(gain), "parameters": {"k": 3.0}}},
        "connections": [["ramp.y", "gain.u"]],
    }  # fmt: skip
