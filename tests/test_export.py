"""Scenarios in the formats of other tools: what is written, what those tools make of it, and back again."""

import importlib
import json
import shutil
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import cosim
from benchmarks import same_answer
from cosim import InputError
from cosim.exchange.groups import NAMESPACE as OSP_MODELS
from cosim.exchange.groups import variable_groups
from cosim.exchange.portable import file_stems
from cosim.exchange.read_ssp import MAPPINGS
from cosim.exchange.ssp import SPACES
from cosim.export import export_fmu, export_osp, export_ssp
from cosim.export import main as export
from cosim.fmu import Model
from cosim.scenario import load_scenario
from cosim.system import prepare

STEPS = 200
NEEDS = {
    "libcosim_ssp": ("libcosimpy.CosimExecution", "libcosimpy"),
    "libcosim_osp": ("libcosimpy.CosimExecution", "libcosimpy"),
    "ecos": ("ecospy.EcosSimulation", "ecospy and the TBB library"),
    "fmpy": ("fmpy.ssp.simulation", "fmpy"),
    "container_jacobi": ("fmu_manipulation_toolbox.container", "fmu-manipulation-toolbox"),
    "container_gauss_seidel": ("fmu_manipulation_toolbox.container", "fmu-manipulation-toolbox"),
}


def need(case):
    module, what = NEEDS[case]
    try:
        importlib.import_module(module)
    except (ImportError, OSError) as error:
        pytest.skip(f"needs {what}: {error}")


@pytest.fixture
def portable(ellipse):
    """The ellipse scenario without what cannot travel."""
    return ellipse | {"faults": [], "algorithm": "jacobi", "stop": 0.5}


@pytest.fixture
def own(portable):
    """The same with parameters of its own."""
    portable["fmus"]["vessel"]["parameters"] |= {"x_0": 4.5, "delta_X_u": -3.0}
    return portable


@pytest.fixture
def chain(plain_fmu, tmp_path):
    """Two foreign FMUs: a ramp, and a gain with a parameter that only it knows."""
    plain_fmu("Ramp", "self.y = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))",
              "self.y += h\nreturn True")  # fmt: skip
    plain_fmu(
        "Gain",
        "self.u = 0.0\nself.y = 0.0\nself.k = 1.0\n"
        "self.register_variable(Real('u', causality=Fmi2Causality.input))\n"
        "self.register_variable(Real('y', causality=Fmi2Causality.output))\n"
        "self.register_variable(Real('k', start=1.0, causality=Fmi2Causality.parameter,"
        " variability=Fmi2Variability.tunable))",
        "self.y = self.k * self.u\nreturn True",
    )
    return {
        "name": "chain", "step": 0.25, "stop": 1.0, "algorithm": "jacobi",
        "fmus": {"ramp": {"path": str(tmp_path / "Ramp.fmu")},
                 "gain": {"path": str(tmp_path / "Gain.fmu"), "parameters": {"k": 3.0}}},
        "connections": [["ramp.y", "gain.u"]],
    }  # fmt: skip


def write(content, path, how, drop=False):
    system = prepare(load_scenario(content))
    try:
        return how(system, path, drop)
    finally:
        system.close()


def log_of(source, folder, **changes):
    result = cosim.simulate(load_scenario(source, changes), folder)
    assert result.status == "done", result.message
    return result, (result.folder / "log.csv").read_text()


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """A folder with the exported ellipse, and this master's answers on demand."""
    work = tmp_path_factory.mktemp("answers")
    plan = same_answer.make_plan(work, STEPS)
    kept = {}

    def answer(case):
        if case not in kept:
            kept[case] = same_answer.run_apart(case, work)
        assert not isinstance(kept[case], str), kept[case]
        return kept[case][-STEPS:]

    answer.plan = plan
    return answer


@pytest.mark.parametrize("case", NEEDS)
def test_other_tools_give_the_same_answer(answers, case):
    need(case)
    _, relative = same_answer.difference(answers(case), answers(same_answer.CASES[case].like))
    assert relative <= same_answer.TOLERANCE


def test_the_comparison_sees_a_difference(answers):
    """The order of stepping, which all of them would miss if they looked at nothing."""
    _, relative = same_answer.difference(answers("gauss_seidel"), answers("jacobi"))
    assert relative > same_answer.TOLERANCE


def test_each_connection_of_the_loop_costs_a_step(answers):
    cases = ("jacobi", "jacobi_pushed", "gauss_seidel", "gauss_seidel_pushed")
    order = same_answer._order({case: answers(case) for case in cases}, answers.plan)
    assert list(order["steps"]["jacobi"].values()) == [2, 3, 4, 5]
    assert list(order["steps"]["gauss_seidel"].values()) == [1, 1, 1, 2]


@pytest.mark.parametrize("kind", ["ssp", "osp"])
def test_round_trip_gives_the_same_log(own, tmp_path, kind):
    path = tmp_path / ("system.ssp" if kind == "ssp" else "osp")
    assert write(own, path, export_ssp if kind == "ssp" else export_osp) == []
    _, before = log_of(own, tmp_path / "before")
    result, after = log_of(path, tmp_path / "after")
    assert before == after
    described = json.loads((result.folder / "log.json").read_text())
    assert described["scenario"]["step"] == own["step"]
    assert "jacobi" in described["notes"][-1]


def test_osp_structure_file_is_a_scenario(portable, tmp_path):
    write(portable, tmp_path / "osp", export_osp)
    _, whole = log_of(tmp_path / "osp", tmp_path / "a")
    _, file = log_of(tmp_path / "osp" / "OspSystemStructure.xml", tmp_path / "b")
    assert whole == file


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
    starts = Model(tmp_path / "osp" / "vessel.fmu").variables
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
    write(portable, tmp_path / "system.fmu", export_fmu)
    description = read_model_description(str(tmp_path / "system.fmu"), validate=True)
    outputs = {v.name for v in description.modelVariables if v.causality == "output"}
    assert {"vessel.x", "observer.x_hat", "controller.tau_X"} <= outputs


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


def test_events_act_in_libcosim(portable, tmp_path):
    need("libcosim_osp")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver

    portable["events"] = [
        {"time": 0.2, "model": "vessel", "variable": "delta_Y_v", "action": "override", "value": -9.0}
    ]
    write(portable, tmp_path / "osp", export_osp)
    execution = CosimExecution.from_osp_config_file(str(tmp_path / "osp"))
    manager = CosimManipulator.create_scenario_manager()
    observer = CosimObserver.create_last_value()
    assert execution.add_manipulator(manager)
    assert execution.add_observer(observer)
    assert execution.load_scenario(manager, str(tmp_path / "osp" / "scenarios" / "ellipse.json"))
    assert execution.step(round(portable["stop"] / portable["step"]))
    index = execution.slave_index_from_instance_name("vessel")
    references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
    found = observer.last_real_values(index, [references["v"], references["delta_Y_v"]])
    assert found[1] == -9.0
    result, _ = log_of(portable, tmp_path / "out")
    assert found[0] == pytest.approx(
        cosim.read_log(result.folder, ["vessel.v"])["vessel.v"][-1], rel=1e-9
    )


def test_foreign_parameters_travel_beside(chain, tmp_path):
    """Every tool but FMPy, which is told, takes them; the foreign FMUs are the same bytes."""
    notes = write(chain, tmp_path / "chain.ssp", export_ssp)
    assert len(notes) == 1
    assert "gain: k cannot be baked" in notes[0]
    write(chain, tmp_path / "osp", export_osp)
    assert (tmp_path / "osp" / "gain.fmu").read_bytes() == Path(
        chain["fmus"]["gain"]["path"]
    ).read_bytes()
    _, before = log_of(chain, tmp_path / "a")
    for source in ("chain.ssp", "osp"):
        assert log_of(tmp_path / source, tmp_path / "b")[1] == before
    plan = {"ssp": str(tmp_path / "chain.ssp"), "osp": str(tmp_path / "osp"), "step": 0.25, "steps": 4}
    plan |= {"outputs": ["gain.y"], "scenario": chain, "set": "start"}
    expected = same_answer.run_master(plan, "jacobi")[1:]
    assert expected[-1] == 3.0 * 1.75
    tmp_path.joinpath("plan.json").write_text(json.dumps(plan))
    for case in ("libcosim_ssp", "libcosim_osp", "ecos"):
        need(case)
        found = same_answer.run_apart(case, tmp_path)
        assert np.array_equal(found, expected), (case, found)


def test_start_values_are_in_the_container(chain, tmp_path):
    need("container_jacobi")
    write(chain, tmp_path / "chain.fmu", export_fmu)
    content = {
        "name": "c",
        "step": 0.25,
        "stop": 1.0,
        "fmus": {"all": {"path": str(tmp_path / "chain.fmu")}},
    }
    result, _ = log_of(content, tmp_path / "out")
    log = cosim.read_log(result.folder, ["all.gain.y"])
    assert log["all.gain.y"][-1] == 3.0 * 1.75


def test_a_step_of_its_own_travels_to_osp_only(chain, tmp_path):
    chain["fmus"]["gain"]["step"] = 0.5
    with pytest.raises(InputError, match=r"cannot hold a step of 0\.5 s"):
        write(chain, tmp_path / "s.ssp", export_ssp)
    notes = write(chain, tmp_path / "osp", export_osp)
    assert any("at the start of that step" in note for note in notes)
    assert log_of(chain, tmp_path / "a")[1] == log_of(tmp_path / "osp", tmp_path / "b")[1]


def test_transformations_travel_to_osp_only(chain, tmp_path):
    need("libcosim_osp")
    chain["transformations"] = {"gain.u": {"factor": 2.0, "offset": 0.5}}
    with pytest.raises(InputError, match=r"ramp\.y -> gain\.u"):
        write(chain, tmp_path / "s.ssp", export_ssp)
    write(chain, tmp_path / "osp", export_osp)
    _, log = log_of(chain, tmp_path / "a")
    assert float(log.splitlines()[-1].split(",")[-1]) == 3.0 * (2.0 * 1.75 + 0.5)
    assert log_of(tmp_path / "osp", tmp_path / "b")[1] == log
    plan = {"osp": str(tmp_path / "osp"), "steps": 4, "outputs": ["gain.y"]}
    tmp_path.joinpath("plan.json").write_text(json.dumps(plan))
    assert same_answer.run_apart("libcosim_osp", tmp_path)[-1] == 3.0 * (2.0 * 1.75 + 0.5)


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
    assert "no OSP directory" in capsys.readouterr().err
    assert [p.name for p in (tmp_path / "osp").iterdir()] == ["thesis.txt"]
    (tmp_path / "osp" / "thesis.txt").unlink()
    assert export(command) == 0
    (tmp_path / "osp" / "stale.fmu").touch()
    assert export(command) == 0
    assert not (tmp_path / "osp" / "stale.fmu").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["osp", "s.json"]


def test_nothing_is_left_after_a_failure(portable, tmp_path, monkeypatch):
    def fail(*arguments):
        raise OSError("disk full")

    monkeypatch.setattr("cosim.exchange.xml.write", fail)
    for fmu in portable["fmus"].values():
        fmu.pop("parameters", None)
    with pytest.raises(OSError, match="disk full"):
        write(portable, tmp_path / "s.ssp", export_ssp)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_toolbox_is_told(chain, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmu_manipulation_toolbox.container", None)
    with pytest.raises(InputError, match=r"cybership\[export\]"):
        write(chain, tmp_path / "c.fmu", export_fmu)


def test_file_names_are_safe_and_differ():
    stems = file_stems(["a b", "a/b", "A_B", "../x", "ship"])
    assert len({stem.lower() for stem in stems}) == 5
    assert all(stem.replace("_", "").isalnum() for stem in stems)


def test_variable_groups_hold_what_belongs_together(fmus):
    """Along the axes, one causality and one unit in each, nothing twice."""
    for path in fmus.values():
        model = Model(path)
        groups = variable_groups(model)
        for name, (quantity, names) in groups.items():
            members = [model.variables[n] for n in names]
            assert 1 <= len(members) <= 3
            assert len({m.causality for m in members}) == 1
            assert len({m.unit.name for m in members}) == 1
            assert name.startswith(quantity.word)
        names = [n for _, (_, members) in groups.items() for n in members]
        assert len(names) == len(set(names))
    vessel = variable_groups(Model(fmus["vessel"]))
    assert vessel["force_tau"][1] == ["tau_X", "tau_Y"]
    assert vessel["torque_tau"][1] == ["tau_N"]
    assert vessel["linear_velocity"][1] == ["u", "v"]
    assert vessel["angular_displacement_m"][1] == ["psi_m"]


def test_variable_groups_can_be_connected(portable, tmp_path):
    """libcosim and this master resolve a connection of groups to the same variables."""
    need("libcosim_osp")
    write(portable, tmp_path / "osp", export_osp)
    _, before = log_of(tmp_path / "osp", tmp_path / "a")
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    text = structure.read_text()
    for name in ("tau_X", "tau_Y"):
        wire = (
            "<VariableConnection>\n"
            f'      <Variable simulator="controller" name="{name}" />\n'
            f'      <Variable simulator="thrusters" name="{name}" />\n'
            "    </VariableConnection>"
        )
        assert wire in text
        text = text.replace(wire, "")
    group = (
        '<VariableGroupConnection><VariableGroup simulator="controller" name="force_tau"/>'
        '<VariableGroup simulator="thrusters" name="force_tau"/></VariableGroupConnection></Connections>'
    )
    structure.write_text(text.replace("</Connections>", group))
    _, after = log_of(tmp_path / "osp", tmp_path / "b")
    assert before == after
    plan = {"osp": str(tmp_path / "osp"), "steps": 50, "outputs": ["vessel.x"]}
    tmp_path.joinpath("plan.json").write_text(json.dumps(plan))
    found = same_answer.run_apart("libcosim_osp", tmp_path)
    assert found[-1, 0] == pytest.approx(
        cosim.read_log(tmp_path / "a", ["vessel.x"])["vessel.x"][-1], rel=1e-9
    )
    described = ElementTree.parse(tmp_path / "osp" / "vessel_OspModelDescription.xml").getroot()
    assert described.tag == f"{{{OSP_MODELS}}}OspModelDescription"


# What a foreign archive may hold: edits of SystemStructure.ssd, and the message or the last gain.y.
BINDING = (
    '<ssd:ParameterBindings><ssd:ParameterBinding{}><ssd:ParameterValues><ssv:ParameterSet version="1.0" '
    'name="p"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>{}'
    "</ssd:ParameterBinding></ssd:ParameterBindings>"
)
SIX = '<ssv:Parameter name="{}"><ssv:Real value="6.0"/></ssv:Parameter>'
MAPPING = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="stiff" target="k">'
    '<ssc:LinearTransformation factor="0.5" offset="1.0"/></ssm:MappingEntry></ssm:ParameterMapping>'
    "</ssd:ParameterMapping>"
)
SYSTEM = "<ssd:Elements>"


@pytest.mark.parametrize(
    ("edits", "factor"),
    [
        ([], 3.0),
        ([(SYSTEM, BINDING.format("", SIX.format("gain.k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format(' prefix="gain."', SIX.format("k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format("", SIX.format("stiff"), MAPPING.replace('"k"', '"gain.k"')) + SYSTEM)], 4.0),
        ([('endConnector="u" />', 'endConnector="u"><ssc:LinearTransformation factor="2"/></ssd:Connection>')], 6.0),
    ],
    ids=["component", "system", "prefix", "mapping", "transformation"],
)  # fmt: skip
def test_what_ssp_archives_may_hold(chain, tmp_path, edits, factor):
    path = edited(chain, tmp_path, edits)
    result, _ = log_of(path, tmp_path / "out")
    log = cosim.read_log(result.folder, ["gain.y"])
    assert log["gain.y"][-1] == factor * 1.75


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        ([("<ssd:Elements>", '<ssd:Elements><ssd:System name="inner"/>')], "nested systems are not supported"),
        ([(SYSTEM, "<ssd:SignalDictionaries/>" + SYSTEM)], "signal dictionaries are not supported"),
        ([("resources/gain.fmu", "resources/ramps.fmu")], "did you mean 'resources/ramp.fmu'"),
        ([("resources/gain.fmu", "http://example.org/gain.fmu")], "is not a file"),
        ([("resources/gain.fmu", "../../gain.fmu")], "has no '../../gain.fmu'"),
        ([('startElement="ramp"', 'startElement="rump"')], "no component 'rump'; did you mean 'ramp'"),
        ([("x-fmu-sharedlibrary", "x-ssp-package")], "type 'application/x-ssp-package' is not supported"),
        ([('startTime="0.0"', 'startTime="5.0"')], "starts at 5.0 s"),
        ([(' stopTime="1.0"', "")], "does not say its stop; give it by --stop"),
        ([('version="1.0" name="chain"', 'version="2.0" name="chain"')], "is of SSP 2.0"),
        ([('<ssv:Real value="3.0"', '<ssv:Real value="three"')], "gain.*k = 'three' is not a number"),
        ([('<ssv:Real value="3.0"', '<ssv:Binary value="00"')], "values of type Binary are not supported"),
        ([('endConnector="u"', 'endConnector="u" suppressUnitConversion="true"')], "suppressUnitConversion"),
        ([('endConnector="u" />', 'endConnector="u"><ssc:BooleanMappingTransformation/></ssd:Connection>')],
         "BooleanMappingTransformation is not supported"),
        ([("</ssd:Elements>", "")], "cannot be read"),
    ],
)  # fmt: skip
def test_what_ssp_archives_may_not_hold(chain, tmp_path, edits, message):
    path = edited(chain, tmp_path, edits)
    with pytest.raises(InputError, match=message):
        prepare(load_scenario(path)).close()


def edited(chain, tmp_path, edits):
    """Path of the chain as an archive, with the structure changed."""
    source, path = tmp_path / "plain.ssp", tmp_path / "edited.ssp"
    write(chain, source, export_ssp)
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "SystemStructure.ssd":
                text = content.decode().replace("xmlns:ssd=", f'xmlns:ssm="{MAPPINGS}" xmlns:ssd=', 1)
                for before, after in edits:
                    assert before in text
                    text = text.replace(before, after)
                content = text.encode()
            new.writestr(name, content)
    return path


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("fixedStep", "ecco"), "the algorithm 'ecco' is not supported"),
        (("<StartTime>0.0", "<StartTime>2.0"), "starts at 2 s"),
        (("</Simulators>", '</Simulators><Functions><Sum name="s" inputCount="2"/></Functions>'), "Sum is not supported"),
        (('source="gain.fmu"', 'source="proxyfmu://host?file=gain.fmu"'), "is not a file"),
        (('source="gain.fmu"', 'source="gone.fmu"'), "no such FMU"),
        (('simulator="ramp"', 'simulator="rump"'), "no simulator 'rump'; did you mean 'ramp'"),
        (('value="3.0"', 'value="x"'), "k = 'x' is not a number"),
        (("</OspSystemStructure>", ""), "cannot be read"),
    ],
)  # fmt: skip
def test_what_osp_directories_may_not_hold(chain, tmp_path, edit, message):
    write(chain, tmp_path / "osp", export_osp)
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    assert edit[0] in structure.read_text()
    structure.write_text(structure.read_text().replace(*edit))
    with pytest.raises(InputError, match=message):
        prepare(load_scenario(tmp_path / "osp")).close()


def test_several_osp_scenarios_leave_the_choice(chain, tmp_path):
    write(chain, tmp_path / "osp", export_osp)
    folder = tmp_path / "osp" / "scenarios"
    shutil.copyfile(folder / "chain.json", folder / "other.json")
    with pytest.raises(InputError, match="does not say its stop"):
        load_scenario(tmp_path / "osp")
    scenario = load_scenario(tmp_path / "osp", {"stop": 2.0})
    assert "none of several scenarios" in scenario.notes[0]


def test_unpacked_archives_go_when_nobody_needs_them(chain, tmp_path):
    write(chain, tmp_path / "chain.ssp", export_ssp)
    scenario = load_scenario(tmp_path / "chain.ssp")
    folder = scenario.folder
    assert folder.is_dir()
    del scenario
    assert not folder.exists()


def test_the_command_line_runs_an_archive(chain, tmp_path, capsys):
    from cosim.run import main as run

    write(chain, tmp_path / "chain.ssp", export_ssp)
    command = [str(tmp_path / "chain.ssp"), "--out", str(tmp_path / "out"), "--no-plots"]
    assert run([*command, "--stop", "2", "--step", "0.5"]) == 0
    assert "5 rows" in capsys.readouterr().out
    assert run([*command[:1], "--stop", "2.1", *command[1:]]) == 2
    assert "not a multiple" in capsys.readouterr().err


def test_the_namespaces_are_those_of_the_standard():
    """libcosim and Ecos look for prefixes, FMPy for namespaces."""
    assert {prefix: uri.rpartition("/")[2] for prefix, uri in SPACES.items()} == {
        "ssd": "SystemStructureDescription",
        "ssc": "SystemStructureCommon",
        "ssv": "SystemStructureParameterValues",
        "osp": "OSPAnnotations",
    }
