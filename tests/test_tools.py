"""What other tools make of an exported system."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import numpy as np
import pytest
from support.cases import in_part
from support.exchanged import NEEDS, log_of, need, write
from support.shared import once

import cosim
from benchmarks import same_answer
from cosim import InputError
from cosim.export import export_fmu, export_osp, export_ssp
from cosim.export.__main__ import main as export
from cosim.formats.namespaces import OSP_MODELS

TOOLS = (Path(__file__).parent.parent / "docs" / "tools.md").read_text()
STEPS = 200


@pytest.fixture(scope="module")
def answers(shared):
    """The answers of this master and of other tools on demand, each made once for all worker processes."""
    work = once(shared / "answers", lambda folder: same_answer.make_plan(folder, STEPS))

    def answer(case):
        def work_out(folder):
            found = same_answer.run_apart(case, work)
            assert not isinstance(found, str), found
            np.save(folder / "found.npy", found)

        return np.load(once(shared / f"answer_{case}", work_out) / "found.npy")[-STEPS:]

    answer.plan = json.loads((work / "plan.json").read_text())
    return answer


def python(code, folder, *arguments):
    """What a process of its own prints: what goes wrong in the binary of another tool stays there."""
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("case", in_part(NEEDS, keep=["libcosim_osp"]))
def test_other_tools_give_the_same_answer(answers, case):
    need(case)
    _, relative = same_answer.difference(answers(case), answers(same_answer.CASES[case].like))
    assert relative <= same_answer.TOLERANCE


@pytest.mark.slow
def test_the_comparison_sees_a_difference(answers):
    """The order of stepping, which all of them would miss if they looked at nothing."""
    _, relative = same_answer.difference(answers("gauss_seidel"), answers("jacobi"))
    assert relative > same_answer.TOLERANCE


def test_each_connection_of_the_loop_costs_a_step(answers):
    cases = ("jacobi", "jacobi_pushed", "gauss_seidel", "gauss_seidel_pushed")
    order = same_answer._order({case: answers(case) for case in cases}, answers.plan)
    assert list(order["steps"]["jacobi"].values()) == [2, 3, 4, 5]
    assert list(order["steps"]["gauss_seidel"].values()) == [1, 1, 1, 2]


WITH_EVENTS = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver

execution = CosimExecution.from_osp_config_file("osp")
manager, observer = CosimManipulator.create_scenario_manager(), CosimObserver.create_last_value()
assert execution.add_manipulator(manager)
assert execution.add_observer(observer)
assert execution.load_scenario(manager, "osp/scenarios/ellipse.json")
assert execution.step(int(sys.argv[1]))
index = execution.slave_index_from_instance_name("vessel")
references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
print(*observer.last_real_values(index, [references["v"], references["delta_Y_v"]]))
"""


def test_events_act_in_libcosim(portable, tmp_path):
    need("libcosim_osp")
    portable["events"] = [
        {"time": 0.2, "model": "vessel", "variable": "delta_Y_v", "action": "override", "value": -9.0}
    ]
    write(portable, tmp_path / "osp", export_osp)
    steps = round(portable["stop"] / portable["step"])
    found = re.findall(r"^(\S+) (-\S+)$", python(WITH_EVENTS, tmp_path, steps), re.M)
    v, delta = map(float, found[0])
    assert delta == -9.0
    result, _ = log_of(portable, tmp_path / "out")
    assert v == pytest.approx(cosim.read_log(result.folder, ["vessel.v"])["vessel.v"][-1], rel=1e-9)


def test_foreign_parameters_travel_beside(chain, tmp_path):
    """FMPy ignores them, and a note says so; the foreign FMUs are the same bytes."""
    notes = write(chain, tmp_path / "chain.ssp", export_ssp)
    assert len(notes) == 1
    assert "gain: k cannot become start values" in notes[0]
    write(chain, tmp_path / "osp", export_osp)
    foreign = Path(chain["fmus"]["gain"]["path"])
    assert (tmp_path / "osp" / "gain.fmu").read_bytes() == foreign.read_bytes()
    _, before = log_of(chain, tmp_path / "a")
    for source in ("chain.ssp", "osp"):
        assert log_of(tmp_path / source, tmp_path / "b")[1] == before


@pytest.mark.parametrize("case", ["libcosim_ssp", "libcosim_osp", "ecos"])
def test_foreign_parameters_are_taken(chain, tmp_path, case):
    need(case)
    write(chain, tmp_path / "chain.ssp", export_ssp)
    write(chain, tmp_path / "osp", export_osp)
    plan = {"ssp": str(tmp_path / "chain.ssp"), "osp": str(tmp_path / "osp"), "step": 0.25, "steps": 4}
    plan |= {"outputs": ["gain.y"], "set": "start"}
    tmp_path.joinpath("plan.json").write_text(json.dumps(plan))
    log_of(chain, tmp_path / "a")
    expected = cosim.read_log(tmp_path / "a", ["gain.y"])["gain.y"]
    assert expected[-1] == 3.0 * 1.75
    found = same_answer.run_apart(case, tmp_path)
    assert np.array_equal(found[:, 0], expected[1:]), found


def test_start_values_are_in_the_container(chain, tmp_path, monkeypatch):
    """Whatever modules this process knows by the names that the contained FMUs give theirs."""
    need("container_jacobi")
    write(chain, tmp_path / "chain.fmu", export_fmu)
    content = {
        "name": "c",
        "step": 0.25,
        "stop": 1.0,
        "fmus": {"all": {"path": str(tmp_path / "chain.fmu")}},
    }
    monkeypatch.setitem(sys.modules, "Gain", ModuleType("Gain"))
    result, _ = log_of(content, tmp_path / "out")
    log = cosim.read_log(result.folder, ["all.gain.y"])
    assert log["all.gain.y"][-1] == 3.0 * 1.75


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


@pytest.mark.parametrize(
    ("start", "case"),
    [
        ("from fmpy.ssp", "fmpy"),
        ("from ecospy", "ecos"),
        ("from libcosimpy", "libcosim_osp"),
        ("from fmpy import", "container_jacobi"),
    ],
)
def test_the_page_on_tools_tells_how_to_load(ellipse, tmp_path, start, case):
    """Each way to load ends at about the same place; the order of stepping makes a small difference.

    The container has compiled FMUs: a process may abort at its end by those of PythonFMU, as the page says.
    """
    need(case)
    (tmp_path / "s.json").write_text(json.dumps(ellipse | {"native": case == "container_jacobi"}))
    name, option = {"libcosim_osp": ("osp", "--osp"), "container_jacobi": ("system.fmu", "--fmu")}.get(
        case, ("system.ssp", "--ssp")
    )
    assert export([str(tmp_path / "s.json"), option, str(tmp_path / name), "--drop-faults"]) == 0
    code = next(b for b in re.findall(r"```python\n(.*?)```", TOOLS, re.S) if b.startswith(start))
    # libcosim also tells there what it does.
    found = float(re.findall(r"^[0-9.]+$", python(code, tmp_path), re.M)[-1])
    assert found == pytest.approx(5.018, abs=0.001)
