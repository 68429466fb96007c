"""FMUs without Python: as the Python FMUs to the bit, in our master, in other tools, in a program in C."""

import json
import math
import random
import subprocess
import zipfile
from xml.etree import ElementTree

import pytest
from fmpy.validation import validate_fmu
from support import ccode
from support.ccode import same_bits
from support.command import command
from support.opened import Opened
from support.project import COMPONENTS, ROOT

from cosim.run import main as run_scenario
from fmus.build import build
from fmus.build import platforms
from fmus.build.__main__ import main
from fmus.build.platforms import native_targets
from fmus.check.checking import main as check
from fmus.declare import flatten, width
from fmus.effects import STANDARD
from fmus.native import compilers

pytestmark = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")
# Those of scenarios/ellipse.json.
NAMES = ["vessel", "thrusters", "observer_mdf", "guidance_ellipse", "controller_abs"]


@pytest.fixture(scope="module")
def native(_session_cache):
    """Name -> path of native FMUs."""
    return {path.stem: path for path in build(NAMES, native=native_targets())}


@pytest.fixture
def opened(tmp_path):
    """A function that opens an FMU; closed after the test."""
    instances = []

    def make(path, name="instance"):
        instances.append(Opened(path, tmp_path, name))
        return instances[-1]

    yield make
    for instance in instances:
        instance.close()


def play(fmu, seed, steps=20):
    """Outputs after each of some steps with random inputs."""
    rng, rows = random.Random(seed), []
    for k in range(steps):
        fmu.set(**{name: rng.uniform(-0.5, 0.5) for name in fmu.inputs})
        fmu.step(k * 0.01)
        rows.append(fmu.get())
    return rows


def described(path):
    """The model description without what tells builds and tools apart."""
    root = ElementTree.fromstring(zipfile.ZipFile(path).read("modelDescription.xml"))
    for attribute in ("guid", "generationTool"):
        del root.attrib[attribute]
    for element in root.iter():
        element.attrib.pop("needsExecutionTool", None)
        element.text = element.tail = None
    return ElementTree.tostring(root)


@pytest.mark.parametrize("name", NAMES)
def test_description_is_that_of_the_python_fmu(name, native, fmus):
    assert described(native[name]) == described(fmus[name])
    assert validate_fmu(str(native[name])) == []
    inside = zipfile.ZipFile(native[name]).namelist()
    assert len(inside) == 2
    assert not [entry for entry in inside if "python" in entry or entry.endswith(".py")]


@pytest.mark.parametrize("name", ["vessel", "thrusters"])
@pytest.mark.slow
def test_no_rule_finds_anything(name, native):
    done = command(check, native[name])
    assert done.returncode == 0, done.stdout
    assert "no findings" in done.stdout


@pytest.mark.parametrize("name", NAMES)
def test_same_bits_as_the_python_fmu(name, native, fmus, opened):
    rows = [play(opened(path, name).initialise(), name, 60) for path in (native[name], fmus[name])]
    assert all(map(same_bits, *rows))


def content(stop):
    """The ellipse with faults of several kinds, and events that switch effects on."""
    scenario = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    pose = ["observer.x_m", "observer.y_m", "observer.psi_m"]
    scenario["faults"] += [
        {"kind": "dropout", "signals": pose, "at": [0.3 * stop], "duration": 0.5, "value": "nan"},
        {"kind": "dropout", "signals": ["vessel.tau_X"], "at": [0.6 * stop], "duration": 0.1, "value": "nan"},
    ]
    changes = [("vessel", "delta_X_u", -4.0), ("thrusters", "delay", 0.07), ("vessel", "V_n", 0.02),
               ("thrusters", "curve_bow_u_3", -0.4), ("thrusters", "lag", 0.2), ("vessel", "mass", 1.5)]  # fmt: skip
    scenario["events"] = [
        {"time": stop * (k + 1) / 8, "model": model, "variable": name, "action": "override", "value": value}
        for k, (model, name, value) in enumerate(changes)
    ]
    return scenario | {"stop": stop, "metrics": {}}


@pytest.mark.parametrize("stop", [20.0, pytest.param(198.0, marks=pytest.mark.slow)])
def test_same_log_from_native_and_from_python_fmus(stop, native, tmp_path):
    scenario = content(stop)
    (tmp_path / "python.json").write_text(json.dumps(scenario))
    for entry in scenario["fmus"].values():
        entry["path"] = str(native[entry["path"].removesuffix(".fmu")])
    (tmp_path / "native.json").write_text(json.dumps(scenario))
    logs = []
    for kind in ("python", "native"):
        out = tmp_path / kind
        done = command(run_scenario, tmp_path / f"{kind}.json", "--out", out, "--quiet", "--no-plots")
        assert done.returncode == 0, done.stderr
        logs.append((out / "log.csv").read_bytes())
    assert logs[0] == logs[1]
    assert logs[0].count(b"\n") == round(stop * 100) + 2


def test_reset_and_states_repeat_bit_for_bit(native, opened):
    one, other = opened(native["vessel"], "one").initialise(), opened(native["vessel"], "other").initialise()
    first = play(one, 0)
    state = one.fmu.getFMUstate()
    rows = play(one, 1)
    saved = one.fmu.serializeFMUstate(state)
    one.fmu.setFMUstate(state)
    assert play(one, 1) == rows
    restored = other.fmu.deSerializeFMUstate(saved)
    other.fmu.setFMUstate(restored)
    assert play(other, 1) == rows
    for fmu, given in ((one, state), (other, restored)):
        fmu.fmu.freeFMUstate(given)
    one.fmu.reset()
    one.initialise()
    assert play(one, 0) == first


def test_state_of_another_fmu_is_refused(native, opened):
    vessel, observer = opened(native["vessel"]).initialise(), opened(native["observer_mdf"]).initialise()
    state = observer.fmu.getFMUstate()
    saved = observer.fmu.serializeFMUstate(state)
    observer.fmu.freeFMUstate(state)
    with pytest.raises(Exception, match="error"):
        vessel.fmu.deSerializeFMUstate(saved)
    assert "no state of this FMU" in vessel.messages[-1][1]


def test_what_is_out_of_place_is_told_and_changes_nothing(native, opened):
    vessel = opened(native["vessel"]).initialise()
    before = vessel.get()
    for values in ({"x": 3.0}, {"X_u": math.nan}, {"x_0": 9.0}):
        vessel.set(**values)
    assert [status for status, _ in vessel.messages] == [1, 1, 1]
    assert "x_0 is fixed" in vessel.messages[-1][1]
    assert (vessel.get(), vessel.get("X_u", "x_0")) == (before, [-0.6555, 5.0])
    observer = opened(native["controller_abs"]).initialise(x_hat=0.3)
    observer.set(x_hat=math.inf)
    assert "x_hat is inf" in observer.messages[-1][1]
    assert observer.get("x_hat") == [0.3]


def test_failing_step_is_an_error_with_its_cause_and_keeps_the_state(native, opened):
    vessel = opened(native["vessel"]).initialise()
    vessel.step(0.0)
    before = vessel.get()
    wrong = [(dict(tau_X=1e300), "not finite"), (dict(tau_X=0.0, m=-2.0), "division by zero")]
    for values, reason in wrong:
        vessel.set(**values)
        with pytest.raises(Exception, match="error"):
            vessel.step(0.01)
        assert vessel.messages[-1][0] == 3
        assert reason in vessel.messages[-1][1]
        assert vessel.get() == before
    vessel.set(m=14.11)
    vessel.step(0.01)
    for h in (-0.01, math.nan, math.inf, 1e9):
        with pytest.raises(Exception, match="error"):
            vessel.step(0.0, h)


SET = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 version="1.0" name="m"><ssv:Parameters><ssv:Parameter name="vessel.delta_X_u"><ssv:Real value="-3.5"/>
</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"""


def test_learned_vessel_starts_with_what_was_learned(tmp_path, opened):
    (tmp_path / "model.ssv").write_text(SET)
    for options, name in (([], "python"), (["--native"], "native")):
        arguments = [*options, "--parameters", tmp_path / "model.ssv", "--out", tmp_path / name]
        done = command(main, *arguments)
        assert done.stdout.split() == [str(tmp_path / name / "vessel.fmu")], done.stderr
    rows = [play(opened(tmp_path / n / "vessel.fmu").initialise(u_0=0.2), 0) for n in ("native", "python")]
    assert rows[0] == rows[1]
    assert opened(tmp_path / "native" / "vessel.fmu").get("delta_X_u") == [-3.5]


EFFECT = '''
from typing import Annotated
from fmus.effects import effect
from fmus.ops import exp

@effect("X_soft", kind="force", axis="X", formula="X = k (1 - exp(-u u))", linear=False)
def X_soft(ship, X_soft: Annotated[float, "N", "a soft force"] = 0.0):
    """A soft force."""
    return X_soft * (1.0 - exp(-ship.u * ship.u)), 0.0, 0.0
'''


def test_users_effect_is_compiled(tmp_path, opened):
    (tmp_path / "soft.py").write_text(EFFECT)
    effects = STANDARD.plus_file(tmp_path / "soft.py")
    (path,) = build(["vessel"], tmp_path, effects=effects, native=native_targets())
    fmu = opened(path).initialise(u_0=0.3, X_soft=2.0)
    fmu.step(0.0)
    (force, u) = fmu.get("force_X_soft", "u")
    assert force == pytest.approx(2.0 * (1.0 - math.exp(-u * u)), rel=1e-12)


def test_program_in_c_runs_a_vessel_without_python(native, tmp_path):
    """A process that holds no Python opens the library and prints what it computes."""
    zipfile.ZipFile(native["vessel"]).extractall(tmp_path)
    (library,) = tmp_path.glob("binaries/*/vessel.*")
    guid = ElementTree.parse(tmp_path / "modelDescription.xml").getroot().get("guid")
    host = tmp_path / "host"
    source = ROOT / "tests" / "support" / "host.c"
    subprocess.run([ccode.COMPILER, "-o", host, source, "-ldl"], check=True)
    component = COMPONENTS["vessel"]
    first = width(component.params)  # value reference of the first input
    arguments = [host, library, guid, str(first)]
    done = subprocess.run(arguments, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    i, p = component.inputs(0.5, 0.1, -0.02), component.params()
    state, outputs = component.init(i, p), ()
    for _ in range(1000):
        state, outputs = component.step(state, i, p, 0.01)
    *numbers, mapped = done.stdout.splitlines()
    assert same_bits(map(float, numbers), flatten(outputs)[:3])
    assert mapped in ("no Python in this process", "what is mapped cannot be read here")


def test_builds_are_kept_and_repeatable(native, tmp_path, monkeypatch):
    assert build(["vessel"], native=native_targets()) == [native["vessel"]]
    assert command(main, "--verify", native["vessel"]).returncode == 0
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    (again,) = build(["observer_mdf"], native=native_targets())
    assert again.read_bytes() == native["observer_mdf"].read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--native", "--target", "linux"], "did you mean 'linux64'"),
        (["--native", "--target", "python"], "no platform to compile for"),
        (["--native", "vesel"], "did you mean 'vessel'"),
        (["--target", "linux64"], "need --native"),
    ],
)
def test_what_cannot_be_compiled_is_refused_in_one_line(arguments, message):
    done = command(main, *arguments)
    assert done.returncode == 2
    assert message in done.stderr.splitlines()[-1]


def test_without_a_compiler_one_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(compilers.shutil, "which", lambda name: None)
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda name: None)
    done = command(main, "--native", "vessel")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "cybership[native]" in done.stderr
    assert command(main, "--native", "vessel", "--source", tmp_path).returncode == 0


def test_compiler_that_fails_is_told(monkeypatch, tmp_path):
    broken = compilers.Compiler((("false",),), (), "")
    for module in (platforms, compilers):
        monkeypatch.setattr(module, "compiler_for", lambda target: broken)
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    done = command(main, "--native", "observer_mdf")
    assert done.returncode == 2
    assert "compiler 'false' fails" in done.stderr
    assert not list(tmp_path.rglob("*.fmu"))


def test_machines_of_a_universal_library_are_found_where_its_header_says():
    parts = [bytes.fromhex("cffaedfe") + bytes([k, 0, 0, 1, k, 0, 0, 0]) + b"code" * k for k in (7, 12)]
    whole = compilers.universal(parts)
    assert int.from_bytes(whole[4:8], "big") == 2
    for k, part in enumerate(parts):
        _, _, offset, size, _ = (int.from_bytes(whole[8 + 20 * k + 4 * j :][:4], "big") for j in range(5))
        assert whole[offset : offset + size] == part
        assert offset % 16384 == 0
