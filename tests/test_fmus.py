"""The FMUs as other tools see them, equal to their plain Python; test_check.py has all rules of FMI on them."""

import math
import os
import random
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import fmpy
import numpy as np
import pytest
from fmpy.model_description import read_model_description
from fmpy.validation import validate_fmu
from support.command import command
from support.cse1 import VESSEL
from support.opened import Opened
from support.project import COMPONENTS, ROOT

from cosim.system.own_fmus import builder_options
from fmus.build import BuildError, build, building, packing
from fmus.build.__main__ import main
from fmus.declare import flatten, packer, width
from fmus.fmi.slave import Slave, StateError
from fmus.ship import ship
from fmus.ships.naming import described_ship

every_fmu = pytest.mark.parametrize("name", COMPONENTS)


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """Where the FMUs of the project are unpacked, once for all tests of this file."""
    return tmp_path_factory.mktemp("unpacked")


@pytest.fixture
def opened(tmp_path, unpacked, fmus):
    """A function that opens an FMU by name or path; closed after the test."""
    instances = []

    def make(fmu, name="instance"):
        folder = unpacked if fmu in fmus else tmp_path
        instances.append(Opened(fmus.get(fmu, fmu), folder, name))
        return instances[-1]

    yield make
    for instance in instances:
        instance.close()


def shake(fmu, rng):
    """Random inputs of a size that every component meets."""
    fmu.set(**{name: rng.uniform(-0.5, 0.5) for name in fmu.inputs}) if fmu.inputs else None


def play(fmu, rng, steps, start=0, h=0.01):
    """Outputs after each of some steps with random inputs."""
    rows = []
    for k in range(start, start + steps):
        shake(fmu, rng)
        fmu.step(k * h, h)
        rows.append(fmu.get())
    return rows


@every_fmu
def test_every_variable_has_unit_and_description(name, fmus):
    d = read_model_description(str(fmus[name]))
    units = {u.name: u.baseUnit for u in d.unitDefinitions}
    for v in d.modelVariables:
        assert v.description
        assert units[v.unit] is not None
    outputs = [v.name for v in d.modelVariables if v.causality == "output"]
    assert [u.variable.name for u in d.outputs] == outputs
    assert [u.variable.name for u in d.initialUnknowns] == outputs
    assert all(u.dependencies is not None for u in d.outputs)
    assert d.coSimulation.canGetAndSetFMUstate
    assert d.coSimulation.canSerializeFMUstate
    assert d.coSimulation.canHandleVariableCommunicationStepSize


@every_fmu
def test_fmu_alone_agrees_with_its_plain_python(name, fmus):
    component = COMPONENTS[name]
    rng = random.Random(name)
    n, h = 100, 0.01
    names = [v.name for v in component.variables]
    first, last = width(component.params), width(component.params) + width(component.inputs)
    inputs = names[first:last]
    rows = [[rng.uniform(-0.5, 0.5) for _ in inputs] for _ in range(n + 1)]
    signal = np.array(
        [(k * h, *row) for k, row in enumerate(rows)],
        dtype=[("time", float), *((i, float) for i in inputs)],
    )
    result = fmpy.simulate_fmu(
        str(fmus[name]),
        stop_time=n * h,
        output_interval=h,
        input=signal if inputs else None,
        output=names[last:],
        start_values=dict(zip(inputs, rows[0], strict=True)),
    )
    pack, params = packer(component.inputs), component.params()
    state = component.init(pack(rows[0]), params)
    expected = [flatten(component.step(state, pack(rows[0]), params, 0.0)[1])]
    for row in rows[:n]:
        state, outputs = component.step(state, pack(row), params, h)
        expected.append(flatten(outputs))
    got = np.array([list(row)[1:] for row in result.tolist()])
    assert got.shape == np.shape(expected)
    # FMPy's communication steps differ from h in the last bits.
    assert np.allclose(got, expected, rtol=1e-9, atol=1e-11)


@every_fmu
def test_bad_input_does_not_poison_the_state(name, opened):
    """Afterwards the outputs are of the size that they have without any bad input."""
    healthy = opened(name, "healthy").initialise()
    usual = play(healthy, random.Random(0), 20)
    for _ in healthy.inputs:
        usual += play(healthy, random.Random(1), 1)
    usual += play(healthy, random.Random(2), 20)
    limit = max(100.0, 10.0 * np.abs(usual).max(initial=0.0))
    for bad in (math.nan, math.inf, -math.inf):
        fmu = opened(name, f"given {bad}").initialise()
        play(fmu, random.Random(0), 20)
        for input_ in fmu.inputs:
            for k in range(2):
                fmu.set(**{input_: bad})
                fmu.step(0.2 + 0.01 * k)
                assert all(map(math.isfinite, fmu.get())), (input_, bad)
            play(fmu, random.Random(1), 1)
        rows = play(fmu, random.Random(2), 20)
        assert all(math.isfinite(x) and abs(x) < limit for row in rows for x in row), bad


def test_initial_outputs_follow_inputs_and_parameters(opened):
    thrusters = opened("thrusters").initialise(tau_X=0.5, F_vsp=2.0)
    assert thrusters.get("u_vsp_x", "tau_cmd_X") == pytest.approx([0.25, 0.5])
    vessel = opened("vessel").initialise(x_0=1.0, tau_X=1.679)
    assert vessel.get("x", "u_dot") == pytest.approx([1.0, 0.1])


def test_parameters_are_tunable_and_initial_values_are_not(opened):
    vessel = opened("vessel").initialise(u_0=0.1)
    vessel.step(0.0)
    vessel.set(delta_X_u=-4.0)
    vessel.step(0.01)
    assert vessel.get("omega_X")[0] == pytest.approx(-0.4, rel=0.01)
    vessel.set(x_0=99.0)
    assert "x_0 is fixed" in vessel.messages[-1][1]
    assert vessel.get("x_0") == [5.0]


def test_what_cannot_be_set_is_told_and_changes_nothing(opened):
    vessel = opened("vessel").initialise()
    before = vessel.get()
    vessel.set(x=3.0)
    vessel.set(X_u=math.nan)
    assert vessel.get() == before
    assert vessel.get("X_u") == [-0.6555]
    assert [status for status, _ in vessel.messages] == [1, 1]


def test_failing_step_is_told_with_its_cause_and_keeps_the_state(opened):
    vessel = opened("vessel").initialise()
    vessel.step(0.0)
    before = vessel.get()
    vessel.set(tau_X=1e300)
    with pytest.raises(Exception, match="discard"):
        vessel.step(0.01)
    status, text = vessel.messages[-1]
    assert status == 3
    assert "not finite" in text or "OverflowError" in text
    assert vessel.get() == before
    vessel.set(tau_X=0.0)
    vessel.step(0.01)


def test_controller_holds_its_last_good_input(opened):
    controller = opened("controller_bs").initialise(x_hat=0.3)
    controller.step(0.0)
    before = controller.get("tau_X")
    controller.set(x_hat=math.nan)
    controller.step(0.01)
    assert controller.get("tau_X") == before
    assert "x_hat is nan" in controller.messages[-1][1]


def run_build(*arguments):
    """The command in this process; files of effects, which it would keep, need one of their own."""
    return command(main, *arguments)


def test_command_line_builds_what_is_asked_for(tmp_path):
    done = run_build("vessel", "thrusters.fmu", "--out", tmp_path)
    assert done.returncode == 0
    assert done.stdout.split() == [str(tmp_path / "vessel.fmu"), str(tmp_path / "thrusters.fmu")]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["thrusters.fmu", "vessel.fmu"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["vesel"], "did you mean 'vessel'"),
        (["nothing.py"], "no such component file"),
        (["--out", __file__], "is a file"),
    ],
)
def test_command_line_refuses_with_one_line(arguments, message):
    done = run_build(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_list_names_every_fmu():
    listed = run_build("--list").stdout
    assert all(name in listed for name in COMPONENTS)


OWN = '''"""A controller from outside the project."""

from typing import Annotated, NamedTuple

from fmus.controller.backstepping import Inputs
from fmus.declare import Component
from fmus.signals import Force


class Params(NamedTuple):
    k: Annotated[float, "N/m", "gain"] = {gain}


class State(NamedTuple):
    pass


def init(i, p):
    return State()


def step(s, i, p, h):
    e = i.target.x_t - i.estimate.x_hat
    return s, Force(p.k * e, 0.0, 0.0)


COMPONENT = Component(
    "controller_mine", "Pulls towards the target", Params, State, Inputs, Force, init, step
)
'''


def test_two_versions_in_one_process_run_their_own_code(tmp_path, opened):
    instances = []
    for gain in (2.0, 5.0):
        own = tmp_path / str(gain) / "mine.py"
        own.parent.mkdir()
        own.write_text(OWN.format(gain=gain))
        (path,) = build([str(own)], own.parent)
        instances.append(opened(path, f"gain_{gain:.0f}").initialise(x_t=1.0))
    for fmu in instances:
        fmu.step(0.0)
    assert [fmu.get("tau_X") for fmu in instances] == [[2.0], [5.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1\n", "declares no COMPONENT"),
        ("import nowhere\n", "fails when imported"),
        ("x = 1\ndef y(:\n", "fails when imported: SyntaxError: invalid syntax, line 2"),
        (
            "from fmus.declare import component\n"
            "COMPONENT = component('pull', 'Spring', lambda i, p: None, lambda s, i, p, h: None)\n",
            "init and step need annotations",
        ),
        ("import sys\nsys.exit(5)\n", "fails when imported"),
        (OWN.format(gain="float('nan')"), "k starts at nan"),
        (
            OWN.format(gain=20.0)
            .replace('"gain"]', '"gain", Range(0.0, 10.0)]')
            .replace("import Component", "import Component, Range"),
            "k starts at 20, outside its range of 0 to 10",
        ),
        (OWN.format(gain=1.0).replace('"N/m"', '"furlong"'), "unknown unit 'furlong'"),
        (OWN.format(gain=1.0).replace('"controller_mine"', '"../mine"'), "cannot be the name of an FMU"),
        (
            OWN.format(gain=1.0).replace("return s, Force(p.k * e, 0.0, 0.0)", "return s, ()"),
            "0 outputs, 3 are",
        ),
        (OWN.format(gain=1.0).replace('Annotated[float, "N/m", "gain"]', "float"), "needs a unit"),
        (
            OWN.format(gain=1.0).replace("Force(p.k * e", "Force(None"),
            "an output is None, and no number",
        ),
        (
            OWN.format(gain=1.0).replace(
                "    return s, Force", "    import fmus.ops\n    return s, Force"
            ),
            "line 2[0-9]: fmus is imported at the top",
        ),
    ],
)
def test_a_users_file_that_is_no_component_is_refused(tmp_path, text, message):
    own = tmp_path / "mine.py"
    own.write_text(text)
    with pytest.raises(BuildError, match=message):
        build([str(own)], tmp_path)


def test_fmu_runs_from_its_own_archive_alone(fmus, tmp_path):
    """In a process that cannot import the project, and after the first FMU's folder is gone."""
    code = (
        "import fmpy, sys, importlib.util\n"
        "assert importlib.util.find_spec('cosim') is None, 'the project is importable'\n"
        "for path in sys.argv[1:]:\n"
        "    print(len(fmpy.simulate_fmu(path, stop_time=0.1, output_interval=0.01)))\n"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", f"import sys; sys.path += {_without_project()!r}\n{code}",
         *map(str, fmus.values())],
        capture_output=True, text=True, cwd=tmp_path, env={**os.environ, "PYTHONPATH": ""}, check=False,
    )  # fmt: skip
    assert done.stdout.split() == ["11"] * len(fmus), done.stderr


def _without_project():
    """The import path without this project, however it is installed."""
    return [p for p in sys.path if "site-packages" in p and not (ROOT / "cosim").is_relative_to(p)]


def test_source_change_gives_another_package_name(fmus):
    inside = zipfile.ZipFile(fmus["vessel"]).namelist()
    packages = {
        n.split("/")[1] for n in inside if n.startswith("resources/vessel_") and n.count("/") > 1
    }
    assert len(packages) == 1
    (package,) = packages
    assert len(package.removeprefix("vessel_")) == 16


def test_builds_at_the_same_time_do_not_disturb_each_other_and_are_byte_identical(fmus, tmp_path):
    """Also to the FMUs of this session, which another process has built in another folder; one of each kind."""
    names = [
        "vessel",
        "thrusters_table",
        "observer_kalman",
        "guidance_waypoints",
        "controller_cl_improved",
    ]
    env = {**os.environ, "CYBERSHIP_CACHE": str(tmp_path)}
    runs = [
        subprocess.Popen([sys.executable, "-m", "fmus.build", *names], stdout=subprocess.PIPE, text=True,
                         cwd=ROOT, env=env)
        for _ in range(2)
    ]  # fmt: skip
    outputs = [run.communicate()[0] for run in runs]
    assert all(run.returncode == 0 for run in runs)
    assert len(set(outputs)) == 1
    paths = [Path(line) for line in outputs[0].splitlines()]
    assert [path.stem for path in paths] == names
    for path in paths:
        assert validate_fmu(str(path)) == []
        assert path.read_bytes() == fmus[path.stem].read_bytes()
    assert not list(tmp_path.rglob("*.part"))


def test_cache_is_used_and_follows_the_source(tmp_path, monkeypatch):
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    (first,) = build(["vessel"])
    stamp = first.stat().st_mtime_ns
    assert build(["vessel.fmu"]) == [first]
    assert first.stat().st_mtime_ns == stamp
    copy = tmp_path / "source"
    shutil.copytree(ROOT / "fmus", copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "hull.py").write_text((copy / "hull.py").read_text() + "\n# changed\n")
    for module in (building, packing):
        monkeypatch.setattr(module, "ROOT", copy)
    building.own_source.cache_clear()  # a new process reads anew
    try:
        (second,) = build(["vessel"])
    finally:
        building.own_source.cache_clear()
    assert second != first
    assert second.read_bytes() != first.read_bytes()


def test_example_of_the_contributing_guide_works(tmp_path, opened):
    """As printed, outside the repository; and it passes the linter that a contribution has to pass."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    own = tmp_path / "pull.py"
    own.write_text(text.split("```python\n")[1].split("```")[0])
    (path,) = build([str(own)], tmp_path)
    assert validate_fmu(str(path)) == []
    fmu = opened(path).initialise(x_t=1.5)
    fmu.step(0.0)
    assert fmu.get("tau_X") == [3.0]
    checks = [
        ["check", "--config", str(ROOT / "pyproject.toml")],
        ["format", "--check", "--line-length=105"],
    ]
    for check in checks:
        done = subprocess.run(
            [sys.executable, "-m", "ruff", *check, str(own)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("    return s, Force(1.0 if p.k > 0 else 0.0)\n", "may not branch on a value"),
        ("    return s, Force(i.target.xt)\n", "has no attribute 'xt'"),
        ("    return s, Force(math.sin(i.target.x_t))\n", "may not branch on a value, convert it"),
    ],
)
def test_mistake_in_a_users_component_is_told_with_its_line(tmp_path, wrong, message):
    own = tmp_path / "mine.py"
    text = OWN.format(gain=1.0).replace("    e = i.target.x_t - i.estimate.x_hat\n", wrong)
    own.write_text(text.replace("from typing", "import math\nfrom typing"))
    done = run_build(own, "--out", tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert message in done.stderr
    assert f"{own}:" in done.stderr
    assert not list(tmp_path.glob("*.fmu"))


def test_list_of_one_fmu_names_all_its_variables():
    listed = run_build("--list", "vessel").stdout
    assert all(v.name in listed and v.description in listed for v in COMPONENTS["vessel"].variables)
    assert run_build("--list", "vesel").returncode == 2


@pytest.mark.parametrize("name", ["ops.py", "hull.py", "hyph-en.py", "class.py"])
def test_file_names_that_cannot_work_are_refused(tmp_path, name):
    (tmp_path / name).write_text(OWN.format(gain=1.0))
    with pytest.raises(BuildError, match="cannot be called"):
        build([str(tmp_path / name)], tmp_path)


@every_fmu
def test_parameters_at_their_limits_keep_outputs_finite(name, opened):
    fmu = opened(name)
    for v in COMPONENTS[name].variables:
        for limit in (v.range.min, v.range.max):
            if limit is not None:
                fmu.initialise(**{v.name: limit})
                rows = play(fmu, random.Random(0), 3)
                assert np.isfinite(rows).all(), (v.name, limit)
                fmu.fmu.reset()


def test_step_that_is_no_step_is_an_error(opened):
    vessel = opened("vessel").initialise()
    for h in (-0.01, math.nan, math.inf, 1e9):
        with pytest.raises(Exception, match="discard"):
            vessel.step(0.0, h)
    assert len(vessel.messages) == 4


def test_serialised_state_of_a_python_fmu_is_refused_where_it_was_changed():
    kinds = {name: {"component": VESSEL, "code_hash": name, "code_version": "0"} for name in "ab"}
    one, other = (type("Ship", (Slave,), attributes)(instance_name="a") for attributes in kinds.values())
    one.exit_initialization_mode()
    saved = one._fmu_state_to_bytes(one._get_fmu_state())
    assert one._fmu_state_from_bytes(saved) == one._get_fmu_state()
    with pytest.raises(StateError, match="not a state of this FMU"):
        other._fmu_state_from_bytes(saved)
    with pytest.raises(StateError, match="another version"):
        one._fmu_state_from_bytes(b"[2" + saved[2:])
    with pytest.raises(StateError, match="checksum"):
        one._fmu_state_from_bytes(saved.replace(b"0.0", b"0.5", 1))


def test_another_source_is_another_key(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "ROOT", tmp_path)
    seen = []

    def key_with(name, content):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(content, encoding="utf-8")
        building.own_source.cache_clear()
        seen.append(building.own_source())
        return seen[-1]

    try:
        first = key_with("a.py", "x = 1")
        assert key_with("b/wave.c", "int x;") not in seen[:-1]
        assert key_with("a.py", "x = 2") not in seen[:-1]
        assert key_with("b/wave.c", "int y;") not in seen[:-1]
        present = seen[-1]
        assert key_with("notes.md", "no code") == present
        (tmp_path / "b/wave.c").unlink()
        assert key_with("a.py", "x = 1") == first
    finally:
        building.own_source.cache_clear()


@pytest.mark.parametrize("name", [None, "otter"])
def test_the_builder_is_told_the_ship_and_whether_to_compile(name):
    scenario = SimpleNamespace(ship=name, ship_source=name)
    of_ship = [] if name is None else ["--ship=otter"]
    assert builder_options(scenario, native=False) == of_ship
    assert builder_options(scenario, native=True) == ["--native", *of_ship]


def test_the_key_of_a_build_covers_all_that_it_reads(tmp_path):
    own, other = tmp_path / "own.py", tmp_path / "other.py"
    own.write_text("x = 1", encoding="utf-8")
    other.write_text("x = 1", encoding="utf-8")
    native = SimpleNamespace(key="gcc 12")
    inputs = [
        (None, ship(), {}, None),
        (own, ship(), {}, None),
        (other, ship(), {}, None),
        (None, ship(description=described_ship("otter")), {}, None),
        (None, ship(), {"m": 20.0}, None),
        (None, ship(), {"m": 21.0}, None),
        (None, ship(), {}, native),
        (None, ship(), {}, SimpleNamespace(key="gcc 13")),
    ]
    keys = [building._source_hash(*each) for each in inputs]
    assert keys == [building._source_hash(*each) for each in inputs]
    own.write_text("x = 2", encoding="utf-8")
    keys.append(building._source_hash(*inputs[1]))
    assert len(set(keys)) == len(keys)
