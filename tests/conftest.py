"""What several tests share: the built FMUs, and a scenario to vary."""

import json
import os
import signal
import textwrap
import zipfile
from pathlib import Path

import pytest

from cosim.fmu import Model
from cosim.instance import Instance
from fmus.build import build
from fmus.declare import discover

ROOT = Path(__file__).parent.parent
# Reasons to skip that are no matter of what is installed; with CYBERSHIP_REQUIRE=all any other one fails.
ACCEPTED = (
    "no measured runs",
    "no FMUs of other tools",
    "not for FMI 2.0",
    "no binary for",
    "root may write",
)
COMPONENTS = {component.name: component for _, component in discover()}


def pytest_configure():
    """A shell that starts the tests in the background makes them, and what they start, deaf to Ctrl-C."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """A skip that nobody expected fails where all tools must be there, as on the machine of the gate."""
    report = yield
    if (
        report.skipped
        and isinstance(report.longrepr, tuple)
        and os.environ.get("CYBERSHIP_REQUIRE") == "all"
    ):
        reason = report.longrepr[2].removeprefix("Skipped: ")
        if not reason.startswith(ACCEPTED):
            report.outcome, report.longrepr = "failed", f"CYBERSHIP_REQUIRE=all, but skipped: {reason}"
    return report


@pytest.fixture(autouse=True, scope="session")
def _private_cache(tmp_path_factory):
    """FMUs built by the tests do not touch the user's cache."""
    os.environ["CYBERSHIP_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(autouse=True, scope="session")
def _first_library(_private_cache):
    """The first pythonfmu library of a process is one that the master puts to rest (see Instance.free)."""
    model = Model(build(["vessel"])[0])
    Instance("first", model, print).free()
    model.close()


@pytest.fixture(scope="session")
def fmus(tmp_path_factory, _private_cache):
    """Name -> path of every FMU of the project."""
    return {path.stem: path for path in build([], tmp_path_factory.mktemp("fmus"))}


@pytest.fixture
def ellipse():
    """The content of scenarios/ellipse.json, cut to 2 s, to be varied."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    content["stop"] = 2.0
    content["metrics"] = {}
    return content


@pytest.fixture
def plain_fmu(tmp_path):
    """A function that makes an FMU with plain pythonfmu, as somebody else would.

    Arguments: a unique name, the body of ``__init__``, the body of ``do_step``, and edits of the model
    description as (old, new) pairs.
    """
    from pythonfmu.builder import FmuBuilder

    def make(name, init, step="return True", edits=()):
        script = tmp_path / f"{name}.py"
        script.write_text(
            "import math, os, time\n"
            "from pythonfmu import *\n"
            "from pythonfmu.enums import Fmi2Status\n\n"
            f"class {name}(Fmi2Slave):\n"
            "    def __init__(self, **kwargs):\n"
            "        super().__init__(**kwargs)\n"
            f"{indent(init, 8)}\n"
            "    def do_step(self, t, h):\n"
            f"{indent(step, 8)}\n"
        )
        fmu = FmuBuilder.build_FMU(script, dest=tmp_path)
        if edits:
            _edit(fmu, edits)
        return fmu

    return make


def indent(text, spaces):
    return textwrap.indent(textwrap.dedent(text), " " * spaces)


def _edit(fmu, edits):
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


GAIN = """
self.x = 0.0
self.y = 0.0
self.register_variable(Real("x", causality=Fmi2Causality.input))
self.register_variable(Real("y", causality=Fmi2Causality.output))
"""


@pytest.fixture
def portable(ellipse):
    """The ellipse scenario without what cannot travel."""
    return ellipse | {"faults": [], "algorithm": "jacobi", "stop": 0.5}


@pytest.fixture
def own(portable):
    """The same with parameters of its own."""
    portable["fmus"]["vessel"]["parameters"] |= {"x_0": 4.5, "delta_X_u": -3.0}
    return portable


def with_unit(name, base):
    """Edits of a model description that give all its Reals a unit, defined by attributes of BaseUnit."""
    definition = f'<UnitDefinitions><Unit name="{name}"><BaseUnit {base}/></Unit></UnitDefinitions>'
    return [("<LogCategories>", f"{definition}<LogCategories>"), ("<Real", f'<Real unit="{name}"')]


@pytest.fixture
def chain(plain_fmu, tmp_path):
    """Two foreign FMUs: a ramp, and a gain with a parameter that only it knows."""
    return ramp_and_gain(plain_fmu, tmp_path)


@pytest.fixture
def angles(plain_fmu, tmp_path):
    """The same, where the ramp is in degrees and the gain in radians."""
    degrees = with_unit("deg", 'rad="1" factor="0.017453292519943295"')
    return ramp_and_gain(plain_fmu, tmp_path, degrees, with_unit("rad", 'rad="1"'))


def ramp_and_gain(plain_fmu, tmp_path, ramp_edits=(), gain_edits=()):
    plain_fmu("Ramp", "self.y = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))",
              "self.y += h\nreturn True", ramp_edits)  # fmt: skip
    plain_fmu(
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
        "fmus": {"ramp": {"path": str(tmp_path / "Ramp.fmu")},
                 "gain": {"path": str(tmp_path / "Gain.fmu"), "parameters": {"k": 3.0}}},
        "connections": [["ramp.y", "gain.u"]],
    }  # fmt: skip
