"""What ``learn`` writes of an FMU with additional forces, and which of its parameters it calibrates."""

import ast
import json
from pathlib import Path
from types import SimpleNamespace

import pytest

import cosim
from diagnosis.fmu_parameters.additional_force import AdditionalForce
from diagnosis.fmu_parameters.output import found_fmu, learn_fmu
from diagnosis.fmu_parameters.output.found_fmu import write_found
from diagnosis.fmu_parameters.output.learn_fmu import _only_known
from diagnosis.predictors.fmu.wrapper import ADDED, FOREIGN
from diagnosis.predictors.predictor import FOUND, MAP
from fmus.build import BuildError

CAUSALITY = {
    "f": "input",
    "n": "input",
    "x": "output",
    "v": "output",
    "x_0": "parameter",
    "c": "parameter",
    "y_0": "local",
}
VARIABLES = {
    name: SimpleNamespace(causality=causality, start={"f": "0.5", "n": None}.get(name, "0"))
    for name, causality in CAUSALITY.items()
}
MODEL = SimpleNamespace(variables=VARIABLES, path=Path("ship.fmu"))
GIVEN = {
    "inputs": {"force": {"name": "f", "factor": 2.0}},
    "outputs": {"position": "x", "speed": None, "depth": 3.0},
    "start": {"position": {"name": "x_0"}, "side": "y_0"},
    "window": 6.0,
}
DRAG = AdditionalForce("f", "v", 2, coefficient=-3.0)
CONSTANT = AdditionalForce("n", coefficient=0.25)


@pytest.fixture
def container(monkeypatch):
    calls = []
    monkeypatch.setattr(found_fmu, "write_container", lambda *arguments: calls.append(arguments))
    return calls


def test_the_fmu_is_wired_to_the_sum_of_its_inputs_and_the_forces(container, tmp_path):
    """What comes from outside goes through the component, which adds the forces by the outputs."""
    said = write_found(tmp_path, MODEL, GIVEN, {"c": 11.0}, [DRAG, CONSTANT], 0.1)
    assert said == f"{FOUND} is ship.fmu with its calibrated parameters and the additional forces."
    ((path, foreign, source, wires, times, exposed, values),) = container
    assert (path, foreign) == (tmp_path / FOUND, MODEL.path)
    assert wires == [
        (f"{FOREIGN}.v", f"{ADDED}.from_0"),
        (f"{ADDED}.sum_0", f"{FOREIGN}.f"),
        (f"{ADDED}.sum_1", f"{FOREIGN}.n"),
    ]
    assert times == pytest.approx((0.1, 100.0))
    assert exposed == [f"{FOREIGN}.x_0"]
    assert values == {"c": 11.0}
    (call,) = (
        n
        for n in ast.walk(ast.parse(source))
        if isinstance(n, ast.Call) and getattr(n.func, "id", "") == "added_terms"
    )
    starts, count, terms = call.args
    assert ast.literal_eval(starts) == [0.5, 0.0]
    assert ast.literal_eval(count) == 1
    first, second = ([ast.literal_eval(a) for a in term.args] for term in terms.elts)
    assert first[:5] == [0, 0, 2, False, -3.0]
    assert second[:5] == [1, 0, 0, False, 0.25]


def test_its_map_has_the_new_names_and_only_what_is_there(container, tmp_path):
    write_found(tmp_path, MODEL, GIVEN, {}, [DRAG], 0.1)
    assert json.loads((tmp_path / MAP).read_text()) == {
        "inputs": {"force": {"name": f"{ADDED}.to_0", "factor": 2.0}},
        "outputs": {"position": f"{FOREIGN}.x", "depth": 3.0},
        "start": {"position": {"name": f"{FOREIGN}.x_0"}},
        "window": 6.0,
    }


def test_a_calibrated_input_is_no_fmu(container, tmp_path):
    said = write_found(tmp_path, MODEL, GIVEN, {"c": 1.0, "n": 2.0}, [DRAG], 0.1)
    assert said == f"No {FOUND} is written: calibrated values are inputs: n."
    assert container == []
    assert not (tmp_path / MAP).exists()


@pytest.mark.parametrize("error", [cosim.InputError("no space"), BuildError("no space")])
def test_why_it_is_not_written_is_said(monkeypatch, tmp_path, error):
    def fails(*_):
        raise error

    monkeypatch.setattr(found_fmu, "write_container", fails)
    assert write_found(tmp_path, MODEL, GIVEN, {}, [DRAG], 0.1) == f"No {FOUND} is written: no space."
    assert not (tmp_path / MAP).exists()


# Which parameters are calibrated


def known(name, seen, fault=""):
    return SimpleNamespace(parameter=SimpleNamespace(name=name), known=seen, fault=fault)


def stated(monkeypatch, *each):
    chosen = []
    monkeypatch.setattr(learn_fmu, "sensitivities", lambda part, advance: SimpleNamespace(each=each))
    parts = {
        use: SimpleNamespace(choose=lambda p, use=use: chosen.append((use, p)))
        for use in ("train", "test")
    }
    task = SimpleNamespace(notes=["first"], parameters=["all"])
    _only_known(task, parts, print)
    return task, chosen


def test_parameters_that_the_runs_do_not_tell_are_kept_and_said(monkeypatch):
    each = known("m", True), known("c", False), known("d", True, "d: fails above 3"), known("k", False)
    task, chosen = stated(monkeypatch, *each)
    assert task.parameters == [each[0].parameter, each[2].parameter]
    assert chosen == [("train", task.parameters), ("test", task.parameters)]
    assert task.notes == [
        "first",
        "d: fails above 3",
        "Not identifiable from these runs: c, k; kept at the start value.",
    ]


def test_all_that_are_known_leave_no_note_and_none_is_an_error(monkeypatch):
    task, _ = stated(monkeypatch, known("m", True))
    assert task.notes == ["first"]
    with pytest.raises(cosim.InputError, match="do not identify any parameter"):
        stated(monkeypatch, known("m", False))
