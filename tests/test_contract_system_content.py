"""A calibration of an FMU in files and words: numbers in the units of the parameters, and what is said."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

import cosim
from diagnosis.fmu_parameters.additional_force import AdditionalForce
from diagnosis.fmu_parameters.force_search import Accepted
from diagnosis.fmu_parameters.output import system_content
from diagnosis.fmu_parameters.output.system_content import ALONE, CalibrationReport, advice
from diagnosis.fmu_parameters.parameter_file import CalibratedParameter, Prior
from diagnosis.fmu_parameters.residuals import Setting
from diagnosis.fmu_parameters.system_calibration import CalibratedValue, SystemCalibration
from diagnosis.fmu_parameters.system_remainder import OutputRemainder, SystemRemainder

K = CalibratedParameter(name="k", unit="N/m", value=2.0, prior=Prior(std=0.5))
D = CalibratedParameter(name="d", value=4.0, prior=Prior(std=1.0), log=True)
Z = (1.0, -4.0)
STD = np.array([0.2, 0.1, 0.3])  # of z and of the force's coefficient, in its unit of 5
FORCE = AdditionalForce("f", "v", 2, coefficient=-3.0)
COVARIANCE = np.outer(STD, STD) * np.array([[1.0, 0.5, 0.0], [0.5, 1.0, -0.2], [0.0, -0.2, 1.0]])


def unit(name, exponents=None, factor=1.0):
    return SimpleNamespace(name=name, exponents=exponents, factor=factor, offset=0.0)


VARIABLES = {
    "k": SimpleNamespace(unit=unit("N/m", (1, 0, -2, 0, 0, 0, 0, 0))), "d": SimpleNamespace(unit=None),
    "f": SimpleNamespace(unit=unit("N")), "v": SimpleNamespace(unit=unit("m/s")),
}  # fmt: skip


def report(verdict="found", moved=(True, True), forces=True, rejected="", together=(), alike=("f:v",)):
    values = [
        CalibratedValue(p, p.at(z), (p.at(z) - 1.0, p.at(z) + 1.0), z, m)
        for p, z, m in zip((K, D), Z, moved, strict=True)
    ]
    accepted = [Accepted(FORCE, 0.85, 0.95, alike)] if forces else []
    setting = Setting(Z, (FORCE,) if forces else ())
    remainder = SystemRemainder(
        [
            OutputRemainder("x", "m", 0.1, 0.25, 0.5, False),
            OutputRemainder("w", "N", 2.0, 0.05, 0.5, False),
        ]
    )
    q = 2 + len(setting.forces)
    result = SystemCalibration(
        verdict, values, accepted, remainder, rejected, together,
        SimpleNamespace(setting=setting, sizes=(5.0,) if forces else ()), COVARIANCE[:q, :q],
        {"a": {"x": (0.5, 0.1), "w": (3.0, 2.0)}, "b": {"x": (0.6, 0.2), "w": (4.0, 1.0)}},
        {"b": (-20.0, 3.0)}, ["the FMU fails"],
    )  # fmt: skip
    model = SimpleNamespace(
        name="m", path=SimpleNamespace(name="m.fmu"), sha256="hash", variables=VARIABLES
    )
    confined = SimpleNamespace(
        model=model, confinement="landlock", outside=["o"], sentences=lambda: ["confined"]
    )
    task = SimpleNamespace(
        confined=confined, names=["x", "w"], units=["m", "N"], use={"a": "train", "b": "test"},
        content={"inputs": {}}, notes=["a note"],
    )  # fmt: skip
    return CalibrationReport(result, task, 321, {"runs": ["a"]})


@pytest.mark.parametrize(
    ("verdict", "moved", "forces", "rejected", "also", "far"),
    [
        ("found", (True, True), True, "", "k, d", True),
        ("ambiguous", (True, False), True, "", "k", False),
        ("parameters", (True, True), False, "", "", True),
        ("found", (False, False), True, "", "", False),
        ("found", (True, False), False, "", "", False),
        ("none", (False, True), True, "it predicts worse", "", True),
    ],
)
def test_the_sentence_names_what_differs(verdict, moved, forces, rejected, also, far):
    said = report(verdict, moved, forces, rejected).sentence
    assert said.startswith(system_content.SENTENCES[verdict])
    assert (f"Parameters differ as well: {also}." in said) == bool(also)
    assert ("Beyond three prior standard deviations: d;" in said) == far
    assert ("The fitted values are rejected: it predicts worse." in said) == bool(rejected)


def test_the_interval_of_a_force_is_in_its_unit():
    made = report()
    half = 1.959964 * 0.3 * 5.0
    assert made.force_interval(0) == pytest.approx((-3.0 - half, -3.0 + half), rel=1e-5)
    assert made.force_unit(FORCE) == "N/(m/s)^2"
    assert made.force_unit(AdditionalForce("f")) == "N"


def test_the_content_has_values_errors_and_what_was_rejected():
    stated = report().content()
    assert stated["verdict"] == "found"
    k, d = stated["parameters"]
    assert (k["name"], k["unit"], k["value"], k["z"], k["moved"]) == ("k", "N/m", 2.5, 1.0, True)
    assert k["prior"] == {"value": 2.0, "std": 0.5, "log": False, "origin": K.prior.origin}
    assert d["value"] == pytest.approx(4.0 * np.exp(-1.0))
    (effect,) = stated["effects"]
    assert (effect["id"], effect["input"], effect["confidence"]) == (FORCE.id, "f", 0.85)
    assert effect["coefficients"][FORCE.id]["value"] == -3.0
    assert effect["share_of_error"] == pytest.approx(1.0 - 0.5 * (0.25 + 0.05))
    assert effect["indistinguishable"] == ["f:v"]
    assert stated["suspect_coefficients"] == [{"name": "d", "z": -4.0, "value": d["value"]}]
    assert stated["withdrawn"] == []
    assert stated["remainder"]["outputs"]["w"] == {"rms": 2.0, "unit": "N", "share": 0.05, "p": 0.5}
    a, b = stated["errors"]
    assert (a["run"], a["use"], a["held_out"], "change" in a) == ("a", "train", False, False)
    assert (b["held_out"], b["change"]) == (True, {"squares": -20.0, "standard_error": 3.0})
    assert b["outputs"]["w"] == {"before": 4.0, "after": 1.0, "unit": "N"}
    assert stated["data"] == {"samples": 321, "used": 321}
    assert stated["fmu"]["sha256"] == "hash"
    rejected = report(rejected="it predicts worse").content()["withdrawn"]
    assert rejected == [{"id": "parameters", "reason": "it predicts worse"}]


def test_files_have_the_values_and_their_covariance(tmp_path):
    made = report()
    made.write(tmp_path, {"program": "x"}, [])
    stated = json.loads((tmp_path / "posterior.json").read_text())
    assert stated["names"] == ["m.k", "m.d", FORCE.id]
    assert stated["units"] == ["N/m", "1", "N/(m/s)^2"]
    assert stated["mean"] == pytest.approx([2.5, 4.0 * np.exp(-1.0), -3.0])
    # d = 4 exp(z / 4): its slope is exp(z / 4).
    scale = np.array([0.5, np.exp(-1.0), 5.0])
    np.testing.assert_allclose(stated["covariance"], COVARIANCE * np.outer(scale, scale))
    assert stated["task"] == {"runs": ["a"]}
    (found,) = cosim.read_parameters(tmp_path / "model.ssv").values.values()
    assert {n: p.value for n, p in found.items()} == pytest.approx({"k": 2.5, "d": 4.0 * np.exp(-1.0)})
    assert {n: p.unit for n, p in found.items()} == {"k": "N/m", "d": None}
    text = (tmp_path / "model.ssv").read_text()
    assert 'kg="1"' in text
    assert 's="-2"' in text
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == "found"
    page = (tmp_path / "report.html").read_text()
    assert "Calibration of an FMU" in page
    assert "fails" in page


@pytest.mark.parametrize("rejected", ["", "it predicts worse"])
def test_what_was_not_learned_is_no_parameter(tmp_path, rejected):
    made = report("none" if not rejected else "parameters", forces=False, rejected=rejected)
    made.write(tmp_path, {}, [])
    assert cosim.read_parameters(tmp_path / "model.ssv").values == {}


def test_tables_have_a_row_for_each():
    made = report(together=[("k", "d")])
    k, d = made.rows()
    assert k == ["k", "2", "2.5", "1.5 to 3.5", "N/m", "off"]
    assert d[4:] == ["1", "off"]
    assert [row[-1] for row in report(moved=(False, True)).rows()] == ["", "off"]
    (force,) = made.force_rows()
    assert (force[0], force[1], force[3:]) == (FORCE.id, "−3", ["N/(m/s)^2", "85%", "f:v"])
    assert next(report(alike=()).force_rows())[-1] == "-"
    rows = [*made.error_rows()]
    assert rows[0] == ["a (training)", "x", "0.5", "0.1", "m"]
    assert rows[3] == ["b (test)", "w", "4", "1", "N"]
    headings = [s.heading for s in made._sections()]
    assert headings == ["Parameters", "Additional forces", "Not identifiable alone", "Errors", "Notes"]
    sections = {s.heading: s for s in made._sections()}
    assert sections["Not identifiable alone"].text == ["Identifiable only together: k, d.", ALONE]
    assert sections["Additional forces"].text == [advice(made.result.forces[0])]
    assert sections["Notes"].text == ["the FMU fails", "a note", "confined"]
    less = [s.heading for s in report(forces=False)._sections()]
    assert less == ["Parameters", "Errors", "Notes"]
    none = next(s for s in report(alike=())._sections() if s.heading == "Additional forces")
    assert none.text == []


def test_advice_names_the_run_that_discriminates():
    force = AdditionalForce("f", "v", 1)
    assert advice(Accepted(force, 0.5, 0.9, ())) == ""
    stated = advice(Accepted(force, 0.5, 0.9, ("f:1", "g:1")))
    assert stated == "f:v is indistinguishable from f:1, g:1: run with other levels of v."
    stated = advice(Accepted(AdditionalForce("f"), 0.5, 0.9, ("f:v",)))
    assert stated == "f:1 is indistinguishable from f:v: run with more motion."


def test_the_terminal_has_names_to_the_left_and_numbers_to_the_right():
    console = Console(width=200, record=True)
    for part in report().shown("results"):
        console.print(part)
    text = console.export_text()
    assert text.splitlines()[0].startswith("The FMU lacks an additional force.")
    lines = [line for line in text.splitlines() if line.startswith(("parameter", "k ", "d "))]
    head, k, d = lines[:3]
    assert k.index("2.5") + 3 == d.index("1.472") + 5 == head.index("value") + 5
    assert k.index("N/m") + 3 == d.index(" 1 ") + 2 == head.index("unit") + 4
    assert "Files in results: diagnosis.json, model.ssv, posterior.json, report.html" in text
