"""Scenarios in the formats of other tools: what is written and what is refused."""

import json
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support.exchanged import log_of, need, write
from support.plain import with_unit

from cosim import InputError
from cosim.export import export_fmu, export_osp, export_ssp
from cosim.export.__main__ import main as export
from cosim.files import file_stems
from cosim.fmu import FmuModel
from cosim.formats.elements import write_document
from cosim.formats.groups import QUANTITIES, osp_model_description, variable_groups, variables_of_group
from cosim.formats.namespaces import SSP_SPACES
from cosim.scenario import load_scenario
from cosim.system import prepare
from fmus.base_units import base_exponents


def test_parameters_are_baked_into_our_fmus(own, tmp_path):
    """A tool that ignores parameter sets gets the right numbers: here they are taken out."""
    write(own, tmp_path / "osp", export_osp)
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    tree = ElementTree.parse(structure)
    taken = 0
    for simulator in tree.iter():
        for child in list(simulator):
            if child.tag.endswith("InitialValues"):
                simulator.remove(child)
                taken += 1
    assert taken == 1
    tree.write(structure)
    starts = FmuModel(tmp_path / "osp" / "vessel.fmu").variables
    assert float(starts["delta_X_u"].start) == -3.0
    _, before = log_of(own, tmp_path / "before")
    _, after = log_of(tmp_path / "osp", tmp_path / "after")
    assert before == after


def test_two_exports_are_the_same_bytes(portable, tmp_path):
    for name in ("a.ssp", "b.ssp"):
        write(portable, tmp_path / name, export_ssp)
    assert (tmp_path / "a.ssp").read_bytes() == (tmp_path / "b.ssp").read_bytes()


def test_exports_are_valid(portable, tmp_path):
    """The schema of SSP by FMPy; that of OSP is in libcosim, which reads nothing else."""
    from fmpy import read_model_description
    from fmpy.ssp.ssd import read_ssd

    write(portable, tmp_path / "system.ssp", export_ssp)
    ssd = read_ssd(str(tmp_path / "system.ssp"))
    assert [c.name for c in ssd.system.elements] == list(portable["fmus"])
    need("container_jacobi")
    write(portable, tmp_path / "1 system.fmu", export_fmu)
    description = read_model_description(str(tmp_path / "1 system.fmu"), validate=True)
    assert description.coSimulation.modelIdentifier.isidentifier()
    outputs = {v.name for v in description.modelVariables if v.causality == "output"}
    assert {"vessel.x", "observer.x_hat", "controller.tau_X"} <= outputs
    assert description.author is None
    assert description.license is None


@pytest.mark.parametrize("suffix", ["ssp", "osp", "fmu"])
def test_faults_are_refused_or_left_out(ellipse, tmp_path, capsys, suffix):
    if suffix == "fmu":
        need("container_jacobi")
    (tmp_path / "s.json").write_text(json.dumps(ellipse))
    path = tmp_path / f"out.{suffix}"
    command = [str(tmp_path / "s.json"), f"--{suffix}", str(path)]
    assert export(command) == 2
    error = capsys.readouterr().err
    assert "freeze of observer.x_m" in error
    assert "--drop-faults" in error
    assert not path.exists()
    assert export([*command, "--drop-faults"]) == 0
    assert path.exists()
    assert "left out: the fault freeze" in capsys.readouterr().err


def test_events_travel_in_an_osp_directory_only(portable, tmp_path):
    portable["events"] = [
        {"time": 0.2, "model": "vessel", "variable": "delta_Y_v", "action": "override", "value": -9.0}
    ]
    with pytest.raises(InputError, match=r"the event override of vessel\.delta_Y_v at 0\.2 s"):
        write(portable, tmp_path / "s.ssp", export_ssp)
    write(portable, tmp_path / "osp", export_osp)
    _, before = log_of(portable, tmp_path / "before")
    _, after = log_of(tmp_path / "osp", tmp_path / "after")
    assert before == after
    _, without = log_of(portable | {"events": []}, tmp_path / "without")
    assert without != after
    portable["events"].append({"time": 0.3, "model": "vessel", "variable": "x_m", "action": "hold"})
    with pytest.raises(InputError, match="the event hold"):
        write(portable, tmp_path / "osp", export_osp)


def test_a_step_of_its_own_travels_to_osp_only(chain, tmp_path):
    chain["fmus"]["gain"]["step"] = 0.5
    with pytest.raises(InputError, match=r"cannot hold a step of 0\.5 s"):
        write(chain, tmp_path / "s.ssp", export_ssp)
    notes = write(chain, tmp_path / "osp", export_osp)
    assert any("at the start of that step" in note for note in notes)
    assert log_of(chain, tmp_path / "a")[1] == log_of(tmp_path / "osp", tmp_path / "b")[1]


@pytest.mark.parametrize(("algorithm", "later"), [("gauss_seidel", True), ("jacobi", False)])
def test_values_that_arrive_a_step_later_in_other_tools_are_noted(chain, tmp_path, algorithm, later):
    chain["algorithm"] = algorithm
    for how, suffix in ((export_ssp, ".ssp"), (export_osp, "")):
        notes = write(chain, tmp_path / f"s{suffix}", how)
        assert any("values arrive one step later" in note for note in notes) == later


def test_a_transformation_needs_a_connection(chain, tmp_path):
    chain["transformations"] = {"gain.x": {"factor": 2.0}}
    with pytest.raises(InputError, match=r"gain\.x is not connected; did you mean 'gain\.u'"):
        prepare(load_scenario(chain))


def test_an_osp_directory_replaces_only_its_like(portable, tmp_path, capsys):
    (tmp_path / "s.json").write_text(json.dumps(portable))
    (tmp_path / "osp").mkdir()
    (tmp_path / "osp" / "thesis.txt").write_text("mine")
    command = [str(tmp_path / "s.json"), "--osp", str(tmp_path / "osp")]
    assert export(command) == 2
    assert "not an OSP directory" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "osp").iterdir()] == ["thesis.txt"]
    (tmp_path / "osp" / "thesis.txt").unlink()
    assert export(command) == 0
    assert export(command) == 2
    assert export([*command, "--overwrite"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["osp", "s.json"]


@pytest.mark.parametrize("name", ["notes.txt", "scenarios/mine.json", "empty/"])
def test_an_osp_directory_with_other_files_is_not_replaced(chain, tmp_path, name):
    folder = tmp_path / "osp"
    write(chain, folder, export_osp)
    (folder / name).mkdir() if name.endswith("/") else (folder / name).write_text("mine")
    before = {path: path.stat() for path in folder.rglob("*")}
    with pytest.raises(InputError, match=f"also holds {name.rstrip('/')}, which this export"):
        write(chain, folder, export_osp)
    assert {path: path.stat() for path in folder.rglob("*")} == before


@pytest.mark.parametrize("suffix", ["ssp", "fmu", "osp"])
def test_a_relative_path_is_as_good(chain, tmp_path, monkeypatch, suffix):
    if suffix == "fmu":
        need("container_jacobi")
    monkeypatch.chdir(tmp_path)
    kind = {"ssp": export_ssp, "fmu": export_fmu, "osp": export_osp}[suffix]
    write(chain, Path(f"sub/system.{suffix}"), kind)
    assert [path.name for path in (tmp_path / "sub").iterdir()] == [f"system.{suffix}"]


@pytest.mark.parametrize(
    ("path", "change", "message"),
    [
        (".", {}, "is the working directory"),
        ("sub/..", {}, "is the working directory"),
        ("x" * 300, {}, "cannot be written: File name too long"),
        ("x" * 300 + ".ssp", {}, "cannot be written: File name too long"),
        ("osp", {"name": "n" * 260}, "'osp' cannot be written: File name too long: 'nnn"),
    ],
)
def test_a_path_that_cannot_be_written_is_told(chain, tmp_path, monkeypatch, path, change, message):
    work = tmp_path / "work"
    (work / "sub").mkdir(parents=True)
    write(chain, work / "osp", export_osp)
    for part in (work / "osp").iterdir():
        part.rename(work / part.name)
    (work / "osp").rmdir()
    before = sorted(work.rglob("*"))
    monkeypatch.chdir(work)
    with pytest.raises(InputError, match=message):
        write(chain | change, Path(path), export_ssp if path.endswith(".ssp") else export_osp)
    assert sorted(work.rglob("*")) == before


@pytest.mark.parametrize("how", [export_ssp, export_osp, export_fmu])
@pytest.mark.parametrize(
    ("change", "where"),
    [({"description": "one\x01two"}, "description"), ({"name": "one\ufffetwo"}, "name")],
)
def test_what_xml_cannot_hold_is_refused(chain, tmp_path, how, change, where):
    suffix = how.__name__.removeprefix("export_")
    with pytest.raises(InputError, match=f"^{where}: XML cannot hold the character"):
        write(chain | change, tmp_path / f"out.{suffix}", how)
    assert not (tmp_path / f"out.{suffix}").exists()


@pytest.mark.parametrize(
    ("text", "fits", "message"),
    [
        ("\x02", (), "fmus.a: file: XML cannot hold"),
        (
            "a b\n",
            (export_ssp, export_osp),
            "fmus.a: file: a container FMU cannot hold a text with blanks",
        ),
        ('é<&">', (export_ssp, export_osp, export_fmu), ""),
    ],
)
def test_texts_travel_where_they_can(plain_fmu, tmp_path, text, fits, message):
    need("container_jacobi")
    init = """
        self.file = "route.csv"
        self.register_variable(String("file", start="route.csv", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
    """
    entry = {"path": str(plain_fmu("Texts", init)), "parameters": {"file": text}}
    content = {"name": "x", "step": 0.1, "stop": 1.0, "fmus": {"a": entry}}
    for how, suffix in ((export_ssp, "ssp"), (export_osp, "osp"), (export_fmu, "fmu")):
        path = tmp_path / f"out.{suffix}"
        if how not in fits:
            with pytest.raises(InputError, match=message):
                write(content, path, how)
            continue
        write(content, path, how)
        if how is not export_fmu:
            assert load_scenario(path, {"stop": 1.0, "step": 0.1}).fmus["a"].parameters == {"file": text}


def test_a_refused_transformation_is_named(chain, tmp_path):
    chain["transformations"] = {"gain.u": {"factor": 2.0}}
    with pytest.raises(InputError, match=r"can transform values: transformations\.gain\.u"):
        write(chain, tmp_path / "s.ssp", export_ssp)


def test_a_conversion_that_is_switched_off_stays_off(angles, tmp_path):
    with pytest.raises(InputError, match="can convert 'deg' to 'rad'"):
        write(angles, tmp_path / "s.ssp", export_ssp)
    angles["transformations"] = {"gain.u": {}}
    write(angles, tmp_path / "s.ssp", export_ssp)
    assert log_of(angles, tmp_path / "a")[1] == log_of(tmp_path / "s.ssp", tmp_path / "b")[1]


def test_models_of_one_name_have_one_description_or_none(plain_fmu, tmp_path):
    """libcosim finds it by the model's name."""

    def model(file, variable):
        (tmp_path / file).mkdir()
        init = (
            f"self.{variable} = 0.0\n"
            f"self.register_variable(Real('{variable}', causality=Fmi2Causality.output))"
        )
        fmu = plain_fmu("Same", init, edits=with_unit("m", 'm="1"'))
        return {"path": str(fmu.rename(tmp_path / file / "Same.fmu"))}

    one, other = model("one", "pos_x"), model("other", "target_x")
    content = {"name": "x", "step": 0.1, "stop": 1.0, "algorithm": "jacobi"}
    for second, notes in ((one, 0), (other, 1)):
        fmus = {"a": one, "b": second}
        folder = tmp_path / f"osp_{notes}"
        found = write(content | {"fmus": fmus}, folder, export_osp)
        assert len([note for note in found if "'Same_OspModelDescription.xml'" in note]) == notes
        assert (folder / "Same_OspModelDescription.xml").exists() == (notes == 0)


@pytest.mark.parametrize(("name", "convention"), [("ramp", "structured"), ("é ü-1", "flat")])
def test_a_container_states_its_naming_convention(chain, tmp_path, name, convention, caplog):
    from fmpy import read_model_description

    need("container_jacobi")
    chain["fmus"] = {name: chain["fmus"]["ramp"], "gain": chain["fmus"]["gain"]}
    chain["connections"] = []
    write(chain, tmp_path / f"{name}.fmu", export_fmu)
    description = read_model_description(str(tmp_path / f"{name}.fmu"), validate=True)
    assert description.variableNamingConvention == convention
    assert description.coSimulation.modelIdentifier.isascii()
    assert "not connected" not in caplog.text


def test_isolation_stays_behind(chain, tmp_path):
    chain["fmus"]["gain"] = {"path": chain["fmus"]["gain"]["path"], "isolate": True}
    with pytest.raises(InputError, match="the isolation of gain"):
        write(chain, tmp_path / "s.ssp", export_ssp)
    assert "left out: the isolation of gain" in write(chain, tmp_path / "s.ssp", export_ssp, drop=True)


def test_nothing_is_left_after_a_failure(chain, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr("cosim.export.ssp.write_document", fail)
    before = {*tmp_path.iterdir()}
    with pytest.raises(InputError, match="disk full"):
        write(chain, tmp_path / "s.ssp", export_ssp)
    assert {*tmp_path.iterdir()} == before


def test_a_missing_toolbox_is_told(chain, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmu_manipulation_toolbox.container", None)
    with pytest.raises(InputError, match=r"cybership\[export\]"):
        write(chain, tmp_path / "c.fmu", export_fmu)


def test_file_names_are_safe_and_differ():
    stems = file_stems(["a b", "a/b", "A_B", "../x", "ship"])
    assert len({stem.lower() for stem in stems}) == 5
    assert all(stem.replace("_", "").isalnum() for stem in stems)


def test_the_quantities_of_osp_have_the_dimensions_of_their_units():
    units = {"Force": "N", "Torque": "N.m"}
    for of, time in (("Displacement", ""), ("Velocity", "/s"), ("Acceleration", "/s2")):
        units |= {f"Linear{of}": f"m{time}", f"Angular{of}": f"rad{time}"}
    assert {q.tag for q in QUANTITIES} == set(units)
    for q in QUANTITIES:
        exponents = dict(zip(("kg", "m", "s", "rad"), q.unit, strict=True))
        assert {base: n for base, n in exponents.items() if n} == base_exponents(units[q.tag])
        assert {len(axes) for axes in q.axes} == {3}


def test_variable_groups_hold_what_belongs_together(fmus):
    """Along the axes, one causality and one unit in each, nothing twice."""
    for path in fmus.values():
        model = FmuModel(path)
        groups = variable_groups(model)
        for name, (quantity, names) in groups.items():
            members = [model.variables[n] for n in names]
            assert 1 <= len(members) <= 3
            assert len({m.causality for m in members}) == 1
            assert len({m.unit.name for m in members}) == 1
            assert name.startswith(quantity.word)
        names = [n for _, (_, members) in groups.items() for n in members]
        assert len(names) == len(set(names))
    vessel = variable_groups(FmuModel(fmus["vessel"]))
    assert vessel["force_tau"][1] == ["tau_X", "tau_Y"]
    assert vessel["torque_tau"][1] == ["tau_N"]
    assert vessel["linear_velocity"][1] == ["u", "v"]
    assert vessel["angular_displacement_m"][1] == ["psi_m"]


def test_the_written_groups_are_of_the_standard_and_are_read_back(fmus, tmp_path):
    model, file = FmuModel(fmus["vessel"]), tmp_path / "vessel.xml"
    root = osp_model_description(model)
    write_document(root, file)
    groups = variable_groups(model)
    assert {name: variables_of_group(file, name) for name in groups} == {
        name: members for name, (_, members) in groups.items()
    }
    kinds = {group.tag for group in root.find("VariableGroups")}
    assert kinds == {"Force", "Torque", "LinearVelocity", "AngularVelocity", "LinearDisplacement",
                     "AngularDisplacement", "LinearAcceleration", "AngularAcceleration"}  # fmt: skip


def test_the_namespaces_are_those_of_the_standard():
    """libcosim and Ecos look for prefixes, FMPy for namespaces."""
    assert {prefix: uri.rpartition("/")[2] for prefix, uri in SSP_SPACES.items()} == {
        "ssd": "SystemStructureDescription",
        "ssc": "SystemStructureCommon",
        "ssv": "SystemStructureParameterValues",
        "osp": "OSPAnnotations",
    }


def test_another_ship_is_exported(tmp_path, capsys):
    """The FMUs with a bare name are those of --ship; one that there is not is refused."""
    content = {
        "name": "ship", "step": 0.1, "stop": 1.0,
        "fmus": {"thrusters": {"path": "thrusters.fmu"}, "vessel": {"path": "vessel.fmu"}},
        "connections": [["thrusters.tau_act_*", "vessel.tau_*"]],
    }  # fmt: skip
    path = tmp_path / "ship.json"
    path.write_text(json.dumps(content))
    assert export([str(path), "--ship", "otter", "--osp", str(tmp_path / "osp")]) == 0
    starts = FmuModel(tmp_path / "osp" / "vessel.fmu").variables
    assert float(starts["m"].start) == 80.0
    assert export([str(path), "--ship", "ottr", "--osp", str(tmp_path / "other")]) == 2
    assert "otter" in capsys.readouterr().err
    assert not (tmp_path / "other").exists()
